"""Excitation by engine orders: the wave it drives, one sector against all, mistuned wheels against a direct solve."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from tolerances import REPEATED, ROUNDING, SOLVED

from fretwave.case.load import load_case
from fretwave.cyclic.engine_order import folded, speed_rpm
from fretwave.errors import CaseErrors
from fretwave.post.blade_peaks import beyond, blade_tables, whitehead
from fretwave.results.sweep_summary import _forced_words
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

SECTORS = 6
#: Disk and blade of a sector: the disk rubs on ground and is tied to the next one's; a flow that damps.
M, OWN = np.diag([2.0, 0.5, 0.0]), np.array([[9.0, -4.0, 0.0], [-4.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
K = OWN + 3.0 * np.array([[1.0, 0.0, -1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 1.0]])
DEVIATIONS = [0.05, -0.03, 0.01, -0.06, 0.02, 0.04]
INFLUENCE = {0: -0.01 - 0.12j, 1: 0.02 + 0.01j, -1: -0.01 + 0.03j}
OMEGA = 2.5
TEXT = f"""
[model]
dofs = ["disk", "blade", "next"]
M = {M.tolist()}
K = {K.tolist()}
sectors = {SECTORS}
low = ["disk"]
high = ["next"]
mass_damping = 0.02

[[contact]]
name = "rub"
law = "jenkins"
pairs = ["disk"]
tangential_stiffness = 5.0
friction_limit = 0.5

[aerodynamics]
frequency = {OMEGA / (2 * np.pi)!r}
dof = "blade"
influence = {{ {", ".join(f"{k} = [{L.real}, {L.imag}]" for k, L in INFLUENCE.items())} }}

[[analysis]]
name = "forced"
type = "forced"
engine_order = 8
aerodynamics = true
harmonics = 3
samples = 480
force = {{ blade = 1.0 }}
levels = [0.3]
frequency = [0.32, 0.46]
report_at = [0.345, 0.36, 0.39]
observe = "blade"
"""


@pytest.fixture
def run(shared_tmp, comm):
    """The case with replacements, run; its folder."""

    def start(name: str, *changes: tuple[str, str]) -> Path:
        text = TEXT
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = shared_tmp / f"{name}.toml"
        if comm.rank == 0:
            path.write_text(text, encoding="utf-8")
        comm.barrier()
        assert run_case(path, RunOptions(out=shared_tmp / name, plots=False), comm) == 0
        return shared_tmp / name

    return start


def reported(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, fundamentals (points, n_dof) and the share of slip at the points that are reported."""
    with h5py.File(folder / "results.h5") as file:
        group = file["forced"]
        points = np.flatnonzero(group["points/event"][()] == b"report")
        labels = [text.decode() for text in group["harmonic"][()]]
        Q = group["coefficients"][()][points]
        q = Q[:, :, labels.index("1c")] - 1j * Q[:, :, labels.index("1s")]
        return group["points/omega"][()][points], q, group["points/slip"][()][points]


def table(path: Path) -> list[dict[str, float]]:
    with open(path, newline="") as file:
        return [{key: float(value) for key, value in row.items() if key != "event"} for row in csv.DictReader(file)]


@pytest.mark.ranks(1)
def test_engine_orders_fold_into_forward_and_backward_waves():
    orders = [1, 2, 3, 4, 5, 6, 7, 8, 10, -1, -2, -3, -4]
    assert [folded(order, 6) for order in orders] == [1, 2, 3, -2, -1, 0, 1, 2, -2, -1, -2, 3, 2]
    assert [folded(order, 5) for order in (2, 3, 5, 8)] == [2, -2, 0, -2]
    assert speed_rpm(2 * np.pi * 100, -4) == pytest.approx(1500)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("order", [1, 4, 8, -2])
def test_force_on_a_sector_is_what_it_meets_in_the_flow(order, comm, tmp_path):
    """cos(r phi) at phi = j alpha - Omega t, or + Omega t where the rotor turns with the sectors' numbers."""
    from fretwave.analyses.parts.context import AnalysisContext
    from fretwave.analyses.parts.excitation import wave_of_forces
    from fretwave.case.wheel import on_wheel

    path = tmp_path / "case.toml"
    path.write_text(TEXT.replace("engine_order = 8", f"engine_order = {order}\nwheel = true"))
    case = load_case(path)
    analysis = case.analyses["forced"]
    context = AnalysisContext(None, on_wheel(case, analysis), analysis, comm, tmp_path, None)
    force = wave_of_forces(context).reshape(SECTORS, 2)
    assert not force[:, 0].any()
    t, speed = np.linspace(0, 1, 17)[:, None], 2.3
    place = 2 * np.pi * np.arange(SECTORS) / SECTORS - np.sign(order) * speed * t
    expected = np.cos(abs(order) * place)
    assert np.allclose((force[:, 1] * np.exp(1j * abs(order) * speed * t)).real, expected, atol=ROUNDING)


