"""The JSON schema of case files says what the reader of cases says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import call
from jsonschema import Draft202012Validator

from fretwave.case.json_schema import SHIPPED, json_schema, json_text
from fretwave.model.laws import laws

try:
    import tomllib
except ImportError:
    import tomli as tomllib

pytestmark = pytest.mark.ranks(1)

CASES = sorted((Path(__file__).parents[2] / "cases").glob("*/case.toml"))


def problems(data: dict[str, Any]) -> list[str]:
    validator = Draft202012Validator(json_schema(laws()))
    return [f"{'.'.join(map(str, error.absolute_path))}: {error.message}" for error in validator.iter_errors(data)]


def two_dof() -> dict[str, Any]:
    (file,) = (path for path in CASES if path.parent.name == "two_dof")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def test_it_is_a_schema_and_the_shipped_one_is_it(capsys: pytest.CaptureFixture[str]) -> None:
    Draft202012Validator.check_schema(json_schema(laws()))
    assert SHIPPED.read_text(encoding="utf-8") == json_text(laws())
    assert call("check", "--schema") == 0
    assert json.loads(capsys.readouterr().out) == json_schema(laws())


@pytest.mark.parametrize("file", CASES, ids=lambda path: path.parent.name)
def test_every_case_follows_it(file: Path) -> None:
    assert problems(tomllib.loads(file.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "place, key, value",
    [
        (("analysis", 0), "harmnics", 3),
        (("analysis", 0), "harmonics", 0),
        (("analysis", 0), "samples", 2),
        (("analysis", 0), "type", "mod"),
        (("analysis", 0), "amplitude", [1.0]),
        (("analysis", 0), "step", {"maximum": -1.0}),
        (("contact", 0), "friction_limit", -1.0),
        (("contact", 0), "normal_stiffness", 1e6),
        (("contact", 0), "law", "coulomb"),
        (("model",), "stiffness_damping", "a lot"),
        ((), "modle", {}),
    ],
)
def test_what_the_reader_refuses_is_underlined(place: tuple[Any, ...], key: str, value: Any, tmp_path: Path) -> None:
    data = two_dof()
    at = data
    for step in place:
        at = at[step]
    at[key] = value
    assert problems(data), f"{place} {key} = {value!r} passes the schema"


def test_names_and_numbers_of_dofs_are_both_taken() -> None:
    data = two_dof()
    data["contact"][0]["pairs"] = [[1, "m2"]]
    assert problems(data) == []


def test_a_parameter_may_be_given_per_pair_and_per_area() -> None:
    data = two_dof()
    contact = data["contact"][0]
    contact["friction_limit"] = [5.0]
    assert problems(data) == []
    contact["friction_limit_per_area"] = contact.pop("friction_limit")
    assert problems(data) == []
