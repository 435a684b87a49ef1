"""The finite-element blisk with its friction ring: faces, masses, cyclic symmetry, and the wave on a small wheel."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from models.core_models import unknowns, whole
from test_cyclic import on_the_wheel
from tolerances import LAST_BIT, REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.cyclic.faces import rotation
from fretwave.errors import InputError
from fretwave.solve.preload import balanced

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

FOLDER = Path(__file__).resolve().parents[2] / "cases" / "blisk_ring"
MESH = dict(
    axial_cells=(1, 1, 2, 1, 1, 1, 1, 1),
    circumferential_cells=(1, 1, 1),
    radial_cells=(1, 1, 1),
    span_cells=2,
    ring_cells=1,
)
#: A wheel of few sectors, with interface modes of all its nodal diameters; constant normal load, a soft hold.
SMALL = dict(**MESH, blades=6, interface_diameters=(0, 1, 2, 3), interface_waves=5, component_modes=10)
SMALL |= dict(normal="constant", ring_hold=62.8)
DIAMETERS = 2
#: The case's short form.
QUICK = dict(
    axial_cells=(1, 1, 2, 1, 1, 1, 2, 1),
    circumferential_cells=(2, 1, 2),
    radial_cells=(2, 1, 1),
    span_cells=4,
    ring_cells=1,
)


def load(name):
    spec = importlib.util.spec_from_file_location(f"blisk_ring_{name}", FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


case = load("model")


@pytest.fixture(scope="module")
def blisk():
    return case.full(**MESH)


@pytest.fixture(scope="module")
def small():
    return case.reduced(cache=None, **SMALL)


@pytest.fixture(scope="module")
def quick():
    return case.reduced(cache=None, **QUICK)


def branch_of(quick, friction, springs=None, first=3e-5, last=1.5e-3, report_at=()):
    """Second bending of 4 nodal diameters with variable load, from stick to slip: amplitudes are multiples of mu."""
    o = case.checked_options({**QUICK, "friction": friction})
    K, groove = case.groove_contact(o, quick)
    pairs = fw.Contact("coulomb_3d", groove.B, groove.parameters, name="groove")
    K = K if springs is None else K + springs
    one = fw.Sector.from_faces(quick["M"], K, quick["low"], quick["high"], 36, contacts=[pairs])
    with one.model(4) as model:
        stuck = fw.linear_modes(model, 5)[4]
        mode = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 180), "CNM", int(quick["tip"]), stuck)
        rest = balanced(model, stuck)
        mode.preload(rest.displacement, rest.load)
        stop, reports = (first * friction, last * friction), [a * friction for a in report_at]
        points = fw.Continuation(mode, mode.initial(stop[0]), stop, fw.StepControl(maximum=0.2), reports)
        table = [
            {**mode.state(p.y), **mode.diagnostics(p.y), "mean": mode.coefficients(p.y)[:, 0], "event": p.event}
            for p in points
        ]
    assert points.converged, points.reason
    return stuck.frequency_hz, table


@pytest.fixture(scope="module")
def sector(small):
    """Reduced, with friction."""
    K, groove = case.groove_contact(case.checked_options(SMALL), small)
    pairs = fw.Contact("jenkins", groove.B, groove.parameters, name="groove")
    return fw.Sector.from_faces(small["M"], K, small["low"], small["high"], 6, contacts=[pairs])


def test_the_low_face_turned_is_the_high_face(blisk):
    nodes = blisk["coordinates"][blisk["free"]]
    low, high = (nodes[blisk[name][::3] // 3] for name in ("low", "high"))
    assert len(low) > 50
    assert np.allclose(low @ rotation(2 * np.pi / 36, "z").T, high, rtol=0, atol=ROUNDING)


def test_masses_rigid_motions_and_normal_load(blisk):
    """Ring: density times the volume of 1/36 of an annulus, the blade's stagger shears it without changing it."""
    o = case.checked_options(MESH)
    outer, width = o.groove_radius, o.axial[3] - o.axial[2]
    area = np.pi / 36 * (outer**2 - (outer - o.ring_height) ** 2)
    assert blisk["ring_mass"] == pytest.approx(o.ring_density * area * width, rel=1e-6)
    assert blisk["areas"].sum() == pytest.approx(2 * np.pi / 36 * outer * width, rel=1e-5)
    assert blisk["rigid_residual"].max() < ROUNDING
    load = case.contact_parameters(o, blisk)["normal_load"]
    expected = blisk["ring_mass"] * (outer - o.ring_height / 2) * (3000 * np.pi / 30) ** 2
    assert load.sum() == pytest.approx(expected, rel=ROUNDING)


def test_pairs_measure_the_ring_against_the_groove(blisk):
    """Ring moved outwards closes every pair; ring and disk moved together move none."""
    ring = blisk["free"] >= blisk["disk_nodes"]
    radial = blisk["coordinates"][blisk["free"]] * [1.0, 1.0, 0.0]
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    u = (blisk["B"] @ (radial * ring[:, None]).ravel()).reshape(-1, 3)
    assert np.allclose(u, [1.0, 0.0, 0.0], rtol=0, atol=1e-2)  # the normal is the mean over a cell
    assert np.allclose(blisk["B"] @ radial.ravel(), 0.0, rtol=0, atol=ROUNDING)


