"""What is said of a mode's limit cycles, against time integration and eigenvalues of the linear states."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from models.jenkins_motion import JenkinsMotion
from tolerances import REPEATED, SOLVED

from fretwave.analyses.parts import fed_modes
from fretwave.results.overview import Overview, overviews
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

pytestmark = pytest.mark.ranks(1)

#: Two modes, the first one fed while its slider sticks; its branch runs back where damping passes through zero.
BACK = {
    "M": [[0.017093403349051732, 0.0], [0.0, 0.020816800983414763]],
    "K": [[0.5175186179602942, -0.24379992114885093], [-0.24379992114885093, 0.1906209107117398]],
    "C": [[0.0030206598787502897, -0.004576287558470432], [-0.004576287558470432, -0.0045734532484947585]],
    "stiffness": 1.3482587303369675,
    "limit": 0.0006505405605868649,
}
#: Three modes, all of them fed, the first one until its slider has slipped.
FED = {
    "M": [[0.16012924871925024, 0.0, 0.0], [0.0, 0.3307937265414089, 0.0], [0.0, 0.0, 0.07307943155089885]],
    "K": [
        [0.22318215512714454, -0.016727982502442996, 7.929549203948151e-05],
        [-0.016727982502442996, 0.6232312247092922, -0.010630191877204914],
        [7.929549203948151e-05, -0.010630191877204914, 0.1348972748700744],
    ],
    "C": [
        [-0.0014231046049233542, -4.6079489541554616e-05, 2.1843015412002563e-07],
        [-4.6079489541554616e-05, -0.002493082311911296, -2.9282300800998932e-05],
        [2.1843015412002563e-07, -2.9282300800998932e-05, -0.00055845495018597],
    ],
    "stiffness": 0.027240331757972542,
    "limit": 0.0225878598703668,
}


def text(system, dof, low, high, more=""):
    names = [f"x{k}" for k in range(len(system["M"]))]
    return f"""
[model]
dofs = {json.dumps(names)}
M = {system["M"]}
K = {system["K"]}
C = {system["C"]}

[[contact]]
name = "slider"
law = "jenkins"
pairs = ["x0"]
tangential_stiffness = {system["stiffness"]!r}
friction_limit = {system["limit"]!r}