def test_tuned_wheel_answers_like_its_sector(run):
    """In slip, with three harmonics; each sector with the wave's delay."""
    mode = '[[analysis]]\nname = "mode"\ntype = "mode"\nnodal_diameter = 2\naerodynamics = true\nnormalise = "blade"\n'
    keys = "harmonics = 3\nsamples = 480\namplitude = [0.2, 2.0]\n\n[[analysis]]"
    named = ("samples = 480\nforce", 'backbone = "mode"\nsamples = 480\nforce')
    beside = [("[[analysis]]", mode + keys), named]
    alone = run("sector", *beside)
    whole = run("tuned", *beside, ("engine_order = 8", "engine_order = 8\nwheel = true"))
    omega, q, slip = reported(alone)
    omega_whole, q_whole, slip_whole = reported(whole)
    assert len(omega) == 3 and slip.min() > 0.05 and np.allclose(slip, slip_whole, atol=ROUNDING)
    assert np.allclose(omega, omega_whole, rtol=ROUNDING)
    wave = np.exp(-2j * np.pi * 2 * np.arange(SECTORS) / SECTORS)
    expected = wave[None, :, None] * q[:, None, :]
    assert np.abs(q_whole.reshape(3, SECTORS, 2) - expected).max() < REPEATED * np.abs(expected).max()
    peaks = table(whole / "forced_peaks.csv")[0]
    assert peaks["amplification"] == pytest.approx(1, abs=1e-6)
    assert abs(peaks["distance_mode"]) < 0.01  # friction and flow dampen by a few percent
    assert peaks["distance_mode"] == pytest.approx(table(alone / "forced_peaks.csv")[0]["distance_mode"], abs=1e-6)
    assert peaks["tuned_amplitude"] == pytest.approx(table(alone / "forced_peaks.csv")[0]["amplitude"], rel=SOLVED)
    rows = table(whole / "forced.csv")
    assert {row["largest_sector"] for row in rows} == {peaks["sector"]} == {0}  # all are alike to rounding
    row = rows[-1]
    assert row["largest_amplitude"] == pytest.approx(row["amplitude"], rel=1e-7)
    assert row["speed_rpm"] == pytest.approx(row["frequency_hz"] * 60 / 8)


def test_linear_mistuned_wheel_against_a_direct_solve(run):
    """Stuck, with the flow between the blades: peaks, and the motion of every blade at given frequencies."""
    mistuned = f"engine_order = 8\nwheel = true\nmistuning = {{ deviations = {DEVIATIONS} }}"
    folder = run("mistuned", ("engine_order = 8", mistuned), ("friction_limit = 0.5", "friction_limit = 1e6"))
    omega, q, slip = reported(folder)
    assert not slip.any()
    expected = np.array([direct(w) for w in omega])
    assert np.abs(q - expected).max() < REPEATED * np.abs(expected).max()
    rows, peaks = table(folder / "forced_blades.csv"), table(folder / "forced_peaks.csv")[0]
    fine = 2 * np.pi * np.linspace(0.32, 0.46, 4001)
    blades = 0.3 * np.abs(np.array([direct(w, 1.0) for w in fine]))[:, 1::2]
    assert [row["amplitude"] for row in rows] == pytest.approx(blades.max(axis=0), rel=2e-3)  # parabola through points
    assert peaks["amplitude"] == max(row["amplitude"] for row in rows)
    assert peaks["sector"] == np.argmax(blades.max(axis=0))
    tuned = max(abs(tuned_blade(w)) for w in fine)
    assert peaks["amplification"] == pytest.approx(blades.max() / tuned, rel=4e-3)
    entry = json.loads((folder / "run.json").read_text())["analyses"]["forced"]
    assert entry["peaks"][0]["amplification"] == peaks["amplification"]


