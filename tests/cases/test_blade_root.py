"""The finite-element model of the case blade_root."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.sparse.linalg import splu
from tolerances import REPEATED, ROUNDING, SOLVED

from fretwave import fe
from fretwave.commands.main import main
from fretwave.errors import InputError

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

FOLDER = Path(__file__).resolve().parents[2] / "cases" / "blade_root"
COARSE = dict(axial_cells=6, thickness_cells=1, radial_cells=(2, 1, 1, 2, 11))


def load(name):
    spec = importlib.util.spec_from_file_location(f"blade_root_{name}", FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


model = load("model")


@pytest.fixture(scope="module")
def blade():
    return model.blade(cache=None, **COARSE)


@pytest.fixture(scope="module")
def elastic():
    return model.blade(cache=None, slot="elastic", lug_cells=1, **COARSE)


def stiffness_of_normals(blade):
    """K with closed pairs that slip freely."""
    return model.stuck_stiffness(dict(blade, tangential_stiffness=0 * blade["tangential_stiffness"]))


def test_the_default_mesh_is_large_enough_and_well_shaped():
    options = model.checked_options({})
    mesh = fe.join(model.blade_blocks(options), options.order)
    assert mesh.n_dof >= 30_000 and mesh.order == 2
    assert mesh.quality().ratio > 0.3


def test_sizes_and_matrices(blade):
    n = 3 * len(blade["coordinates"])
    assert blade["M"].shape == blade["K"].shape == (n, n) and blade["B"].shape == (144, n)
    assert len(blade["keep_dofs"]) == 145 and blade["observation_dof"] in blade["keep_dofs"]
    assert len(np.unique(blade["contact_nodes"])) == 48 and np.bincount(blade["flank"]).tolist() == [24, 24]
    assert blade["mass"] == pytest.approx(4430.0 * blade["volume"], rel=ROUNDING)
    assert blade["rigid_residual"] < ROUNDING
    assert blade["areas"].sum() == pytest.approx(2 * 0.050 * 0.009) and np.ptp(blade["areas"]) < ROUNDING


def test_normals_point_from_the_blade_into_the_slot(blade):
    normals = blade["contact_frames"][:, 0]
    side = np.where(blade["flank"] == 0, -1.0, 1.0)
    angle = np.radians(50.0)
    assert normals == pytest.approx(np.outer(side, [0, np.sin(angle), 0]) + [0, 0, np.cos(angle)], abs=ROUNDING)
    assert blade["contact_frames"][:, 1] == pytest.approx(np.tile([1.0, 0, 0], (48, 1)), abs=ROUNDING)
    for node, point, normal in zip(blade["contact_nodes"], blade["contact_points"], normals):
        inside = blade["hexahedra"][(blade["hexahedra"] == node).any(axis=1)]
        assert ((blade["coordinates"][inside].mean(axis=1) - point) @ normal < -1e-4).all()


def test_the_elastic_slot_faces_the_blade_node_by_node(elastic):
    nodes = elastic["coordinates"]
    assert nodes[elastic["opposite_nodes"]] == pytest.approx(nodes[elastic["contact_nodes"]], abs=ROUNDING)
    assert not set(elastic["opposite_nodes"]) & set(elastic["contact_nodes"]) and len(elastic["keep_dofs"]) == 289
    slot = fe.join(model.slot_blocks(model.checked_options(dict(slot="elastic", lug_cells=1, **COARSE))))
    for flank, side in enumerate([("lug_left", 1, 1), ("lug_right", 1, 0)]):
        facing = fe.contact_patch(slot, *side, (6, 4)).normals
        assert facing == pytest.approx(-elastic["contact_frames"][elastic["flank"] == flank, 0], abs=ROUNDING)


def test_b_measures_translation_in_the_local_frames(blade, elastic):
    move = np.array([0.2, -0.7, 0.4])
    whole = np.tile(move, len(blade["coordinates"]))
    assert (blade["B"] @ whole).reshape(-1, 3) == pytest.approx(blade["contact_frames"] @ move)
    outwards = np.tile([0.0, 0, 1], len(blade["coordinates"]))
    assert (blade["B"] @ outwards)[::3] == pytest.approx(np.full(48, np.cos(np.radians(50.0))))
    both = np.tile(move, len(elastic["coordinates"]))
    assert abs(elastic["B"] @ both).max() < ROUNDING


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_normal_loads_balance_the_centrifugal_force(friction):
    blade = model.blade(cache=None, order=1, flank_cells=8, axial_cells=12, seating_friction=friction)
    normal, _, upward = np.moveaxis(blade["contact_frames"], 1, 0)
    slope = upward * np.sign(upward[:, 2:])
    radial = blade["normal_loads"] * (normal[:, 2] + friction * slope[:, 2])
    load = blade["centrifugal_load"].reshape(-1, 3).sum(axis=0)
    assert radial.sum() == pytest.approx(load[2]) and load[0] == pytest.approx(0, abs=SOLVED * load[2])
    centre = load[2] / (blade["mass"] * (1500 * np.pi / 30) ** 2)
    assert 0.28 < centre < 0.36


def test_the_axial_stop_alone_holds_the_slipping_blade(blade):
    axial = np.tile([1.0, 0, 0], len(blade["coordinates"]))
    K = stiffness_of_normals(blade)
    assert axial @ (K @ axial) == pytest.approx(1e7, rel=SOLVED)
    assert set(blade["coordinates"][blade["stop_nodes"], 0].round(9)) == {0.025}
    pivots = splu(K.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=dict(SymmetricMode=True)).U
    assert pivots.diagonal().min() > 0


def test_plates_hold_the_root_across_its_axis(blade):
    """Two plates of k: 2 k across the axis, nothing along it, and 2 k times the mean square distance about the axis."""
    held = model.blade(cache=None, retainer=1e9, **COARSE)
    plates = held["K"] - blade["K"]
    nodes = blade["coordinates"]
    o = model.Options()
    bottom, lower, upper = o.heights
    z = np.linspace(bottom, upper, 20_001)
    half = np.where(z < lower, o.foot_half_width, o.foot_half_width - (z - lower) / np.tan(o.angle))
    section = np.average(half**2 / 3 + (z - z.mean()) ** 2, weights=half)
    turn = np.column_stack([0 * nodes[:, 0], z.mean() - nodes[:, 2], nodes[:, 1]]).ravel()
    moves = [np.tile(axis, len(nodes)) for axis in np.eye(3)]
    assert [move @ (plates @ move) for move in moves] == pytest.approx([0, 2e9, 2e9], rel=SOLVED, abs=1)
    assert turn @ (plates @ turn) == pytest.approx(2e9 * section, rel=5e-3)


def test_first_bending_sticks_higher_than_it_slides_and_converges_with_the_mesh(blade):
    frequencies, shapes = model.stuck_modes(blade, 2)
    tip = shapes[:, 0].reshape(-1, 3)[blade["observation_dof"] // 3]
    assert blade["observation_dof"] % 3 == 1 and abs(tip[1]) > 0.95 * np.linalg.norm(tip)
    assert abs(shapes[blade["observation_dof"], 0]) > 0.95 * abs(shapes[:, 0]).max()
    sliding, _ = model.stuck_modes(dict(blade, tangential_stiffness=0 * blade["tangential_stiffness"]), 1)
    assert 0.9 * frequencies[0] < sliding[0] < 0.995 * frequencies[0]
    finer = model.blade(cache=None, axial_cells=6, thickness_cells=2, radial_cells=(3, 1, 1, 3, 16))
    assert model.stuck_modes(finer, 1)[0][0] == pytest.approx(frequencies[0], rel=5e-3)


def test_a_straight_symmetric_blade_loads_both_flanks_alike():
    straight = model.blade(cache=None, camber=(0.0, 0.0), stagger=(0.0, 0.0), **COARSE)
    _, shapes = model.stuck_modes(straight, 1)
    u = (straight["B"] @ shapes[:, 0]).reshape(2, 6, 4, 3)
    left, right = u[0], u[1, :, ::-1]
    scale = abs(u).max()
    assert left[..., 0] == pytest.approx(-right[..., 0], abs=1e-7 * scale)
    assert left[..., 1] == pytest.approx(-right[..., 1], abs=1e-7 * scale)
    # The second tangent points up the left flank and down the right one.
    assert left[..., 2] == pytest.approx(right[..., 2], abs=1e-7 * scale)


def test_an_elastic_slot_is_softer_and_the_mean_over_a_cell_stiffer_than_its_node(blade, elastic):
    stuck = model.stuck_modes(blade, 1)[0][0]
    assert 0.97 * stuck < model.stuck_modes(elastic, 1)[0][0] < stuck
    mean = model.blade(cache=None, average=True, **COARSE)
    assert stuck < model.stuck_modes(mean, 1)[0][0] < 1.01 * stuck
    assert mean["B"].shape[0] == 144 and len(mean["keep_dofs"]) > 145


def test_builds_are_cached_by_their_options(tmp_path, monkeypatch):
    options = dict(order=1, axial_cells=12, flank_cells=8)
    first = model.blade(cache=tmp_path, **options)
    monkeypatch.setattr(model, "compute", lambda _: pytest.fail("built twice"))
    again = model.blade(cache=tmp_path, **options)
    assert set(again) == set(first) and (again["K"] != first["K"]).nnz == 0
    with pytest.raises(pytest.fail.Exception):
        model.blade(cache=tmp_path, **options, flank_angle=45.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(flank_angel=45.0), "unknown option"),
        (dict(flank_angle=0.0), "not inclined"),
        (dict(flank_length=0.05), "the flanks meet"),
        (dict(slot="soft"), "unknown slot"),
        (dict(axial_cells=7), "contact grid does not fit"),
    ],
)
def test_options_that_cannot_be_built_are_refused(options, words):
    with pytest.raises(InputError, match=words) as caught:
        model.blade(cache=None, **{**COARSE, **options})
    assert caught.value.fix


def test_pictures_are_drawn(blade, elastic, tmp_path):
    figures = load("figures")
    frequencies, shapes = model.stuck_modes(blade, 1)
    figures.plot_mesh(elastic).savefig(tmp_path / "mesh.png", dpi=50)
    figures.plot_bending(blade, frequencies[0], shapes[:, 0]).savefig(tmp_path / "bending.png", dpi=50)
    assert all((tmp_path / name).stat().st_size > 5000 for name in ("mesh.png", "bending.png"))


def test_case_goes_from_stick_to_slip(tmp_path):
    """Constant at the stuck frequency, then a threshold, falling frequency and rising damping."""
    settings = ("model.stiffness_damping=0", "mode.amplitude=[3e-4, 9e-4]", "mode.report_at=[]", "reduction.compare=3")
    words = [word for setting in settings for word in ("--set", setting)]
    hook = sys.excepthook
    arguments = ["run", str(FOLDER / "case.toml"), "--quick", "--only", "mode", "--out", str(tmp_path), "--no-plots"]
    assert main([*arguments, *words]) == 0
    sys.excepthook = hook
    with h5py.File(tmp_path / "results.h5") as file:
        points = {name: data[()] for name, data in file["mode"]["points"].items()}
        stuck, sliding = (file["mode"].attrs[f"{name}_omega"] for name in ("stuck", "sliding"))
        report = json.loads(file["mode"].attrs["reduction"])
    stick = points["stick"] == 1
    assert stick[0] and not stick[-1]
    assert np.abs(points["omega"][stick] / stuck - 1).max() < REPEATED
    assert np.abs(points["zeta"][stick]).max() < REPEATED
    slipping = points["omega"][~stick]
    assert np.all(np.diff(slipping) < 0) and np.all(np.diff(points["zeta"][~stick]) > 0)
    assert sliding < slipping[-1] < stuck
    assert len(report["relative"]) == 3 and 0 < report["relative"][0] < 1e-5


def held_root(folder, *arguments):
    """Points of the short form, and the asymptotes [rad/s]."""
    held = FOLDER.parent / "blade_root_retained" / "case.toml"
    hook = sys.excepthook
    assert main(["run", str(held), "--quick", "--out", str(folder), "--no-plots", *arguments]) == 0
    sys.excepthook = hook
    with h5py.File(folder / "results.h5") as file:
        points = {name: data[()] for name, data in file["mode"]["points"].items()}
        return points, *(file["mode"].attrs[f"{name}_omega"] for name in ("stuck", "sliding"))


def test_held_root_goes_through_its_largest_damping(tmp_path):
    """The paper's figure 12: damping rises and falls once, the frequency goes from stuck to sliding. One elastic slider
    that takes omega_s to omega_f damps at most (omega_s^2 - omega_f^2) / (2 pi omega^2) (area of its loop at twice
    the amplitude of first slip); 48 that let go nearly together come close to it. By single nodes, which open less."""
    points, stuck, sliding = held_root(tmp_path, "--set", "model.options.average=false")
    zeta, top = points["zeta"], int(np.argmax(points["zeta"]))
    assert points["stick"][0] == 1 and points["stick"][-1] < 0.05 and (np.diff(points["amplitude"]) > 0).all()
    slips = int(np.argmax(points["stick"] < 0.99))
    assert (np.diff(zeta[slips : top + 1]) > 0).all() and (np.diff(zeta[top:]) < 0).all()
    assert 3 < top < len(zeta) - 4 and zeta[-1] < 0.9 * zeta[top]
    assert (np.diff(points["omega"][slips:]) < 0).all()
    assert points["omega"][-1] == pytest.approx(sliding, abs=0.25 * (stuck - sliding))
    slider = (stuck**2 - sliding**2) / (2 * np.pi * stuck**2)
    assert zeta[top] - zeta[0] == pytest.approx(slider, rel=0.15)


def test_pairs_by_their_means_damp_like_a_slider_too(tmp_path):
    """The same bound for the case as it is. Beyond the peak the pairs open, and the frequency falls past the sliding
    one, of closed contact."""
    points, stuck, sliding = held_root(tmp_path)
    zeta, top = points["zeta"], int(np.argmax(points["zeta"]))
    assert zeta[top] - zeta[0] == pytest.approx((stuck**2 - sliding**2) / (2 * np.pi * stuck**2), rel=0.15)
    assert 3 < top < len(zeta) - 4 and zeta[-1] < 0.9 * zeta[top]
    assert points["open"][0] == 0 and points["open"][-1] > 0.5 and points["omega"][-1] < sliding


def test_wear_of_the_flanks(tmp_path):
    """The paper's figures 13 to 16: damping rises, then falls; flanks wear unequally; some pairs never wear, some stop,
    others go on while the load moves to those that stick."""
    hook = sys.excepthook
    arguments = ["run", str(FOLDER / "case.toml"), "--quick", "--only", "wear_profile", "--no-plots"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    sys.excepthook = hook
    with h5py.File(tmp_path / "results.h5") as file:
        wear = file["wear_profile"]
        points = {name: data[()] for name, data in wear["points"].items()}
        depth, rate, load = (wear[f"{name}_root"][()] for name in ("depth", "rate", "load"))
    assert np.abs(points["energy_error"]).max() < REPEATED
    assert (np.diff(depth, axis=0) >= 0).all() and (np.diff(points["frequency_hz"]) < 0).all()
    top = int(np.argmax(points["zeta"]))
    assert 1.08 * points["zeta"][0] < points["zeta"][top] and points["zeta"][-1] < 0.95 * points["zeta"][top]
    assert points["worn_2"][-1] > 1.1 * points["worn_1"][-1]
    never = depth[-1] == 0
    share = rate[-1] / np.maximum(rate.max(axis=0), np.finfo(float).tiny)
    assert 5 < never.sum() < 24 and (rate[:, never] == 0).all()
    assert (~never & (share < 0.1)).sum() > 5 and (~never & (share > 0.4)).sum() > 5
    assert load[-1][never].mean() > 1.5 * load[0].mean() > 3 * load[-1][~never].mean()


def test_rotation_stiffens_the_bending():
    """omega^2 = omega_0^2 + B Omega^2, B = 1.193 + 1.570 R / L - 1 for a uniform cantilever on a hub of radius R that
    bends in the plane of rotation (Putter and Manor, J. Sound Vib. 56, 1978); this one is tapered, twisted, on a neck.
    """
    squares, speeds = [], np.array([0.0, 2000.0, 4000.0])
    for speed in speeds:
        turning = model.blade(cache=None, stiffening=True, speed_rpm=speed, **COARSE)
        squares.append(model.stuck_modes(turning, 1)[0][0] ** 2)
    southwell = (np.array(squares[1:]) - squares[0]) / (speeds[1:] / 60) ** 2
    o = model.Options()
    hub = o.foot_radius + model.tip_height(o) - o.aerofoil_length
    assert southwell[0] == pytest.approx(0.193 + 1.570 * hub / o.aerofoil_length, rel=0.15)
    assert southwell[1] == pytest.approx(southwell[0], rel=0.02)
