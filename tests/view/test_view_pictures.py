"""``fretwave view`` without ParaView, for ParaView 5.11, and the contact as faces with what they carry."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.chain_case import BUILDER as CHAIN_BUILDER
from models.chain_case import CHAIN
from models.rubbing_sector import BUILDER, SECTOR
from models.vtkhdf_files import read_step
from test_series import SINGLE, read_vtu
from tolerances import ROUNDING

from fretwave.case.load import load_case
from fretwave.cyclic.faces import rotation
from fretwave.results.results import open_results
from fretwave.view.choice import read_choice
from fretwave.view.geometry import mesh_of
from fretwave.view.motion import Scene, scene_of
from fretwave.view.options import ViewOptions

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")
Image = pytest.importorskip("PIL.Image")

from matplotlib.figure import Figure  # noqa: E402
from models.built_sector import HEIGHT, RIM, TIP, build  # noqa: E402

from fretwave.plots import style  # noqa: E402
from fretwave.plots.solid import COMPASS, Camera, compass  # noqa: E402
from fretwave.view.still import Still  # noqa: E402

SECTORS, PHASES = 6, 12


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """A wave of a sector in slip."""
    folder = tmp_path_factory.mktemp("pictures")
    shutil.copy(BUILDER, folder / "model.py")
    (folder / "case.toml").write_text(SECTOR)
    assert call("run", folder / "case.toml", "--out", folder / "run", "--no-plots") == 0
    return folder / "run"


def colours(image) -> set[tuple[int, ...]]:
    return set(image.convert("RGB").getdata())


def test_a_picture_shows_the_whole_wheel_and_writes_nothing_else(run: Path, capfd) -> None:
    before = set(run.iterdir())
    assert call("view", run, "--png", "--phases", PHASES) == 0
    assert set(run.iterdir()) - before == {run / "mode.png"}
    said = capfd.readouterr().out
    assert "faces, displacements drawn" in said
    assert len(colours(Image.open(run / "mode.png"))) > 100


@pytest.mark.parametrize("ending", [".png", ".gif", ".pvd"])
def test_the_ending_of_a_file_says_what_it_is(run: Path, tmp_path: Path, ending: str) -> None:
    assert call("view", run, "--phases", 4, "--out", tmp_path / f"shape{ending}") == 0
    assert (tmp_path / f"shape{ending}").exists() and not list(tmp_path.glob("*.vtkhdf"))


@contextmanager
def still_of(run: Path) -> Iterator[tuple[Still, Scene]]:
    """The wheel, drawn as it moves."""
    case = load_case(run.parent / "case.toml")
    nodes, cells = mesh_of(case, True)
    with open_results(run / "results.h5") as file:
        choice = read_choice(file, run, case, ViewOptions(phases=PHASES))
    with scene_of(case, choice, nodes, run, ()) as scene:
        yield Still(scene, cells, 1.0, None), scene


def test_faces_of_a_wheel_enclose_its_volume(run: Path) -> None:
    """Those between the sectors are inside: what is left is closed, and as large as six sectors."""
    with still_of(run) as (still, scene):
        first, second = (scene.shape(sector) for sector in (0, 1))
    corners = still.points[still.faces]
    vectors = np.cross(corners, np.roll(corners, -1, axis=1)).sum(axis=1) / 2
    volume = np.einsum("nx,nx->", vectors, corners.mean(axis=1)) / 3
    assert np.abs(vectors.sum(axis=0)).max() < ROUNDING * np.abs(vectors).sum()
    middles = np.round(corners.mean(axis=1), 9)
    assert len(np.unique(middles, axis=0)) == len(middles)  # no face lies on another
    angles = np.pi / SECTORS * np.array([0.5, 0.5, 0.5, 0.5])  # chords between the nodes of the annulus
    ring = HEIGHT * SECTORS * 0.5 * np.sin(angles).sum() * (RIM**2 - 0.1**2)
    blades = HEIGHT * SECTORS * 0.5 * np.sin(angles[:2]).sum() * (TIP**2 - RIM**2)
    assert volume == pytest.approx(ring + blades, rel=1e-2)  # the blocks are skewed along the axis
    assert still.sizes.max() == pytest.approx(max(first.largest(), second.largest()), rel=0.05)


def test_a_sector_asked_for_twice_is_shown_once(run: Path, capfd) -> None:
    """Faces that lie on each other are inside: of a sector drawn twice none would be left."""
    said = []
    for sectors in (["1"], ["1", "1"]):
        assert call("view", run, "--png", "--sectors", *sectors, "--out", run / "once.png") == 0
        said.append(capfd.readouterr().out)
    assert said[0] == said[1] and " 0 faces" not in said[0]


def test_a_picture_does_not_miss_contacts(run: Path, capfd) -> None:
    """It shows none; the file for ParaView would."""
    for words, missed in ((["--png"], False), ([], True)):
        assert call("view", run, *words, "--point", 1, "--out", run / "first") == 0
        assert ("no contact pairs are shown" in capfd.readouterr().out) is missed


@pytest.mark.parametrize("tall", [1.0, 100.0])
def test_title_and_solid_are_in_the_middle_of_the_picture(run: Path, tall: float) -> None:
    """Also of what is tall: the title is wider than it, and the colour bar stays beside it."""
    with still_of(run) as (still, _), style.rules():
        still.points[:, 2] *= tall
        figure, _ = still._figure()
        figure.canvas.draw()
        title = figure._suptitle.get_window_extent()
        solid, bar = (axes.get_window_extent() for axes in figure.axes)
    width = figure.bbox.width
    assert title.x0 > 0 and title.x1 < width and abs(title.x0 + title.x1 - width) < 0.02 * width
    assert abs(solid.x0 + bar.x1 - width) < 0.15 * width and 0 < bar.x0 - solid.x1 < 0.05 * width


@pytest.mark.parametrize("size", [(8.0, 2.0), (2.0, 8.0)])
def test_the_axes_of_a_picture_point_as_the_camera_sees_them(size: tuple[float, float]) -> None:
    """In inches on the paper, whatever the picture's shape."""
    figure = Figure(figsize=size)
    axes, camera = figure.add_subplot(), Camera(-60.0, 25.0)
    compass(axes, camera, (0.3, 0.3))
    drawn = [np.diff(line.get_transform().transform(line.get_xydata()), axis=0)[0] for line in axes.lines]
    assert np.array(drawn) == pytest.approx(COMPASS * figure.dpi * camera.project(np.eye(3)), rel=1e-9)


