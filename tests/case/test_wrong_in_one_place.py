"""One slip in a right case is told as one slip, whatever else of the case needs what it spoils."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command_line import call

from fretwave.case import plugins
from fretwave.case.json_schema import SHIPPED

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "cases" / "robustness"))
import bases  # noqa: E402
from mutations import as_toml  # noqa: E402

pytestmark = pytest.mark.ranks(1)

#: What becomes of a matrix' rows -> what is said.
WRONG_ROWS = {
    "ragged": (lambda rows: [[*rows[0], 0.0], *rows[1:]], "differ in length"),
    "wide": (lambda rows: [[*row, 0.0] for row in rows], "is not square"),
    "small": (lambda rows: [row[:-1] for row in rows[:-1]], "has the wrong size"),
    "a file": (lambda rows: "none.npz", "does not exist"),
}


def checked(folder: Path, base: str, case: dict[str, Any], capfd: Any) -> str:
    """What `check` says of a case that is wrong in one place; its plug-ins are forgotten."""
    bases.prepare(folder)
    (folder / base / "case.toml").write_text(as_toml(case), encoding="utf-8")
    assert call("check", folder / base / "case.toml") == 2
    for plugin in plugins.loaded():
        plugins.forget(plugin.path)
    return str(capfd.readouterr().err)


@pytest.mark.parametrize("base", ["speed", "sector"])
@pytest.mark.parametrize("letter", ["M", "K"])
@pytest.mark.parametrize("wrong", WRONG_ROWS)
def test_a_matrix_that_cannot_be_read_is_all_that_is_told(wrong, letter, base, tmp_path: Path, capfd) -> None:
    """A sector of it is none without it, and its damping has no size: nothing is said of either."""
    change, said = WRONG_ROWS[wrong]
    case = bases.SHORT[base]()
    case["model"][letter] = change(case["model"][letter])
    error = checked(tmp_path, base, case, capfd)
    assert error.startswith("error: ") and said in error and error.count("\n") <= 6


def test_faces_that_do_not_match_are_all_that_is_told(tmp_path: Path, capfd) -> None:
    case = bases.SHORT["sector"]()
    case["model"]["high"] = ["hx", "hy"]
    error = checked(tmp_path, "sector", case, capfd)
    assert error.startswith("error: the faces of the sector do not match") and "remove the key" not in error


@pytest.mark.parametrize("model", [3, "model.h5", []])
def test_a_model_that_is_no_table_is_told(model: object, tmp_path: Path, capfd) -> None:
    error = checked(tmp_path, "speed", {**bases.SHORT["speed"](), "model": model}, capfd)
    assert "model" in error and "defect" not in error


#: Places of speeds in the case `speed`.
SPEEDS = (
    *(("model", "speed_rpm"), ("contact", 0, "load_rpm"), ("analysis", 3, "force_rpm")),
    *(("analysis", 0, "speed_rpm"), ("analysis", 0, "up_to_rpm"), ("analysis", 0, "speeds_rpm", 1)),
)


WRONG_SPEEDS = [(place, speed) for place in SPEEDS for speed in (1e200, 10**399, float("inf"), -1.0, 1e-200)]


@pytest.mark.parametrize(("place", "speed"), WRONG_SPEEDS, ids=str)
def test_a_speed_whose_square_is_no_number_is_told(place, speed: float, tmp_path: Path, capfd) -> None:
    """The growth from one speed to another has the square of both."""
    case = holder = bases.SHORT["speed"]()
    for part in place[:-1]:
        holder = holder[part]
    holder[place[-1]] = speed
    error = checked(tmp_path, "speed", case, capfd)
    assert "_rpm" in error and "defect" not in error


@pytest.mark.parametrize("table", ["at_speed", "loads_at_speed"])
@pytest.mark.parametrize("speed", ["1e200", "1e-200", "inf", "nan", "-60"])
def test_a_speed_as_a_key_is_one(speed: str, table: str, tmp_path: Path, capfd) -> None:
    case = bases.SHORT["speed"]()
    given = case["model"][table]["centrifugal"] if table == "loads_at_speed" else case["model"][table]
    given[speed] = given.pop(next(iter(given)))
    error = checked(tmp_path, "speed", case, capfd)
    assert f"'{speed}' is no speed of a turning model" in error and "1e-30 to 1e+30" in error


#: Base -> where a number of it stands: of a dict, of an analysis that a plug-in brings.
NUMBERS = {
    "speed": ("analysis", 3, "force", "t"),
    "filed": ("analysis", 0, "frequency", 0),
}


@pytest.mark.parametrize("value", [float("nan"), float("inf")], ids=str)
@pytest.mark.parametrize("base", NUMBERS)
def test_a_number_that_is_not_finite_is_told(base: str, value: float, tmp_path: Path, capfd) -> None:
    """A force of nan had no errors, and its run failed; keys of plug-ins took any."""
    case = holder = bases.SHORT[base]()
    for part in NUMBERS[base][:-1]:
        holder = holder[part]
    holder[NUMBERS[base][-1]] = value
    error = checked(tmp_path, base, case, capfd)
    assert "finite number" in error and error.count("fix:") == 1


def test_every_key_of_a_case_is_in_one_that_is_made_wrong() -> None:
    """But for the parameters of all laws: a key that no right case has is never made wrong."""
    schema = json.loads(SHIPPED.read_text(encoding="utf-8"))
    schema["properties"].pop("contact")
    have = {name for base in bases.SHORT.values() for name in names_of(base())}
    assert not set(keys_of(schema)) - have


def keys_of(schema: Any) -> Iterator[str]:
    """Names of all properties."""
    for key, value in schema.items() if isinstance(schema, dict) else enumerate(schema):
        if key == "properties":
            yield from value
        if isinstance(value, (dict, list)):
            yield from keys_of(value)


def names_of(value: Any) -> Iterator[str]:
    """Keys of tables in tables."""
    if isinstance(value, dict):
        yield from value
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from names_of(part)
