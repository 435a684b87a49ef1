"""Symbols of papers where keys have long names: the message names the key that is meant."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from command_line import call

pytestmark = pytest.mark.ranks(1)

TWO_DOF = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
LAWS = {
    "regularised_coulomb": ("friction_limit = 5.0", "regularisation_velocity = 0.05"),
    "jenkins": ("tangential_stiffness = 40.0", "friction_limit = 5.0"),
    "coulomb_2d": (
        "normal_stiffness = 4e3",
        "tangential_stiffness = 3e3",
        "friction_coefficient = 0.3",
        "normal_load = 9",
    ),
}


def case_with(tmp_path: Path, law: str, long: str, symbol: str) -> Path:
    """two_dof with this law, one of its parameters written as a symbol."""
    text = TWO_DOF.read_text()
    keys = "\n".join(LAWS[law]).replace(long, symbol)
    start, end = text.index('law = "regularised'), text.index("# First mode")
    path = tmp_path / "case.toml"
    path.write_text(f'{text[:start]}law = "{law}"\npairs = ["m2"]\n{keys}\n\n{text[end:]}')
    return path


@pytest.mark.parametrize(
    ("law", "symbol", "long", "said"),
    [
        ("coulomb_2d", "kn", "normal_stiffness", "kn"),
        ("coulomb_2d", "k_t", "tangential_stiffness", "kt"),
        ("coulomb_2d", "mu", "friction_coefficient", "mu [-]"),
        ("coulomb_2d", "N0", "normal_load", "N0, contact force at zero relative displacement and gap [N]"),
        ("jenkins", "kt", "tangential_stiffness", "kt of the elastic part"),
        ("jenkins", "mu", "friction_limit", "sliding force mu N [N]"),
        ("regularised_coulomb", "mu_N", "friction_limit", "sliding force mu N [N]"),
        ("regularised_coulomb", "eps", "regularisation_velocity", "eps; smaller is closer to Coulomb [m/s]"),
        ("coulomb_2d", "normal_stifness", "normal_stiffness", "kn"),
    ],
)
def test_parameter_of_a_law(law, symbol, long, said, tmp_path: Path, capfd) -> None:
    assert call("check", case_with(tmp_path, law, long, symbol)) == 2
    told = capfd.readouterr().err
    assert f"unknown key '{symbol}' in contact.damper" in told
    assert re.search(rf"fix: +did you mean `{long}`\? \({re.escape(said)}", told), told
    assert told.count("error: ") == 1 and "is missing" not in told and "2. " not in told


@pytest.mark.parametrize(
    ("key", "long"), [("mode.nh=7", "harmonics"), ("mode.Nt=64", "samples"), ("forced.EO=2", "engine_order")]
)
def test_key_of_an_analysis(key: str, long: str, capfd) -> None:
    assert call("check", TWO_DOF, "--set", key) == 2
    assert f"did you mean `{long}`?" in capfd.readouterr().err


def test_a_symbol_of_nothing_here(capfd) -> None:
    """A law without normal stiffness is not told to have one."""
    assert call("check", TWO_DOF, "--set", "contact.damper.kn=3") == 2
    told = capfd.readouterr().err
    assert "unknown key 'kn'" in told and "remove the key" in told and "normal_stiffness" not in told
