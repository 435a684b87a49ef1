"""Contact that sticks leaves nothing to move: a wheel, flutter and wear begin without it, as one sector does."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from command_line import call
from models.solved_case import tables_of
from mpi4py import MPI
from tolerances import SOLVED, TIGHT

import fretwave.model.modes
from fretwave.errors import InputError

N = 6
DEVIATIONS = np.array([0.02, -0.01, 0.03, 0.0, -0.02, 0.01])
#: A ring of masses on ground springs, each under a rubbing pair that holds it where it does not slide.
RING = f"""
[model]
dofs = ["mass", "next"]
M = [[1.0, 0.0], [0.0, 0.0]]
K = [[2.0, -1.0], [-1.0, 1.0]]
sectors = {N}
low = ["mass"]
high = ["next"]
"""
RUB = """
[[contact]]
name = "rub"
law = "regularised_coulomb"
pairs = ["mass"]
friction_limit = 0.05
regularisation_velocity = 0.5
"""
MISTUNED = f"wheel = true\nmistuning = {{ deviations = {DEVIATIONS.tolist()} }}\n"


def mode(name: str, keys: str) -> str:
    return f"""
[[analysis]]
name = "{name}"
type = "mode"
method = "EPMC"
harmonics = 3
normalise = "mass"
amplitude = [0.5, 1.0]
{keys}"""


def wheel() -> np.ndarray:
    """Stiffness of the ring, each sector's own by its deviation larger."""
    K = np.zeros((N, N))
    for j, own in enumerate(1 + DEVIATIONS):
        k = (j + 1) % N
        K[j, j] += own
        K[np.ix_([j, k], [j, k])] += own * np.array([[1, -1], [-1, 1]])
    return K


def told(folder: Path, name: str) -> float:
    """Frequency that a wheel's branch begins from."""
    entries = json.loads((folder / "run" / "run.json").read_text(encoding="utf-8"))["analyses"]
    return entries[name]["wheel"]["start_frequency_hz"]


def test_a_wave_on_the_wheel_is_that_on_one_sector(shared_tmp, comm):
    waves = mode("sector", "nodal_diameter = 1\n") + mode("wheel", "wheel = true\nnodal_diameter = 1\n")
    sector, whole = tables_of(RING + RUB + waves, shared_tmp, comm, "sector", "wheel")
    for column in ("amplitude", "omega", "zeta"):
        assert whole[column][[0, -1]] == pytest.approx(sector[column][[0, -1]], rel=SOLVED)


def test_a_mistuned_wheel_begins_at_its_own_frequencies(shared_tmp, comm):
    """By number, and as a mode of the scattered pair of a wave, the lower where both have equal shares in it."""
    modes = mode("numbered", MISTUNED + "linear_mode = 2\n") + mode("wave", MISTUNED + "nodal_diameter = 1\n")
    tables_of(RING + RUB + modes, shared_tmp, comm, "numbered", "wave")
    squares, shapes = scipy.linalg.eigh(wheel())
    hertz = np.sqrt(squares) / (2 * np.pi)
    share = np.abs(np.exp(2j * np.pi * np.arange(N) / N) @ shapes) ** 2
    assert told(shared_tmp, "numbered") == pytest.approx(hertz[1], rel=TIGHT)
    assert told(shared_tmp, "wave") == pytest.approx(hertz[(share > 0.999 * share.max()).argmax()], rel=TIGHT)


FLOW = """
[aerodynamics]
frequency = 0.3
damping = { 0 = -0.01, 1 = -0.02, -1 = -0.02, 2 = 0.01, -2 = 0.01 }
[[analysis]]
name = "flutter"
type = "flutter"
method = "EPMC"
harmonics = 3
normalise = "mass"
amplitude = [1e-4, 1e-3]
nodal_diameters = [0, 1, -2]
"""


def test_flutter_begins_there_too(shared_tmp, comm):
    """It was refused, with a key that it has not. Where v << eps, tanh friction is the damper 0.05 / 0.5: with the
    flow's 2 zeta omega_f on it, each wave has (0.1 + 2 zeta omega_f) / (2 omega0), omega0^2 = 1 + 4 sin^2(pi ND / N).
    """
    (table,) = tables_of(RING + RUB + FLOW, shared_tmp, comm, "flutter")
    for diameters, ratio in ((0, -0.01), (1, -0.02), (-2, 0.01)):
        row = int(np.flatnonzero(table["nodal_diameter"] == diameters)[0])
        omega0 = np.sqrt(1 + 4 * np.sin(np.pi * diameters / N) ** 2)
        assert table["omega0"][row] == pytest.approx(omega0, rel=1e-6)
        assert table["zeta"][row] == pytest.approx((0.1 + 2 * ratio * 2 * np.pi * 0.3) / (2 * omega0), rel=1e-6)


