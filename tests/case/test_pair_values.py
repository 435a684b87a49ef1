"""A contact's parameter from a CSV file: the same case as with the values written in it, and errors by line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.chain_case import BUILDER
from models.wear_case import TEXT

import fretwave as fw
from fretwave.case.load import load_case

pytestmark = pytest.mark.ranks(1)

CASE = """
[model]
dofs = ["a", "b", "c"]
M = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
K = [[3.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 3.0]]

[[contact]]
name = "pad"
law = "jenkins"
pairs = ["a", "b", "c"]
tangential_stiffness = 1.5
friction_limit = "limits.csv"

[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 64
normalise = "a"
amplitude = [0.01, 1.0]
"""
LIMITS = [0.5, 0.25, 2.0]
TABLE = "pair,place,friction_limit [N]\n2,left,2.0\n0,right,0.5\n\n1,top,2.5e-1\n"


def put(folder: Path, table: str = TABLE, case: str = CASE) -> Path:
    (folder / "limits.csv").write_text(table)
    (folder / "case.toml").write_text(case)
    return folder / "case.toml"


def test_as_written_in_the_case(tmp_path: Path) -> None:
    """Rows in any order, other columns beside; what decides the results is the numbers."""
    of_file = load_case(put(tmp_path))
    written = load_case(put(tmp_path, case=CASE.replace('"limits.csv"', str(LIMITS))))
    assert np.array_equal(of_file.contacts[0].parameters["friction_limit"], LIMITS)
    assert of_file.digest == written.digest
    assert load_case(put(tmp_path, TABLE.replace("2.0", "3.0"))).digest != written.digest


def test_on_the_command_line(tmp_path: Path, capfd) -> None:
    path = put(tmp_path, case=CASE.replace('"limits.csv"', "1.0"))
    assert call("check", path, "--set", "contact.pad.friction_limit=limits.csv") == 0
    assert "friction_limit = 0.25 to 2" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("pair,friction_limit\n0,0.5\n1,x\n2,1\n", ("has no such value", "limits.csv:3", "x", "a number >= 0")),
        ("pair,friction_limit\n0,0.5\n1,-1\n2,1\n", ("has no such value", "limits.csv:3", "-1")),
        ("pair,friction_limit\n0,0.5\n1,nan\n2,1\n", ("has no such value", "limits.csv:3", "nan")),
        ("pair,friction_limit\n0,0.5\n1,0.1_5\n2,1\n", ("has no such value", "limits.csv:3", "0.1_5")),
        ("pair,friction_limit\n0,0.5\n3,1\n2,1\n", ("is of no pair", "limits.csv:3", "pair 3", "0 to 2")),
        ("pair,friction_limit\n0,0.5\n0,1\n2,1\n", ("has a pair again", "limits.csv:3", "pair 0")),
        ("pair,friction_limit\n0,0.5\n1\n", ("ends early", "limits.csv:3", "1 columns")),
        ("pair,friction_limit\n0,0,5\n1,1,0\n2,1,0\n", ("of more columns", "limits.csv:2", "0,0,5", "decimal points")),
        ("pair,friction_limit\n0,20.5,\n", ("of more columns", "limits.csv:2", "3 columns", "2, as its headings")),
        ("pair,friction_limit,place\n0,0.5\n", ("ends early", "limits.csv:2", "2 columns")),
        ("pair;friction_limit\n0;0,5\n", ("has other headings", "commas between columns")),
        ("pair,friction_limit\n0,0.5\n", ("lacks pairs", "none for pair 1 and 1 more", "3 lines")),
        ("pair,friction_limit [kN]\n0,0.5\n", ("has other headings", "limits.csv:1", "pair,friction_limit [N]")),
        ("0,0.5\n1,1\n", ("has other headings", "limits.csv:1")),
        ("pair,friction_limit,friction_limit [N]\n0,0.5,2\n", ("has a column twice", "limits.csv:1", "friction_limit")),
        ("pair,friction_limit,pair\n0,0.5,2\n", ("has a column twice", "limits.csv:1", "one column pair")),
        ("", ("has other headings", "nothing")),
    ],
)
def test_errors_say_the_line(tmp_path: Path, table: str, words: tuple[str, ...]) -> None:
    with pytest.raises(fw.InputError) as error:
        load_case(put(tmp_path, table))
    said = str(error.value)
    assert all(word in said for word in (*words, "case.toml", "contact.pad.friction_limit", "fix:")), said


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(fw.InputError, match="does not exist") as error:
        load_case(put(tmp_path, case=CASE.replace("limits", "limit")))
    assert "did you mean `limits.csv`?" in str(error.value)


def with_stiffness(folder: Path, value: str, heading: str = "", system: str = "m-kg-s") -> Path:
    """The built chain, whose pairs have areas, with its stiffness per area."""
    shutil.copy(BUILDER, folder / "model.py")
    (folder / "k.csv").write_text(f"pair,tangential_stiffness_per_area{heading}\n1,2e10\n0,2e10\n")
    text = TEXT.replace("per_area = 2e10", f"per_area = {value}")
    (folder / "case.toml").write_text(text.replace("[model]", f'[model]\nunits = "{system}"'))
    return folder / "case.toml"


@pytest.mark.parametrize(
    ("system", "unit"), [("m-kg-s", "Pa/m"), ("mm-t-s", "MPa/mm"), ("in-lbf-s", "psi/in")], ids=["SI", "mm", "in"]
)
def test_what_is_given_per_area_has_the_unit_of_that(tmp_path: Path, system: str, unit: str) -> None:
    """It was told, and expected of a table, as the force or stiffness of a pair."""
    stiffness = load_case(with_stiffness(tmp_path, '"k.csv"', f" [{unit}]", system)).contacts[0].parameters
    assert stiffness["tangential_stiffness"] == pytest.approx([4e6, 4e6])
    per_pair = {"m-kg-s": "N/m", "mm-t-s": "N/mm", "in-lbf-s": "lbf/in"}[system]
    for value, heading in (('"k.csv"', f" [{per_pair}]"), ("-1.0", "")):
        with pytest.raises(fw.FretwaveError) as error:
            load_case(with_stiffness(tmp_path, value, heading, system))
        assert f"[{unit}]" in str(error.value)