@pytest.mark.parametrize("eye", [("nan", "0"), ("0", "inf")])
def test_an_eye_that_is_nowhere_is_refused(run: Path, capfd, eye: tuple[str, str]) -> None:
    assert call("view", run, "--png", "--eye", *eye) == 2
    told = capfd.readouterr().err
    assert "--eye" in told and told.count("fix:") == 1


def test_an_animation_has_a_frame_for_each_phase(run: Path) -> None:
    assert call("view", run, "--gif", "--phases", 6, "--sectors", "0", "1", "--out", run / "two.gif") == 0
    with Image.open(run / "two.gif") as image:
        assert image.n_frames == 6 and image.info["loop"] == 0
        frames = []
        for number in range(6):
            image.seek(number)
            frames.append(np.asarray(image.convert("RGB"), dtype=int))
    assert all(np.abs(one - other).max() > 50 for one, other in zip(frames, frames[1:]))


def test_a_series_is_the_skin_of_the_vtkhdf_file(run: Path) -> None:
    assert call("view", run, "--pvd", "--phases", PHASES) == 0
    assert call("view", run, "--phases", PHASES) == 0
    inner = read_step(run / "mode.vtkhdf", 3)
    found, n_points, n_cells = read_vtu(run / "mode_steps" / "0003.vtu")
    assert not (run / "mode_steps" / "0012.vtu").exists() and n_points <= len(inner["points"])
    assert set(found["types"].tolist()) == {7} and n_cells % SECTORS == 0
    moved = inner["displacement"] - inner["rest_displacement"]
    places = {tuple(np.round(x, 5)): k for k, x in enumerate(inner["points"])}
    for k in range(0, n_points, 7):
        there = places[tuple(np.round(found["Points"][k].astype(float), 5))]
        assert found["motion"][k] == pytest.approx(moved[there], rel=1e-5, abs=1e-6 * np.abs(moved).max())
    contact, n_pairs, _ = read_vtu(run / "mode_contact_steps" / "0003.vtu")
    expected = read_step(run / "mode_contact.vtkhdf", 3)
    assert n_pairs == 3 * SECTORS
    np.testing.assert_allclose(contact["normal_force"], expected["normal_force"], rtol=SINGLE)
    assert [path.name for path in run.glob("tmp*")] == []


def test_traction_is_the_pairs_force_over_their_area(run: Path) -> None:
    """In space and of every sector: its part along the normal is the pressure, the other friction."""
    assert call("view", run, "--phases", PHASES) == 0
    areas = build().pairs["pads"].areas
    with h5py.File(run / "mode_contact.vtkhdf") as file:
        names = set(file["VTKHDF/PointData"])
    if areas is None:
        assert not {"pressure", "traction"} & names
        return
    for step in (0, 5):
        found = read_step(run / "mode_contact.vtkhdf", step)
        area = np.tile(areas, SECTORS)
        np.testing.assert_allclose(found["pressure"], found["normal_force"] / area)
        along = np.einsum("px,px->p", found["traction"], found["normal"])
        np.testing.assert_allclose(along, found["pressure"], rtol=1e-9)
        across = found["traction"] - along[:, None] * found["normal"]
        np.testing.assert_allclose(np.linalg.norm(across, axis=1), found["tangential_force"] / area, rtol=1e-9)
        assert found["tangential_force"].max() > 0


def test_traction_turns_with_its_sector_and_comes_later(run: Path) -> None:
    """From one sector to the next by a sixth of a turn, and by 2 / 6 of a period: 4 of 12 steps."""
    assert call("view", run, "--phases", PHASES) == 0
    first, second = (
        read_step(run / "mode_contact.vtkhdf", step)["traction"].reshape(SECTORS, -1, 3) for step in (3, 3 + 4)
    )
    np.testing.assert_allclose(
        second[1], first[0] @ rotation(2 * np.pi / SECTORS, "z").T, atol=1e-6 * np.abs(first).max()
    )
    assert np.abs(first[0, :, :2]).max() > 1e-3 * np.abs(first).max()


def test_nodes_without_cells_are_no_picture(tmp_path: Path, capfd) -> None:
    shutil.copy(CHAIN_BUILDER, tmp_path / "model.py")
    mode = '[[analysis]]\nname = "mode"\ntype = "mode"\nharmonics = 1\nnormalise = "tip"\namplitude = [2e-7, 4e-7]\n'
    (tmp_path / "case.toml").write_text(CHAIN + mode)
    assert call("run", tmp_path / "case.toml", "--out", tmp_path / "run", "--no-plots") == 0
    capfd.readouterr()
    assert call("view", tmp_path / "run", "--png") == 2
    said = capfd.readouterr().err
    assert "no faces to draw" in said and "fix: " in said
    assert call("view", tmp_path / "run", "--pvd") == 0
