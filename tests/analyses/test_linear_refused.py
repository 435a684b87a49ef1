"""What a linear analysis refuses, each with one fix, and what `check` says of one."""

from __future__ import annotations

import pytest
from models.linear_cases import POINT, ring

from fretwave.case.load import load_case
from fretwave.commands.check import check_case
from fretwave.errors import CaseErrors

pytestmark = pytest.mark.ranks(1)

WRONG = {
    "no modes": ("modes = 0\n", "modes", "a value >= 1"),
    "no such wave": ("nodal_diameters = [1, 5]\n", r"nodal_diameters\[1\]", "0 .. 4 of 8 sectors"),
    "a backward wave": ("nodal_diameters = [-1]\n", "nodal_diameters", "a value >= 0"),
    "a speed of nothing": ("speed_rpm = 0.0\n", "speed_rpm", "a value > 0"),
    "no speed for orders": ("engine_orders = [2]\n", "engine_orders", "speed_rpm beside it"),
    "no speed for the diagram": ("up_to_rpm = 2.0\n", "up_to_rpm", "speed_rpm beside it"),
    "a diagram that ends too soon": ("speed_rpm = 6.0\nup_to_rpm = 5.0\n", "up_to_rpm", "more than 6"),
    "order nought": ("speed_rpm = 6.0\nengine_orders = [0]\n", "engine_orders", "a value >= 1"),
    "speeds without a dependence": ("speeds_rpm = [0.0, 1.0]\n", "speeds_rpm", "a part 'spin'"),
    "a dependence without speeds": ('spin_stiffness = "spin"\n', "spin_stiffness", "speeds_rpm beside it"),
    "an order of another wave": (
        "speed_rpm = 6.0\nengine_orders = [3, 6]\nnodal_diameters = [3]\n",
        r"engine_orders\[1\]",
        "6 excites 2 nodal diameters",
    ),
    "no such contact": ('contact = ["open"]\n', "contact", "stuck"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_is_refused_with_one_fix(name, tmp_path):
    keys, place, expected = WRONG[name]
    path = tmp_path / "case.toml"
    path.write_text(ring(8).replace("speed_rpm = 6.0\n", keys), encoding="utf-8")
    with pytest.raises(CaseErrors, match=place) as caught:
        load_case(path)
    text = str(caught.value)
    assert expected in text and text.count("fix:") == 1 and "case.toml:" in text


def test_waves_are_of_sectors(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(POINT + "nodal_diameters = [1]\n", encoding="utf-8")
    with pytest.raises(CaseErrors, match="has nodal diameters, but no sector"):
        load_case(path)


def test_stuck_contact_needs_contact(tmp_path):
    path = tmp_path / "case.toml"
    text = POINT[: POINT.index("[[contact]]")] + POINT[POINT.index("[[analysis]]") :]
    path.write_text(text + 'contact = ["stuck"]\n', encoding="utf-8")
    with pytest.raises(CaseErrors, match="is of a model without contact"):
        load_case(path)


def test_check_says_what_it_would_do(tmp_path, comm, capsys):
    path = tmp_path / "case.toml"
    path.write_text(ring(8) + "modes = 1\nnodal_diameters = [2]\n", encoding="utf-8")
    assert check_case(path, (), (), False, comm) == 0
    assert "1 linear mode of each contact that differs, nodal diameters 2, crossings about 6 rev/min" in (
        capsys.readouterr().out
    )