def test_frequencies_do_not_depend_on_the_waves_direction(sector):
    with sector.model(DIAMETERS) as forward, sector.model(-DIAMETERS) as backward:
        found = [[mode.omega for mode in fw.linear_modes(model, 5)] for model in (forward, backward)]
    assert found[0] == pytest.approx(found[1], rel=SOLVED)


@pytest.mark.parametrize("state", ["stuck", "free"])
def test_waves_of_all_nodal_diameters_are_the_modes_of_the_wheel(sector, state):
    """Of elastic motion to 1e-9; a sliding ring's rigid motions, far below, to the rounding of K."""
    waves = []
    for diameters in (0, 1, -1, 2, -2, 3):
        with sector.model(diameters) as model:
            waves += [mode.omega for mode in fw.linear_modes(model, 4, state)]
    with sector.wheel() as wheel:
        modes = np.array([mode.omega for mode in fw.linear_modes(wheel, 14, state)])
    expected = np.sort(waves)[:14]
    held = expected < 2 * case.checked_options(SMALL).ring_hold
    assert np.count_nonzero(held) == (2 if state == "free" else 0)  # axial shift and rotation
    assert modes[~held] == pytest.approx(expected[~held], rel=SOLVED)
    highest = scipy.linalg.eigvalsh(sector.K[0].toarray(), sector.M[0].toarray())[-1]
    assert modes[held] ** 2 == pytest.approx(expected[held] ** 2, rel=0, abs=LAST_BIT * highest)


def test_the_reduction_keeps_the_lowest_waves(small, sector):
    """Reduced frequencies are upper bounds (Rayleigh-Ritz), close in the nodal diameters that gave interface modes."""
    o, unreduced = case.checked_options(SMALL), case.full(**SMALL)
    with sector.model(DIAMETERS) as model:
        found = np.array([mode.omega for mode in fw.linear_modes(model, 4)])
    expected = np.array([mode.omega for mode in case.waves(o, unreduced, DIAMETERS, 4)])
    error = found / expected - 1
    assert error.min() > -1e-8
    assert error.max() < 2e-3


def test_a_slipping_wave_of_the_sector_solves_the_wheel(small, sector):
    """Omega and beta alike and no residual on the wheel, at amplitudes of stick and slip."""
    tip, orders, amplitudes = int(small["tip"]), [1, 3], [1e-5, 3e-4]
    with sector.model(DIAMETERS) as model, sector.wheel() as wheel:
        stuck = fw.linear_modes(model, 1)[0]
        harmonics = fw.Harmonics(orders, 120)
        one = fw.NonlinearMode(model, harmonics, "CNM", tip, stuck)
        branch = fw.Continuation(one, one.initial(5e-6), (5e-6, 1e-3), report_at=amplitudes)
        points = [point for point in branch if point.event == "report"]
        assert branch.converged and len(points) == 2, branch.reason
        assert one.state(points[0].y)["zeta"] < SOLVED < 1e-5 < one.state(points[1].y)["zeta"]
        shape = sector.wave(stuck.shape + 1j * stuck.imaginary, DIAMETERS).ravel()
        around = fw.NonlinearMode(wheel, harmonics, "CNM", tip, fw.LinearMode(stuck.omega, 0, shape.real, shape.imag))
        for point in points:
            r = whole(around.residual(unknowns(around, on_the_wheel(sector, DIAMETERS, one, point.y, orders))))
            assert np.abs(r).max() < REPEATED


def test_the_unreduced_wheel_moves_like_its_sector():
    """All finite elements of all sectors, by one sector's factor, from stick to slip."""
    structure = case.build(reduced=False, **SMALL)
    groove = structure.pairs["groove"]
    pairs = fw.Contact("jenkins", groove, name="groove")
    sector = fw.Sector.from_faces(
        structure.M, structure.K, structure.low, structure.high, 6, contacts=[pairs], axis="z"
    )
    assert sector.n_dof > 1000
    tip = int(np.searchsorted(np.setdiff1d(np.arange(structure.n_dof), structure.high), structure.dofs["tip"]))
    harmonics, found, routes = fw.Harmonics([1, 3], 120), [], []
    with sector.model(DIAMETERS) as model, sector.wheel() as wheel:
        stuck = fw.linear_modes(model, 1)[0]
        around = sector.around(stuck, DIAMETERS)
        counter = around.shape - 1j * around.imaginary
        one = fw.NonlinearMode(model, harmonics, "CNM", tip, stuck)
        for mode in (one, fw.NonlinearMode(wheel, harmonics, "CNM", tip, around, "", counter)):
            branch = fw.Continuation(mode, mode.initial(1e-5), (1e-5, 1e-4), report_at=[3e-5])
            found.append([mode.state(point.y) for point in branch if point.event or point.newton])
            routes.append(branch.route)
            assert branch.converged, branch.reason
    assert "lowest modes and a sector's factor" in routes[1]
    for a, b in ((found[1][0], found[0][0]), (found[1][-1], found[0][-1])):
        assert a["omega"] == pytest.approx(b["omega"], rel=TIGHT)
        assert a["beta"] == pytest.approx(b["beta"], abs=TIGHT * b["omega"])
    assert found[1][-1]["zeta"] > 1e-5


