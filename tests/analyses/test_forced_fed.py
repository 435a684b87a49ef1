"""A steady response beside motions that gain energy by themselves is not told without them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call
from models.flow_chain import OMEGA, SECTORS, case_of

#: Feeds the forward waves, and damps the backward ones.
FLOW = {0: 0.02 - 0.06j, 1: -0.1 + 0.02j, -1: 0.12 + 0.05j}
EVERY = range(-(SECTORS // 2), SECTORS // 2 + 1)
DEVIATIONS = [1e-9, -2e-9, 1.5e-9, 0.5e-9, -1e-9]
WHEEL, MISTUNED = "wheel = true", f"wheel = true\nmistuning = {{ deviations = {DEVIATIONS} }}"
CASES = {
    "fed wave": (1, "aerodynamics = true", 0.0, [1]),
    "damped wave": (4, "aerodynamics = true", 0.0, [-1]),
    "wheel": (4, f"aerodynamics = true\n{WHEEL}", 0.0, EVERY),
    "mistuned wheel": (4, f"aerodynamics = true\n{MISTUNED}", 0.0, EVERY),
    "damper below zero": (1, "", -0.01, [1]),
    "damper": (1, "", 0.01, [1]),
}


def stuck(diameters: int, flow: dict[int, complex], damper: float) -> complex:
    """lambda of a mass in a wave, all pairs stuck."""
    ahead = {k: np.exp(-2j * np.pi * k * diameters / SECTORS) for k in flow}
    c = damper - sum(L.imag / OMEGA * ahead[k] for k, L in flow.items())
    k = 1 + 4 * np.sin(np.pi * diameters / SECTORS) ** 2 - sum(L.real * ahead[j] for j, L in flow.items())
    return max(np.roots([1.0, c, k]), key=lambda one: one.imag)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("order, keys, damper, waves", CASES.values(), ids=CASES)
def test_motions_that_grow_beside_a_response_are_those_of_the_closed_form(tmp_path, capfd, order, keys, damper, waves):
    """Peaks of a wave that the flow feeds by 8 % were told without a word."""
    path, out = tmp_path / "case.toml", tmp_path / "run"
    path.write_text(case_of(FLOW, order, keys, damper), encoding="utf-8")
    assert call("run", path, "--out", out, "--no-plots") == 0
    said = capfd.readouterr().out
    assert call("check", path) == 0
    beforehand = capfd.readouterr().out
    values = [stuck(diameters, FLOW if "aero" in keys else {}, damper) for diameters in waves]
    expected = sorted(-value.real / abs(value) for value in values if value.real > 0)
    fed = json.loads((out / "run.json").read_text())["analyses"]["forced"].get("fed", [])
    found = sorted(mode["zeta"] for mode in fed if mode["contact"] == "stuck")
    assert found == pytest.approx(expected, rel=1e-6)
    for text in (said, beforehand):
        assert ("whether the responses are stable is not known, but " in text) == bool(expected)


@pytest.mark.ranks(1)
@pytest.mark.parametrize(("across", "fed"), [(0.02, True), (0.005, False)])
def test_dampers_feed_a_motion_that_no_dof_feeds_alone(tmp_path, capfd, across, fed):
    """C = [[c, d], [d, c]] damps both dofs and, for d > c, feeds where one moves against the other: zeta is below 0."""
    path = tmp_path / "case.toml"
    path.write_text(
        "[model]\ndofs = ['a', 'b']\nM = [[1.0, 0.0], [0.0, 1.0]]\nK = [[2.0, -1.0], [-1.0, 2.0]]\n"
        f"C = [[0.01, {across}], [{across}, 0.01]]\n[[contact]]\nname = 'pad'\nlaw = 'jenkins'\npairs = ['a']\n"
        "tangential_stiffness = 0.5\nfriction_limit = 1.0\n[[analysis]]\nname = 'forced'\ntype = 'forced'\n"
        "harmonics = 1\nforce = { a = 1.0 }\nlevels = [1e-4]\nfrequency = [0.1, 0.35]\nobserve = 'a'\n",
        encoding="utf-8",
    )
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == 0
    assert ("whether the responses are stable is not known, but " in capfd.readouterr().out) is fed
