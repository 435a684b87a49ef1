"""``fretwave view`` of sectors: waves that run around the wheel, wheels solved whole, and what is in memory."""

from __future__ import annotations

import shutil
import weakref
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from command_line import call
from models.rubbing_sector import BUILDER, SECTOR
from models.vtkhdf_files import read_step, skewed_mesh
from tolerances import ROUNDING, SOLVED

import fretwave as fw
from fretwave.cyclic.faces import rotation
from fretwave.model.cells import KINDS
from fretwave.view.geometry import mesh_of
from fretwave.view.motion import Scene
from fretwave.view.vtkhdf import HEXAHEDRON, VERTEX

TRIQUADRATIC_HEXAHEDRON = KINDS["triquadratic_hexahedron"].vtk

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

from models.built_sector import build  # noqa: E402

SECTORS, DIAMETERS, PHASES = 6, 2, 24
#: From one sector to the next theta = 2 pi 2 / 6 of delay, in steps.
DELAY = PHASES * DIAMETERS // SECTORS
MODES = '[reduction]\nmodes = 8\ninterface = "modes"\ninterface_diameters = [2, 0]\ninterface_waves = 4\n\n'
VARIANTS = {
    "as it is": "",
    "reduced": MODES,
    "reduced by the builder": "options = { reduced = true }\n",
    "whole wheel": "wheel",
}


def solved(folder: Path, variant: str) -> Path:
    """A run folder."""
    shutil.copy(BUILDER, folder / "model.py")
    text = SECTOR
    if variant == MODES:
        text = text.replace("[[contact]]", MODES + "[[contact]]")
    elif variant == "wheel":
        text = text.replace("nodal_diameter = 2", "nodal_diameter = 2\nwheel = true")
    elif variant == "mistuned":
        deviations = "mistuning = { deviations = [0.02, -0.01, 0.0, 0.01, -0.03, 0.01] }"
        text = text.replace("nodal_diameter = 2", f"nodal_diameter = 2\nwheel = true\n{deviations}")
        text = text.replace("amplitude = [5e-6, 2e-5]\nreport_at = [1e-5]", "amplitude = [1.2e-5, 1.22e-5]")
    else:
        text = text.replace("mass_damping", variant + "mass_damping")
    (folder / "case.toml").write_text(text)
    assert call("run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots") == 0
    return folder / "run"


@pytest.fixture(scope="module", params=VARIANTS.values(), ids=VARIANTS)
def viewed(request, tmp_path_factory) -> Path:
    """The grid of a wave in slip; its pairs stand beside it."""
    folder = solved(tmp_path_factory.mktemp("wheel"), request.param)
    assert call("view", str(folder), "--phases", str(PHASES)) == 0
    return folder / "mode.vtkhdf"


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Path:
    """Run of the unreduced sector."""
    return solved(tmp_path_factory.mktemp("plain"), "")


def by_sector(values: np.ndarray) -> np.ndarray:
    return values.reshape(SECTORS, -1, *values.shape[1:])


def turned_back(vectors: np.ndarray) -> np.ndarray:
    """Vectors (N, n, 3) in the frames of the sectors."""
    turns = [rotation(2 * np.pi * j / SECTORS, "z") for j in range(SECTORS)]
    return np.stack([v @ turn for v, turn in zip(vectors, turns)])


def tip_node() -> int:
    built = build()
    return int(np.nonzero(built.displacements == built.dofs["tip"])[0][0])


def check_faces(path: Path) -> None:
    """The high face of each sector lies and moves with the low face of the next; the bore stays."""
    built = build()
    node = {int(dof): number for number, row in enumerate(built.displacements) for dof in row[:1] if dof >= 0}
    low, high = (np.array([node[int(dof)] for dof in face[::3]]) for face in (built.low, built.high))
    held = built.displacements[:, 0] < 0
    for step in range(PHASES):
        found = read_step(path, step)
        for name in ("points", "displacement", "rest_displacement", "harmonic_1_real", "harmonic_2_imag"):
            values = by_sector(found[name])
            size = np.abs(values).max()
            assert size > 0
            assert np.roll(values[:, low], -1, axis=0) == pytest.approx(values[:, high], rel=0, abs=SOLVED * size)
        assert not by_sector(found["displacement"])[:, held].any()
        assert found["sector"].tolist() == np.repeat(np.arange(SECTORS), len(held)).tolist()


