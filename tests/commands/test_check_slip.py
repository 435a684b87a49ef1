"""``fretwave check`` expects the first slip of forced responses, waves that may flutter and whole wheels."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import call
from models.pad_beside_ground import KN, KT, MODEL, MU, N0, PAD, K

from fretwave.analyses.parts import at_rest

pytestmark = pytest.mark.ranks(1, 2)
CASES = Path(__file__).parents[2] / "cases"
LUMPED = CASES / "blisk_lumped" / "case.toml"
NUMBER = r"([-+.e0-9]+)"
PRINTED = 5e-3  #: three digits

FORCED = f"""{MODEL}C = [[0.05, 0.0], [0.0, 0.08]]
{PAD}
[[analysis]]
name = "forced"
type = "forced"
harmonics = 5
force = {{ x = 2.0 }}
levels = [0.01, 3.0]
frequency = [0.2, 0.6]
observe = "x"
"""


def response(omega: float) -> np.ndarray:
    """To a force of 2 N at x, the pad stuck."""
    Z = K + np.diag([KT, KN]) + 1j * omega * np.diag([0.05, 0.08]) - omega**2 * np.eye(2)
    return np.linalg.solve(Z, [2.0, 0.0])


def expected() -> tuple[float, float, float]:
    """Level and amplitude of first slip, level of slip in every period: brute force over frequency and time.

    Slips where |kt x| = mu (N0 + kn y) (first), and where the span of kt x -+ mu kn y is 2 mu N0 (shakedown).
    """
    turn = np.exp(2j * np.pi * np.arange(4096) / 4096)
    best = []
    for omega in 2 * np.pi * np.linspace(0.2, 0.6, 4001):
        x, y = (np.real(part * turn) for part in response(omega))
        tangent, normal = KT * x, MU * KN * y
        span = np.max(tangent - normal) + np.max(-tangent - normal)
        best.append((MU * N0 / np.max(np.abs(tangent) - normal), 2 * MU * N0 / span, abs(response(omega)[0])))
    level, _, seen = min(best)
    return level, level * seen, min(item[1] for item in best)


def forced_case(folder: Path, old: str = "", new: str = "") -> Path:
    path = folder / "case.toml"
    path.write_text(FORCED.replace(old, new) if old else FORCED)
    return path


@pytest.mark.ranks(1)
def test_level_of_first_slip_of_a_forced_response(tmp_path: Path, capfd) -> None:
    assert call("check", forced_case(tmp_path)) == 0
    said = capfd.readouterr().out
    found = re.search(rf"expected at level {NUMBER} \({NUMBER} Hz, {NUMBER} m of x, pair 0 of 'pad'\), in every", said)
    assert found, said
    level, amplitude, lasting = expected()
    assert [float(found[1]), float(found[3])] == pytest.approx([level, amplitude], rel=PRINTED)
    assert float(found[2]) == pytest.approx(np.sqrt(np.linalg.eigvalsh(K + np.diag([KT, KN]))[0]) / 2 / np.pi, rel=1e-5)
    every = re.search(rf"in every period from about level {NUMBER}: within the levels asked for", said)
    assert every and float(every[1]) == pytest.approx(lasting, rel=PRINTED)
    assert "warning" not in said


@pytest.mark.ranks(1)
def test_a_response_without_friction_is_that_which_slides(tmp_path: Path, capfd) -> None:
    assert call("check", forced_case(tmp_path, f"friction_coefficient = {MU}", "friction_coefficient = 0.0")) == 0
    hertz = np.sqrt(np.linalg.eigvalsh(K + np.diag([0.0, KN]))[0]) / 2 / np.pi
    assert f"linear mode 1 with contact as at rest: {hertz:.6g} Hz" in capfd.readouterr().out


@pytest.mark.ranks(1)
def test_levels_that_never_slip_and_a_resonance_that_nothing_damps(tmp_path: Path, capfd) -> None:
    assert call("check", forced_case(tmp_path, "levels = [0.01, 3.0]", "levels = [0.01]")) == 0
    said = capfd.readouterr().out
    assert "warning: no level of 'forced' is expected to make a pair slip in every period" in said
    assert "forced.levels" in said and "at most 0.01" in said and "  fix: " in said
    assert call("check", forced_case(tmp_path, "C = [[0.05, 0.0], [0.0, 0.08]]", "")) == 0
    said = capfd.readouterr().out
    values, shapes = np.linalg.eigh(K + np.diag([KT, KN]))
    y = abs(shapes[1, 0] / shapes[0, 0])
    found = re.search(f"at any level: nothing damps .* at {NUMBER} Hz, where pairs slip from a = {NUMBER} m of x", said)
    assert found, said
    wanted = [np.sqrt(values[0]) / 2 / np.pi, MU * N0 / (KT + MU * KN * y)]
    assert [float(text) for text in found.groups()] == pytest.approx(wanted, rel=PRINTED)


def slip(said: str, dof: str) -> list[float]:
    found = re.findall(
        f"first slip expected at a = {NUMBER} m of {dof} .*, in every period from about {NUMBER} m", said
    )
    assert found, said
    return [float(text) for pair in found for text in pair]


def test_a_tuned_wheel_slips_where_its_sector_does(capfd) -> None:
    """And so does its wave in a flutter analysis, whichever way it runs. The ring's pair slips at |x| = limit / kt."""
    from mpi4py import MPI

    assert call("check", LUMPED, "--only", "mode,mode_wheel,flutter") == 0
    said = MPI.COMM_WORLD.bcast(capfd.readouterr().out)
    sector, rest = said.split("  mode_wheel:")
    wheel, waves = rest.split("  flutter:")
    assert slip(wheel, "disk@0") == slip(sector, "disk")
    assert "at rest: 1 stick, 0 slip, 0 open" in sector and "at rest: 24 stick, 0 slip, 0 open" in wheel
    found = dict(re.findall(r"nodal diameter (-?\d+): (.*)", waves))
    assert set(found) == {"-4", "2", "3", "4", "5", "6", "8"} and waves.count("at rest:") == 1
    assert slip(found["4"], "disk") == slip(found["-4"], "disk") == slip(sector, "disk")
    assert "the flow's" not in found["4"], "1031.64 Hz beside 1031.6"
    x = (
        1760.29 / 1031.6
    )  # of the ratios the mean part falls with 1 / x, the odd one, 2 * 2.5e5 sin 120 deg, with its square
    times = (-1.68e5 * x + 5e5 * np.sin(2 * np.pi * 8 / 24)) / x**2 / (-1.68e5 + 5e5 * np.sin(2 * np.pi * 8 / 24))
    assert f"hold at 1031.6 Hz: {times:.3g} times their damping" in found["8"]