PLATE = """
import numpy as np
from fretwave import Pairs, Structure

def build():
    dofs, pairs = {"normal": 0, "mass": 1}, {"flank": Pairs(np.eye(2), 2, areas=np.ones(1))}
    return Structure(np.eye(2), np.array([[2.0, -0.5], [-0.5, 1.0]]), dofs=dofs, pairs=pairs)
"""
WORN = """
[model]
builder = "model.py"
[[contact]]
name = "flank"
law = "coulomb_2d"
normal_stiffness = 1.0
tangential_stiffness = 0.5
friction_coefficient = 0.5
normal_load = 0.4
[[contact]]
name = "held"
law = "regularised_coulomb"
pairs = ["normal"]
friction_limit = 1e-3
regularisation_velocity = 1.0
[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [1.0]
cycles = 2.0
coefficient = 1e-3
"""


@pytest.mark.ranks(1)
def test_wear_begins_there_too(tmp_path):
    """At its first row it is the mode, which begins there."""
    (tmp_path / "model.py").write_text(PLATE)
    text = WORN + RUB.replace("0.05", "1e-3") + mode("mode", "report_at = [1.0]\n")
    wear, own = tables_of(text, tmp_path, MPI.COMM_SELF, "wear", "mode")
    assert wear["zeta"][0] == pytest.approx(own["zeta"][-1], rel=SOLVED) and wear["worn_1"][-1] > 0


PRELOAD = "[preload]\n"
ONE = '[model]\ndofs = ["mass"]\nM = [[1.0]]\nK = [[2.0]]\n'
CHECKED = {
    "one mass": ONE + RUB + mode("mode", ""),
    "one mass at rest": ONE + PRELOAD + RUB + mode("mode", ""),
    "wheel": RING + RUB + mode("mode", "wheel = true\nnodal_diameter = 1\n"),
    "mistuned wheel": RING + RUB + mode("mode", MISTUNED + "nodal_diameter = 1\n"),
    "mistuned wheel at rest": RING + PRELOAD + RUB + mode("mode", MISTUNED + "linear_mode = 2\n"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", CHECKED)
def test_check_takes_what_a_run_solves(name, tmp_path, capfd):
    path = tmp_path / "case.toml"
    path.write_text(CHECKED[name], encoding="utf-8")
    assert call("check", path) == 0
    said = capfd.readouterr().out
    squares = scipy.linalg.eigvalsh(wheel())
    expected = np.sqrt(squares[1] if "mistuned" in name else 2.0) / (2 * np.pi)
    assert f"with contact as at rest: {expected:.6g} Hz" in said
    assert call("run", path, "--no-plots", "-q", "--out", tmp_path / "run") == 0


FORCED = """
[[analysis]]
name = "forced"
type = "forced"
force = { mass = 1.0 }
observe = "mass"
levels = [0.1]
harmonics = 1
frequency = [0.1, 0.5]
"""
OTHER_TROUBLE = {
    "mode": ONE + RUB + mode("mode", ""),
    "mode at rest": ONE + PRELOAD + RUB + mode("mode", ""),
    "forced": ONE + RUB + FORCED,
    "linear": ONE + RUB + '[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = 1\n',
    "wheel": RING + RUB + mode("mode", "wheel = true\nnodal_diameter = 1\n"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", OTHER_TROUBLE)
def test_other_trouble_with_stuck_modes_is_told(name, tmp_path, capfd, monkeypatch):
    """It was taken for "nothing to move", and the run went on from the modes without contact, exit 0."""
    own = fretwave.model.modes.linear_modes

    def troubled(model, count=6, contact="stuck", near=None, stable=False):
        if contact == "stuck" and model.contacts:
            raise InputError("the factor is too large")
        return own(model, count, contact, near, stable)

    monkeypatch.setattr(fretwave.model.modes, "linear_modes", troubled)
    path = tmp_path / "case.toml"
    path.write_text(OTHER_TROUBLE[name], encoding="utf-8")
    assert call("run", path, "--no-plots", "-q", "--out", tmp_path / "run") == 2
    assert "the factor is too large" in capfd.readouterr().err