def direct(omega: float, level: float = 0.3) -> np.ndarray:
    """Fundamentals (2 N,) of the stuck mistuned wheel, all of K varied, written out sector by sector."""
    n, Z = SECTORS, np.zeros((2 * SECTORS, 2 * SECTORS), dtype=complex)
    for j in range(n):
        places = [2 * j, 2 * j + 1, 2 * ((j + 1) % n)]
        Z[np.ix_(places, places)] += (1 + DEVIATIONS[j]) * K + (1j * omega * 0.02 - omega**2) * M
        Z[2 * j, 2 * j] += 5.0
        for k, L in INFLUENCE.items():
            Z[2 * j + 1, 2 * ((j + k) % n) + 1] -= L.real + 1j * omega / OMEGA * L.imag
    force = np.zeros(2 * n, dtype=complex)
    force[1::2] = level * np.exp(-2j * np.pi * 8 * np.arange(n) / n)
    return np.linalg.solve(Z, force)


def tuned_blade(omega: float) -> complex:
    """Blade of the tuned stuck wheel in the wave of 2 nodal diameters, level 0.3."""
    theta = 2 * np.pi * 2 / SECTORS
    Z = (OWN + (1j * omega * 0.02 - omega**2) * M)[:2, :2].astype(complex)
    Z[0, 0] += 5.0 + 3.0 * (2 - 2 * np.cos(theta))
    Z[1, 1] -= sum((L.real + 1j * omega / OMEGA * L.imag) * np.exp(-1j * k * theta) for k, L in INFLUENCE.items())
    return np.linalg.solve(Z, [0, 0.3])[1]


@pytest.mark.ranks(1)
def test_peaks_of_blades_take_each_at_its_own_frequency():
    """Two blades with peaks at 2 and 3, three times and once the tuned one; one without a peak in the range."""
    omega = np.linspace(1, 4, 301)
    shape = lambda at, height: height / np.sqrt(1 + 400 * (omega - at) ** 2)  # noqa: E731
    blades = np.column_stack([shape(3.0, 1.0), shape(2.0, 3.0), 0.01 * omega])
    tuned = {"level": np.ones(301), "frequency_hz": omega / (2 * np.pi), "amplitude": shape(2.5, 1.0)}
    peaks, each = blade_tables({"level": np.ones(301), "omega": omega}, blades, tuned)
    assert peaks["sector"].tolist() == [1] and peaks["amplification"] == pytest.approx([3.0])
    assert each["amplification"][:2] == pytest.approx([1.0, 3.0]) and np.isnan(each["amplitude"][2])
    assert each["frequency_hz"][:2] == pytest.approx(np.array([3.0, 2.0]) / (2 * np.pi))
    assert whitehead(36) == 3.5
    assert beyond({"level": np.ones(301)}, blades, each) == {}, "0.04 at the end, less than the peaks"


@pytest.mark.ranks(1)
def test_a_blade_does_not_take_the_peak_of_the_one_that_is_observed():
    """Its largest point is where the observed blade's peak was located, its own peak 0.004 further on."""
    omega = np.array([1.9, 1.95, 2.0, 2.03, 2.1])
    shape = lambda at: 1 / np.sqrt(1 + 400 * (omega - at) ** 2)  # noqa: E731
    event = np.array(["", "", "peak", "", ""])
    table = {"level": np.ones(5), "omega": omega, "amplitude": shape(2.0), "event": event}
    table["amplitude_error"] = 0.01 * shape(2.0)
    tuned = {"level": np.ones(5), "frequency_hz": omega / (2 * np.pi), "amplitude": shape(2.0), "event": event}
    blades = np.column_stack([shape(2.0), 0.5 * shape(2.0), shape(2.004)])
    peaks, each = blade_tables(table, blades, tuned)
    assert each["amplitude"].tolist() == [1.0, 0.5, pytest.approx(1.0, rel=SOLVED)]
    assert 2 * np.pi * each["frequency_hz"] == pytest.approx(np.array([2.0, 2.0, 2.004]), rel=SOLVED)
    assert each["amplitude_error"] == pytest.approx(0.01 * each["amplitude"], rel=SOLVED), "1/a^2 is a parabola"


@pytest.mark.ranks(1)
def test_a_blade_that_moves_more_where_the_range_ends_is_told():
    """Of level 1 a blade rises to 5 at the end, beside a peak of 3; of level 2 no blade has a peak."""
    omega = np.linspace(1, 4, 301)
    peak = 3.0 / np.sqrt(1 + 400 * (omega - 2.0) ** 2)
    blades = np.vstack([np.column_stack([peak, 1.25 * omega]), np.column_stack([omega, 2.0 * omega])])
    table = {"level": np.repeat([1.0, 2.0], 301), "omega": np.tile(omega, 2)}
    tuned = {"level": table["level"], "frequency_hz": table["omega"], "amplitude": np.tile(peak, 2)}
    peaks, each = blade_tables(table, blades, tuned)
    assert peaks["sector"].tolist() == [0, -1] and np.isnan(peaks["amplitude"][1])
    assert beyond(table, blades, each) == {1.0: (1, pytest.approx(5.0)), 2.0: (1, pytest.approx(8.0))}
    none = dict(largest_blade_amplitude=np.nan, largest_blade_frequency_hz=np.nan, largest_blade=-1.0)
    row = {"largest_amplitude": 4.0, "frequency_of_largest_amplitude": 0.5, "unit": "m", **none}
    assert _forced_words(row) == "largest 4 m at 0.5 Hz", "no sector and no nan"


