"""Pairs that press without [preload]: all analyses of a case are about one state, and it is said which."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tolerances import SOLVED

import fretwave as fw
from fretwave.case.load import load_case
from fretwave.commands.main import main

pytestmark = pytest.mark.ranks(1)

K, KN, GAP = 2.0, 3.0, -0.5
CASE = f"""
[model]
dofs = ["x", "y"]
M = [[1.0, 0.0], [0.0, 1.5]]
K = [[{K}, 0.1], [0.1, {K}]]

[[contact]]
name = "pad"
law = "LAW"
pairs = ["y"]
normal_stiffness = {KN}
gap = {GAP}
{{more}}

[[analysis]]
name = "static"
type = "static"

[[analysis]]
name = "mode"
type = "mode"
harmonics = 1
samples = 64
normalise = "y"
linear_mode = 2
amplitude = [1e-4, 1e-3]
"""
FRICTION = 'tangents = ["x"]\ntangential_stiffness = 0.5\nfriction_coefficient = 0.3'
#: Laws, their other parameters, and whether the interference is balanced without [preload].
LAWS = {
    "with memory": (CASE.replace("LAW", "coulomb_2d").format(more=FRICTION), True),
    "of the present motion": (CASE.replace("LAW", "unilateral_spring").format(more=""), False),
}


def pressed(folder: Path, text: str) -> tuple[float, float]:
    """Normal force of the static state, and that of the mode's mean position."""
    (folder / "case.toml").write_text(text)
    assert main(["run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots", "--force"]) == 0
    run = fw.open_run(folder / "run")
    mean = run["mode"].coefficients([0])[0, 1, run["mode"].labels.index("0")]
    return float(np.asarray(run["static"]["normal_force"])[0]), KN * (mean - GAP)


@pytest.mark.parametrize("text, balanced", LAWS.values(), ids=LAWS)
def test_an_interference_without_preload(tmp_path: Path, capfd, text: str, balanced: bool) -> None:
    """It bears KN |gap| where that is balanced, else it moves the structure; static states and modes alike."""
    stiffness = np.array([[K, 0.1], [0.1, K]]) + np.diag([0.5 * (text.find("tangents") > 0), KN])
    free = KN * (np.linalg.solve(stiffness, [0.0, KN * GAP])[1] - GAP)
    said = "is taken as balanced" if balanced else "moves the structure"
    assert pressed(tmp_path, text) == pytest.approx((-KN * GAP if balanced else free,) * 2, rel=SOLVED)
    assert f"note: contact 'pad': its gap (an interference) {said}" in capfd.readouterr().out
    for word, force in (("true", -KN * GAP), ("false", free)):
        given = f"[preload]\nbalanced = {word}\n{text}"
        assert pressed(tmp_path, given) == pytest.approx((force, force), rel=SOLVED)
        assert "note: contact" not in capfd.readouterr().out


def test_contacts_without_memory_are_balanced_beside_one_that_presses(tmp_path: Path, capfd) -> None:
    """The structure stays where it is; alone they move it, and no [preload] is advised: time integration has none."""
    (text, _), (other, _) = LAWS.values()
    contact = other[other.index("[[contact]]") : other.index("[[analysis]]")].replace('"pad"', '"stop"')
    mixed = text.replace("[[analysis]]", f"{contact}[[analysis]]", 1)
    assert pressed(tmp_path, mixed) == pytest.approx((-KN * GAP,) * 2, rel=SOLVED)
    said = capfd.readouterr().out
    for name in ("pad", "stop"):
        assert f"'{name}': its gap (an interference) is taken as balanced" in said
    (tmp_path / "case.toml").write_text(other)
    assert "[preload], which" not in " ".join(load_case(tmp_path / "case.toml").notes)