def test_friction_scales_amplitude(small):
    """With constant normal load the motion at amplitude a and mu is that at 2 a and 2 mu, twice as large."""
    found = []
    for factor in (1, 2):
        o = case.checked_options({**SMALL, "friction": 0.3 * factor})
        K, groove = case.groove_contact(o, small)
        pairs = fw.Contact("jenkins", groove.B, groove.parameters, name="groove")
        one = fw.Sector.from_faces(small["M"], K, small["low"], small["high"], 6, contacts=[pairs])
        with one.model(DIAMETERS) as model:
            stuck = fw.linear_modes(model, 1)[0]
            mode = fw.NonlinearMode(model, fw.Harmonics([1, 3], 120), "CNM", int(small["tip"]), stuck)
            branch = fw.Continuation(
                mode, mode.initial(5e-6 * factor), (5e-6 * factor, 1e-3 * factor), report_at=[3e-4 * factor]
            )
            found += [mode.state(point.y) for point in branch if point.event == "report"]
    assert len(found) == 2
    assert found[1]["omega"] == pytest.approx(found[0]["omega"], rel=TIGHT)
    assert found[1]["zeta"] == pytest.approx(found[0]["zeta"], rel=1e-7)


def test_the_papers_picture_with_variable_load(quick):
    """Stick, then the frequency falls while damping rises, then it rises above the stuck one: GT2008-50860, figure 9.

    Figure 10: less friction, a lower threshold, the same largest damping (within 5 %; lift-off takes a little of it).
    """
    found = []
    for friction in (0.06, 0.3):
        stuck, table = branch_of(quick, friction)
        hz, zeta = (np.array([row[key] for row in table]) for key in ("frequency_hz", "zeta"))
        lowest, largest = int(np.argmin(hz)), int(np.argmax(zeta))
        assert table[0]["stick"] == 1 and zeta[0] < SOLVED and hz[0] == pytest.approx(stuck, rel=SOLVED)
        assert hz[lowest] < stuck - 5 and stuck + 20 < hz[-1] and lowest < largest < len(table) - 1
        assert zeta[largest] > 4e-3 and zeta[-1] < 0.95 * zeta[largest]
        amplitude = np.array([row["amplitude"] for row in table])
        onset = np.interp(1e-4, zeta[: lowest + 1], amplitude[: lowest + 1])
        found.append((onset / friction, zeta[largest], table[-1]["open"]))
    (low, high) = found
    assert low[0] == pytest.approx(high[0], rel=0.05)
    assert low[1] == pytest.approx(high[1], rel=0.05)
    assert low[2] == 0 < high[2]  # speed and mu decide whether slip or lift-off comes first


def test_a_travelling_wave_drags_the_ring_along(quick):
    """The mean friction force does not know what holds the ring: springs four times as stiff, a quarter of the way."""
    o = case.checked_options(QUICK)
    more = case.ring_springs(replace(o, ring_hold=np.sqrt(3) * o.ring_hold), quick, quick["ring_mass"])
    tangents = np.arange(quick["B"].shape[0]) % 3 > 0
    kept = np.setdiff1d(np.arange(quick["M"].shape[0]), quick["high"])
    moved = []
    for springs in (None, more):
        _, table = branch_of(quick, 0.3, springs, report_at=[1.2e-3])
        row = next(row for row in table if row["event"] == "report")
        assert row["stick"] < 0.01
        moved.append((quick["B"][tangents][:, kept] @ row["mean"]).reshape(-1, 2).mean(axis=0))
    assert np.linalg.norm(moved[0]) > 1e-5
    assert moved[0] == pytest.approx(4 * moved[1], rel=0.1, abs=0.05 * np.linalg.norm(moved[0]))


def test_the_second_bending_has_one_node_along_the_span(blisk):
    """Its frequency lies between those of the held blade's first and sixth mode, and it is orthogonal to the first."""
    frequency, shape, dofs = case.second_bending(case.checked_options(MESH), blisk)
    frequencies, shapes, _ = case.blade_modes(blisk)
    M = blisk["M"][dofs][:, dofs]
    assert frequencies[0] < frequency < frequencies[-1]
    assert abs(shapes[:, 0] @ M @ shape) < REPEATED


def test_unknown_options_are_refused():
    with pytest.raises(InputError, match="unknown option"):
        case.full(bladez=36)
    with pytest.raises(InputError, match="unknown normal load"):
        case.full(normal="none")