[[analysis]]
name = "mode"
type = "mode"
harmonics = 15
samples = 512
normalise = "x{dof}"
linear_mode = 1
amplitude = [{low!r}, {high!r}]
{more}"""


@pytest.fixture
def cycles(tmp_path, comm):
    """Run a case, the limit cycles of its mode, and the log."""

    def run(case):
        path = tmp_path / "case.toml"
        path.write_text(case, encoding="utf-8")
        assert run_case(path, RunOptions(out=tmp_path / "run", plots=False), comm) == 0
        with h5py.File(tmp_path / "run/results.h5") as file:
            found = json.loads(file["mode"].attrs["events"])
            kept = {key: file["mode"][key][()] for key in ("harmonic", "coefficients")}
        return found, (tmp_path / "run/run.log").read_text(encoding="utf-8"), kept

    return run


def test_nothing_is_known_of_a_cycle_where_the_branch_runs_back(cycles, tmp_path):
    """Damping falls with amplitude there, and motions in time settle on the cycle from both sides all the same."""
    (first, second), log, kept = cycles(text(BACK, 1, 0.0016, 0.043))
    assert first["runs_back"] and first["stable"] is None
    assert "Hz: stability unknown (the branch runs back there)" in log and "m, 0.43045 +- " in log
    assert second["stable"] is False and "unstable (damping falls)" in log
    assert "stability unknown (the branch runs back there)" in "".join(overviews(tmp_path / "run")[1][0].lines())
    orders = np.array([int(label[:-1]) for label in kept["harmonic"]])
    cosine = np.array([label.endswith(b"c") for label in kept["harmonic"]])
    shape, omega = kept["coefficients"][first["point"]], 2 * np.pi * first["frequency_hz"]
    for factor in (0.97, 1.03):
        x, v = shape[:, cosine].sum(axis=1), omega * (shape * orders)[:, ~cosine].sum(axis=1)
        swings = JenkinsMotion(**BACK).amplitudes(factor * x, factor * v, omega, 100, 1)
        assert np.ptp(swings[-20:]) < 1e-3 * swings[-1]  # settled; periods are not quite its own
        assert swings[-1] == pytest.approx(first["amplitude"], rel=1e-2)


def test_other_modes_that_gain_energy_are_named(cycles):
    """Those of both linear states of the contact, as the eigenvalues of the whole equations have them."""
    (first, second), log, _ = cycles(text(FED, 0, 0.48, 60.0))
    assert (first["stable"], second["stable"]) == (True, False) and "fed" not in second
    expected = []
    for contact, stiffness in (("stuck", FED["stiffness"]), ("contact free", 0.0)):
        values = eigenvalues(FED, stiffness)
        expected += [(k + 1, contact, value) for k, value in enumerate(values) if k]
    assert [(mode["mode"], mode["contact"]) for mode in first["fed"]] == [given[:2] for given in expected]
    for mode, (_, _, value) in zip(first["fed"], expected):
        assert mode["zeta"] == pytest.approx(-value.real / abs(value), rel=REPEATED) and mode["zeta"] < 0
        assert mode["frequency_hz"] == pytest.approx(value.imag / (2 * np.pi), rel=SOLVED)
    said = "Hz: stable in its own amplitude (damping rises), but linear mode 2, 0.2136 Hz, gains energy by itself"
    assert f"{said}: zeta -0.29 % (stuck, as does 1 other)" in log and "m, 0.19775 +- " in log


def test_amplitudes_of_cycles_are_as_wrong_as_is_said(cycles):
    """Of one and five harmonics, against 61 of them: within a factor of 4 of the error itself."""
    given = text(FED, 0, 0.48, 60.0)

    def told(name, highest):
        return np.array([cycle[name] for cycle in cycles(given.replace("= 15", f"= {highest}"))[0]])

    exact = told("amplitude", 61)
    for highest in (1, 5):
        true, said = np.abs(told("amplitude", highest) - exact), told("amplitude_error", highest)
        assert np.all((said < 4 * true) & (true < 4 * said))


def test_a_cycle_beside_damped_modes_is_stable_in_its_own_amplitude_and_nothing_else_is_said(cycles):
    damped = {**FED, "C": np.diag([-0.0014, 0.002, 0.001]).tolist()}
    (first, _), log, _ = cycles(text(damped, 0, 0.48, 60.0))
    assert first["stable"] is True and first["fed"] == []
    assert "stable in its own amplitude (damping rises)\n" in log


def eigenvalues(system, stiffness):
    """lambda of a linear state of the contact, of positive imaginary part, in ascending order."""
    M, C, K = (np.array(system[letter]) for letter in "MCK")
    K[0, 0] += stiffness
    zero, one = np.zeros_like(M), np.eye(len(M))
    values = np.linalg.eigvals(np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
    return sorted(values[values.imag > 0], key=lambda value: value.imag)


def test_a_cycle_exactly_at_an_end_of_the_range_is_named(cycles):
    """The last damping ratio is rounding there; the other end has none."""
    (first, _), _, _ = cycles(text(FED, 0, 0.48, 60.0))
    (last,), log, _ = cycles(text(FED, 0, 0.48, first["amplitude"]))
    assert last["amplitude"] == pytest.approx(first["amplitude"], rel=SOLVED) and last["stable"] is None
    assert "stability unknown (branch end)" in log


@pytest.mark.parametrize("g, fed", [(0.1, []), (-0.1, [0])])
def test_what_grows_in_the_opposite_wave_is_not_of_this_one(monkeypatch, g, fed):
    """x'' + (1 + i g) x = 0 of a wave: for g > 0 the forward motion is damped and the backward one fed."""
    monkeypatch.setattr(fed_modes, "_companion", lambda context, modes: np.array([[0.0, 1.0], [-(1 + 1j * g), 0.0]]))
    found = fed_modes._growing(None, [None])
    assert list(found) == fed and all(value.imag > 0 for value in found.values())


@pytest.mark.ranks(1)
@pytest.mark.parametrize("zeta, told", [(-3e-17, "zeta 0 %"), (1.2e-16, "zeta 0 %"), (2e-6, "zeta 0.0002 %")])
@pytest.mark.parametrize("more", [{}, {"cycles": 10.0, "worn": 0.5, "worn_unit": "mm^3"}], ids=["mode", "wear"])
def test_damping_that_rounding_leaves_is_none(zeta, told, more):
    """A peak of an undamped branch was shown as 1.2e-14 %."""
    peak = {"point": 0, "zeta": zeta, "amplitude": 1.0, **more}
    row = Overview("m", "mode", "CNM", "done", "", 2, "m", {}, peak, None, {}, None).cells()
    assert f"{told}," in row[5]