def test_sectors_hang_together_at_every_time(viewed: Path) -> None:
    check_faces(viewed)


def test_a_mistuned_wheel_shows_each_sectors_own_motion(tmp_path: Path) -> None:
    """Tips move as their own coefficients say, and the faces still hang together."""
    folder = solved(tmp_path, "mistuned")
    assert call("view", str(folder), "--phases", str(PHASES)) == 0
    check_faces(folder / "mode.vtkhdf")
    with h5py.File(folder / "results.h5") as file:
        names = file["mode/dof"][()].tolist()
        Q = file["mode/coefficients"][-1, [names.index(f"tip@{j}".encode()) for j in range(SECTORS)]]
        cosines = [k for k, text in enumerate(file["mode/harmonic"][()]) if not text.endswith(b"s")]
    tips = by_sector(read_step(folder / "mode.vtkhdf", 0)["displacement"])[:, tip_node(), 2]
    assert tips == pytest.approx(Q[:, cosines].sum(axis=1), rel=SOLVED)
    assert np.ptp(np.abs(tips)) > 0.1 * np.abs(tips).max()


def test_sector_j_repeats_the_motion_of_the_first_with_its_delay(viewed: Path) -> None:
    """x_j(t) = x_0(t - j theta / omega) in turned frames: a forward wave; amplitudes q_n e^{-i n j theta}."""
    motion = np.stack([turned_back(by_sector(read_step(viewed, s)["displacement"])) for s in range(PHASES)])
    assert np.ptp(motion, axis=0).max() > 1e-5
    limit = 1e-7 * np.abs(motion).max()
    for j in range(SECTORS):
        assert motion[:, j] == pytest.approx(np.roll(motion[:, 0], j * DELAY, axis=0), rel=0, abs=limit)
    found = read_step(viewed, 0)
    for n in (1, 3):
        q = turned_back(by_sector(found[f"harmonic_{n}_real"] + 1j * found[f"harmonic_{n}_imag"]))
        turns = np.exp(-2j * np.pi * n * DIAMETERS * np.arange(SECTORS) / SECTORS)
        assert q == pytest.approx(turns[:, None, None] * q[0], rel=0, abs=limit)


def test_the_tip_moves_as_solved(viewed: Path) -> None:
    """Coefficients of the named dof of sector 0, along the axis that no turn moves."""
    with h5py.File(viewed.parent / "results.h5") as file:
        names = [name.decode() for name in file["mode/dof"][()]]
        labels = [text.decode() for text in file["mode/harmonic"][()]]
        tip = next(k for k, name in enumerate(names) if name in ("tip", "tip@0"))
        Q = file["mode/coefficients"][-1, tip]
    for step in (0, 5, 17):
        phase = 2 * np.pi * step / PHASES
        sums = [(np.sin if text[-1] == "s" else np.cos)(int(text.rstrip("cs")) * phase) for text in labels]
        assert read_step(viewed, step)["displacement"][tip_node(), 2] == pytest.approx(Q @ sums, rel=SOLVED)


