"""The command line as a script calls it: places are paths too, and one text is no list of words."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"


@pytest.fixture(autouse=True)
def hook() -> Iterator[None]:
    """The hook that a command sets for uncaught errors is taken back."""
    before = sys.excepthook
    yield
    sys.excepthook = before


@pytest.mark.parametrize("kind", [str, Path, PurePosixPath])
def test_a_place_may_be_a_path(kind: Any, capfd: pytest.CaptureFixture[str]) -> None:
    """It was told as a defect of fretwave."""
    assert fw.main(("check", kind(CASE), "--no-solve")) == 0 and "no errors" in capfd.readouterr().out


@pytest.mark.parametrize("words", ["check case.toml", [3], ["run", None], [b"run"], Path("keys"), 5], ids=repr)
def test_what_is_no_list_of_words_is_told(words: Any, capfd: pytest.CaptureFixture[str]) -> None:
    assert fw.main(words) == 2 and "no list of texts" in capfd.readouterr().err


@pytest.mark.parametrize("kind", [lambda text: text, lambda text: [text], lambda text: (text,)])
def test_one_override_may_stand_alone(kind: Any) -> None:
    """Its letters were taken for overrides."""
    case = fw.load_case(CASE, overrides=kind('title="another"'))
    assert case.title == "another"