#: (text in the case, its replacement, what is said)
WRONG = {
    "steady": ("engine_order = 8", "engine_order = 0", "is steady"),
    "contradiction": ("engine_order = 8", "engine_order = 8\nnodal_diameter = 3", "2, which engine order 8 drives"),
    "neither": ("engine_order = 8\n", "", "says no nodal diameter"),
    "mistuned": ("engine_order = 8\n", f"wheel = true\nmistuning = {{ deviations = {DEVIATIONS} }}\n", "is missing"),
    "no flow": (TEXT[TEXT.index("[aero") : TEXT.index("[[analysis]]")], "", "needs forces of the flow"),
    "no sectors": (f'sectors = {SECTORS}\nlow = ["disk"]\nhigh = ["next"]\n', "", "is of no sector of a wheel"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_an_excitation_is_said(tmp_path, change):
    old, new, message = change
    assert old in TEXT
    (tmp_path / "case.toml").write_text(TEXT.replace(old, new, 1))
    with pytest.raises(CaseErrors, match=message) as caught:
        load_case(tmp_path / "case.toml")
    assert str(caught.value).count("fix:") == 1 or "no sector" in message  # whose faces are wrong then, too


def beside_mode(diameters: int, order: int, flow: bool, amplitude: float = 2.0) -> str:
    """A response whose peaks are compared with a mode of a wave."""
    mode = f'[[analysis]]\nname = "mode"\ntype = "mode"\nnormalise = "blade"\nnodal_diameter = {diameters}\n'
    mode += f"harmonics = 3\nsamples = 480\namplitude = [0.2, {amplitude}]\n\n[[analysis]]"
    text = TEXT.replace("[[analysis]]", mode, 1).replace(
        "engine_order = 8", f'engine_order = {order}\nbackbone = "mode"'
    )
    return text if flow else text.replace("aerodynamics = true\n", "")


#: Order, nodal diameters of the mode and those of the order's wave on six sectors; with forces of the flow or without.
ANOTHER = [(8, 1, 2, False), (3, 1, 3, False), (6, 1, 0, False), (4, -1, -2, False), (8, -2, 2, True)]
SAME = [(8, 2, True), (8, 2, False), (4, 2, False), (8, -2, False), (3, -3, True), (-2, -2, True)]


@pytest.mark.ranks(1)
@pytest.mark.parametrize(("order", "diameters", "wave", "flow"), ANOTHER)
def test_peaks_against_a_backbone_of_another_wave_are_refused(tmp_path, order, diameters, wave, flow):
    (tmp_path / "case.toml").write_text(beside_mode(diameters, order, flow))
    with pytest.raises(CaseErrors, match=f"forced.backbone is of a wave of {diameters} nodal diameters") as caught:
        load_case(tmp_path / "case.toml")
    said = f"nodal_diameter = {wave}, which engine order {order} drives on 6 sectors"
    assert said in str(caught.value) and str(caught.value).count("fix:") == 1


@pytest.mark.ranks(1)
@pytest.mark.parametrize(("order", "diameters", "flow"), SAME)
def test_a_backbone_of_the_order_s_wave_is_taken(tmp_path, order, diameters, flow):
    """Without forces of the flow waves that run the other way have the same frequencies."""
    (tmp_path / "case.toml").write_text(beside_mode(diameters, order, flow))
    assert load_case(tmp_path / "case.toml").analyses["forced"].nodal_diameter == folded(order, SECTORS)


@pytest.mark.ranks(1)
def test_a_peak_beyond_a_backbone_is_told_in_words(comm, tmp_path):
    (tmp_path / "case.toml").write_text(beside_mode(2, 8, False, amplitude=0.25))
    assert run_case(tmp_path / "case.toml", RunOptions(out=tmp_path / "run", plots=False), comm) == 0
    said = (tmp_path / "run" / "run.log").read_text(encoding="utf-8")
    assert "Hz, beyond the amplitudes of mode\n" in said and "nan" not in said