def test_all_variants_show_the_same_motion(viewed: Path, plain: Path, tmp_path: Path) -> None:
    """The wheel as its sector, the reductions to what they leave out."""
    out = tmp_path / "plain.vtkhdf"
    assert call("view", str(plain), "--phases", str(PHASES), "--out", str(out)) == 0
    wanted, found = read_step(out, 7), read_step(viewed, 7)
    assert found["points"].tolist() == wanted["points"].tolist()
    size = np.abs(wanted["displacement"]).max()
    limit = 2e-2 if "[reduction]" in (viewed.parent / "case.toml").read_text() else 1e-6
    assert np.abs(found["displacement"] - wanted["displacement"]).max() < limit * size
    pairs = [read_step(path.with_name(f"{path.stem}_contact.vtkhdf"), 7) for path in (viewed, out)]
    for name in ("points", "normal_force", "tangential_force", "normal", "share_slip", "dissipated_work"):
        size = max(np.abs(pairs[1][name]).max(), 1e-12)
        assert np.abs(pairs[0][name] - pairs[1][name]).max() <= 2 * limit * size


@pytest.mark.parametrize("wheel", ["", "wheel = true"])
def test_a_reduced_sector_rests_as_the_unreduced_one(wheel: str, plain: Path, tmp_path: Path) -> None:
    """Its weight bends it between the dofs that are kept, which two component modes know little of."""
    shutil.copy(BUILDER, tmp_path / "model.py")
    text = SECTOR.replace("[[contact]]", "[reduction]\nmodes = 2\n\n[[contact]]")
    (tmp_path / "case.toml").write_text(text.replace("nodal_diameter = 2", f"nodal_diameter = 2\n{wheel}"))
    assert call("run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run"), "--no-plots") == 0
    shown = []
    for folder in (plain, tmp_path / "run"):
        out = tmp_path / f"{folder.parent.name}.vtkhdf"
        assert call("view", str(folder), "--phases", "2", "--out", str(out)) == 0
        shown.append(read_step(out, 0)["rest_displacement"])
    assert np.abs(shown[1] - shown[0]).max() < 1e-7 * np.abs(shown[0]).max()


def test_linear_modes_do_not_stand_under_the_loads(tmp_path: Path) -> None:
    """They are of the model without its loads: nothing moves it from rest, whatever other analyses rest about."""
    shutil.copy(BUILDER, tmp_path / "model.py")
    text = SECTOR.replace("[[contact]]", "[reduction]\nmodes = 2\n\n[[contact]]")
    text += '\n[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = 1\nnodal_diameters = [2]\n'
    (tmp_path / "case.toml").write_text(text)
    folder = tmp_path / "run"
    assert call("run", str(tmp_path / "case.toml"), "--only", "linear", "--out", str(folder), "--no-plots") == 0
    assert call("view", str(folder), "--phases", "2") == 0
    assert not read_step(folder / "linear.vtkhdf", 0)["rest_displacement"].any()


def test_a_reduction_that_is_made_again_shows_the_same(viewed: Path, tmp_path: Path) -> None:
    """A run whose basis was too large to be kept."""
    kept = viewed.parent / "reduction.h5"
    assert kept.exists() == ("[reduction]" in (viewed.parent / "case.toml").read_text())
    if not kept.exists():
        return
    folder = tmp_path / "run"
    shutil.copytree(viewed.parent, folder, ignore=shutil.ignore_patterns(kept.name))
    assert call("view", str(folder), "--phases", str(PHASES)) == 0
    for step in (0, 7):
        found, again = read_step(viewed, step), read_step(folder / viewed.name, step)
        for name, values in found.items():
            size = np.abs(values).max() if np.issubdtype(np.asarray(values).dtype, np.floating) else 0.0
            np.testing.assert_allclose(again[name], values, rtol=0, atol=ROUNDING * size, err_msg=name)


def test_points_may_have_nodal_diameters_of_their_own(plain: Path, tmp_path: Path) -> None:
    """Where the table has such a column: here -2, which turns the wave around."""
    folder = tmp_path / "run"
    shutil.copytree(plain, folder)
    with h5py.File(folder / "results.h5", "a") as file:
        points = file["mode/points"]
        points["nodal_diameter"] = np.full(len(points["amplitude"]), -DIAMETERS)
    assert call("view", str(folder), "--phases", str(PHASES)) == 0
    tip = [by_sector(read_step(folder / "mode.vtkhdf", s)["displacement"])[:, tip_node(), 2] for s in range(PHASES)]
    first, second = np.array(tip).T[:2]
    assert second == pytest.approx(np.roll(first, -DELAY), rel=1e-6, abs=ROUNDING)
    assert np.abs(second - np.roll(first, DELAY)).max() > 0.1 * np.abs(first).max()