@pytest.mark.ranks(1)
def test_a_mistuned_wheel_slips_in_the_sector_that_moves_most(capfd) -> None:
    assert call("check", LUMPED, "--only", "mode_mistuned,forced_mistuned", "--set", "damping.zeta=0.001") == 0
    said = capfd.readouterr().out
    first, lasting = slip(said, "tip@0")
    assert first == lasting and re.search(r"pair 0 of 'groove' in sector \d+\)", said)
    assert re.search(rf"first slip expected at level {NUMBER} \({NUMBER} Hz, {NUMBER} m of disk@0, pair 0 of", said)


@pytest.mark.ranks(1)
def test_pairs_that_slip_together_but_for_rounding_are_named_by_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wheel's sectors all slip at once; the one named was another on four ranks."""
    factors = {"ring": [3.0, 2.0, 2.0 * (1 - 1e-15)], "pads": [2.0 * (1 - 2e-15), 5.0]}
    monkeypatch.setattr(at_rest, "pair_factors", lambda _, contact, *__: np.tile(factors[contact.name], (2, 1)))
    contacts = [SimpleNamespace(name=name) for name in factors]
    states = [{"status": np.full(len(found), at_rest.STICK)} for found in factors.values()]
    found = at_rest.first_slip(SimpleNamespace(case=SimpleNamespace(contacts=contacts)), states, None, 1.0)
    assert (found.contact, found.pair, found.amplitude) == ("ring", 1, 2.0)
