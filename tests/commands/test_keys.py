"""``fretwave check --keys``: what a key takes, which laws there are, and in whose units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fretwave.case.json_schema import json_text
from fretwave.commands.keys import key_lines
from fretwave.model.laws import laws
from fretwave.model.structure import Structure
from fretwave.results.model_file import write_model

pytestmark = pytest.mark.ranks(1)


def _line(text: str, case: Path | None = None) -> str:
    return next(line for line in key_lines(case) if line.strip().startswith(text))


@pytest.mark.parametrize("key", ["retain", "method", "wave", "stepper", "interface ", "distribution", "axis"])
def test_a_key_that_takes_words_says_which(key: str) -> None:
    assert " (one of " in _line(key)


def test_every_law_is_listed_with_its_parameters() -> None:
    text = "\n".join(key_lines())
    for law in laws().values():
        section = text.split(f'law = "{law.name}"')[1].split("\n[")[0]
        assert law.doc in section and all(f"\n  {parameter.name} " in section for parameter in law.parameters)


def test_the_short_form_is_listed() -> None:
    assert _line("quick")


@pytest.mark.parametrize("told", ["mm-t-s", None], ids=["told", "not_told"])
def test_units_are_those_of_the_model_file(tmp_path: Path, told: str | None) -> None:
    write_model(tmp_path / "blade.h5", Structure(np.eye(1), 4.0 * np.eye(1), names=["m1"]), told)
    (tmp_path / "case.toml").write_text('[model]\nfile = "blade.h5"\n')
    assert f"[{'N/mm' if told else 'N/m'}]" in _line("normal_stiffness", tmp_path / "case.toml")


#: Models whose units are not known.
UNKNOWN = {
    "builder": 'builder = "blade.py"',
    "missing": 'file = "missing.h5"',
    "no such units": 'units = "mm"',
    "units that are no text": "units = 1",
}


@pytest.mark.parametrize("model", UNKNOWN.values(), ids=UNKNOWN)
def test_units_that_are_not_known_are_quantities(tmp_path: Path, model: str) -> None:
    (tmp_path / "case.toml").write_text(f"[model]\n{model}\n")
    assert "[force/length]" in _line("normal_stiffness", tmp_path / "case.toml")


def test_editors_complete_per_area_only_what_may_be() -> None:
    text = json_text(laws())
    assert '"normal_stiffness_per_area"' in text
    assert '"gap_per_area"' not in text and '"friction_coefficient_per_area"' not in text