def test_pairs_of_all_sectors_follow_each_other(viewed: Path) -> None:
    """Forces with the delay of the wave, shares and work alike in all sectors; normals turn with them."""
    path = viewed.with_name("mode_contact.vtkhdf")
    force = np.stack([by_sector(read_step(path, step)["normal_force"]) for step in range(PHASES)])
    for j in range(SECTORS):
        assert force[:, j] == pytest.approx(np.roll(force[:, 0], j * DELAY, axis=0), rel=1e-6)
    found = read_step(path, 3)
    for name in ("dissipated_work", "share_slip"):
        values = by_sector(found[name])
        assert values == pytest.approx(np.tile(values[0], (SECTORS, 1)), rel=1e-5)
        assert values.max() > 0
    assert found["normal"] == pytest.approx(np.tile([0.0, 0.0, -1.0], (3 * SECTORS, 1)))


def test_pairs_of_one_sector_where_delays_are_no_whole_samples(plain: Path, tmp_path: Path, capfd) -> None:
    """96 samples of a wave of 2 nodal diameters go around 6 sectors; 64 would not."""
    folder = tmp_path / "run"
    shutil.copytree(plain, folder)
    with h5py.File(folder / "results.h5", "a") as file:
        file["mode"].attrs["samples"] = 64
        for key in "uvf":
            values = file[f"mode/contact_pads/{key}"][()]
            del file[f"mode/contact_pads/{key}"]
            file[f"mode/contact_pads/{key}"] = values[:, :64]
    assert call("view", str(folder), "--phases", "16") == 0
    assert "3 contact pairs (the samples of a period are no multiple" in capfd.readouterr().out
    with h5py.File(folder / "mode_contact.vtkhdf") as file:
        assert file["VTKHDF/Points"].shape == (3, 3)


def test_a_probed_node_moves_as_the_view_shows_it(viewed: Path, tmp_path: Path) -> None:
    """In all directions of space, over the period, in several sectors: waves, reductions, the whole wheel."""
    point = int(read_step(viewed, 0)["point"])
    moved = np.stack([by_sector(read_step(viewed, step)["displacement"]) for step in range(PHASES)])
    for node, sector in ((0, 0), (7, 1), (moved.shape[2] - 1, 5)):
        out = tmp_path / f"{node}.csv"
        words = ["--node", node, "--sector", sector, "--steps", PHASES, "--at", "row", point, "--out", out]
        assert call("probe", viewed.parent, *words) == 0
        found = np.loadtxt(out, delimiter=",", skiprows=1)
        np.testing.assert_allclose(found[:, 0], np.arange(PHASES) / PHASES, rtol=0, atol=ROUNDING)
        scale = np.abs(moved[:, sector, node]).max()
        np.testing.assert_allclose(found[:, 1:], moved[:, sector, node], rtol=0, atol=ROUNDING * scale)


def test_pairs_of_a_wheel_are_those_of_its_sectors(plain: Path, tmp_path: Path) -> None:
    """Each sector's pairs dissipate and slip as the sector's alone; places are repeated."""
    wheel, found = solved(tmp_path, "wheel"), []
    for folder in (plain, wheel):
        out = tmp_path / "pairs.csv"
        assert call("probe", folder, "--pairs", "--at", "end", "--out", out) == 0
        found.append(np.genfromtxt(out, delimiter=",", names=True, dtype=None, encoding="utf-8"))
    one, all_of_them = found
    assert len(all_of_them) == SECTORS * len(one)
    for name in ("work", "normal_largest", "slip_range", "slip"):
        values = all_of_them[name].reshape(SECTORS, -1)
        np.testing.assert_allclose(
            values, np.tile(one[name], (SECTORS, 1)), rtol=0, atol=1e-4 * np.abs(one[name]).max()
        )
    assert one["slip_range"].max() > 0 and one["work"].max() > 0


