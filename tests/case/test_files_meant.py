"""A file that is missing: what is proposed in its place is a file that the key can read."""

from __future__ import annotations

from pathlib import Path

import pytest

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors

pytestmark = pytest.mark.ranks(1)

CASE = """
[model]
dofs = ["m1"]
M = [[1.0]]
K = {K}
[[contact]]
law = "jenkins"
pairs = ["m1"]
tangential_stiffness = 5.0
friction_limit = {limit}
[[analysis]]
name = "linear"
type = "linear"
"""
MISSING = {
    "matrix": (CASE.format(K='"values_of_blade.mtx"', limit="1.0"), "values_of_blad.mtx", "values_of_blade.csv"),
    "values": (CASE.format(K="[[4.0]]", limit='"values_of_blade.csv"'), "values_of_blad.csv", "values_of_blade.mtx"),
    "model": (
        '[model]\nfile = "values_of_blade.h5"\n[[analysis]]\nname = "linear"\ntype = "linear"\n',
        "values_of_blad.h5",
        "values_of_blade.mtx",
    ),
}


@pytest.mark.parametrize("kind", MISSING)
def test_a_file_that_can_be_read_is_proposed(kind: str, tmp_path: Path) -> None:
    text, readable, other = MISSING[kind]
    (tmp_path / "case.toml").write_text(text)
    for names, said in (((other,), False), ((other, readable), True)):
        for name in names:
            (tmp_path / name).touch()
        with pytest.raises(CaseErrors, match="does not exist") as caught:
            load_case(tmp_path / "case.toml")
        assert other not in str(caught.value) and (f"did you mean `{readable}`?" in str(caught.value)) == said