def test_some_sectors(plain: Path, tmp_path: Path, capfd) -> None:
    """One, or a few; the motion is theirs."""
    paths = [tmp_path / f"{name}.vtkhdf" for name in ("all", "some")]
    assert call("view", str(plain), "--out", str(paths[0])) == 0
    assert call("view", str(plain), "--out", str(paths[1]), "--sectors", "4", "0") == 0
    assert "2 of 6 sectors" in capfd.readouterr().out
    everything, some = (read_step(path, 9)["displacement"] for path in paths)
    assert some.reshape(2, -1, 3).tolist() == by_sector(everything)[[4, 0]].tolist()
    assert call("view", str(plain), "--sectors", "6") == 2
    assert "there is no such sector" in capfd.readouterr().err


def test_a_wheel_without_axis_is_refused(tmp_path: Path, capfd) -> None:
    """Its sectors cannot be placed, one of them can be shown."""
    (tmp_path / "model.py").write_text(BUILDER.read_text().replace('        axis="z",\n    )', "    )"))
    (tmp_path / "case.toml").write_text(SECTOR.replace('loads = ["weight"]', ""))
    arguments = ["--set", "mode.amplitude=[5e-6, 5.1e-6]", "--set", "mode.report_at=[]", "--no-plots"]
    assert call("run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run"), *arguments) == 0
    assert call("view", str(tmp_path / "run")) == 2
    assert "it has no axis" in capfd.readouterr().err
    assert call("view", str(tmp_path / "run"), "--sectors", "0") == 0


def test_the_motion_of_all_sectors_is_never_in_memory(plain: Path, tmp_path: Path, monkeypatch) -> None:
    """When a sector is made, the one before it is the only other that is left."""
    made: list[weakref.ref[Any]] = []
    alive = []
    original = Scene.shape

    def shape(self: Scene, sector: int) -> Any:
        found = original(self, sector)
        alive.append(sum(other() is not None for other in made))
        made.append(weakref.ref(found))
        return found

    monkeypatch.setattr(Scene, "shape", shape)
    assert call("view", str(plain), "--out", str(tmp_path / "grid.vtkhdf")) == 0
    assert len(made) == 1 + 2 * SECTORS and max(alive) == 1  # for the scale, the grid and the pairs


def test_cells_of_a_built_model() -> None:
    """Triquadratic as they are or cut in eight; without cells the nodes are points."""
    skewed = skewed_mesh()
    n, cells = skewed.n_dof, skewed.vtk_cells
    model = fw.Structure(sp.identity(n, format="csr"), sp.identity(n, format="csr"), coordinates=skewed.nodes)
    case = SimpleNamespace(structure=model, path=Path("case.toml"))
    shown = [(table.shape, kind) for table, kind in mesh_of(case)[1]]
    assert shown == [((n // 3, 1), VERTEX)]
    model.hexahedra = cells
    assert model.complaint() is None and mesh_of(case)[1][0][1] == TRIQUADRATIC_HEXAHEDRON
    ((cut, kind),) = mesh_of(case, linear=True)[1]
    assert (cut.shape, kind) == ((16, 8), HEXAHEDRON)
    model.hexahedra = cells[:, :8]
    assert model.complaint() is None and mesh_of(case, linear=True)[1][0][1] == HEXAHEDRON
    model.hexahedra = cells[:, :19]
    assert "(2, 19), not (n_cells, 8, 20 or 27)" in model.complaint()
    model.hexahedra = cells + 1
    assert f"nodes 1 to {n // 3} of {n // 3}" in model.complaint()
