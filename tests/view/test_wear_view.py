"""``fretwave view`` of wear: the file read as VTKHDF's specification says holds the results at every wear cycle."""

from __future__ import annotations

import shutil

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from command_line import call
from models.wear_case import write_case
from test_series import SINGLE, read_vtu
from test_view import read_step
from tolerances import LAST_BIT, LAST_DIGITS, SOLVED

import fretwave as fw
from fretwave.post.contact_history import OPEN, SLIP
from fretwave.view.contact_faces import surface
from fretwave.view.vtkhdf import TRIANGLE, VERTEX

pytestmark = pytest.mark.ranks(1)

AREA = 2e-4


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    base = tmp_path_factory.mktemp("wear")
    assert call("run", write_case(base), "--only", "wear", "--out", base / "run", "--no-plots") == 0
    return base / "run"


def line_of(run, number):
    """Rows of a line in the results."""
    with h5py.File(run / "results.h5") as file:
        group = file["wear"]
        rows = np.flatnonzero(group["points/line"][()] == number)
        fields = {key: group[f"{key}_pads"][()][rows] for key in ("depth", "rate", "load", "slip", "open")}
        return {key: data[()][rows] for key, data in group["points"].items() if key != "event"}, fields


def test_steps_are_the_points_of_the_largest_amplitude(run, capfd):
    assert call("view", run, "--analysis", "wear", "--scale", "1000") == 0
    path = run / "wear_wear.vtkhdf"
    table, fields = line_of(run, 2)
    said, (first, *_, last) = capfd.readouterr().out, table["point"].astype(int)
    assert f"amplitude 3e-06 m, {len(table['cycles'])} steps to 8 wear cycles" in said
    assert f"with its pairs at the points {first}, " in said and f", {last}\n" in said
    with h5py.File(path) as file:
        assert file["VTKHDF/Steps/Values"][()].tolist() == table["cycles"].tolist()
        assert file["VTKHDF/Steps"].attrs["NSteps"] == len(table["cycles"]) > 5
    for step in range(len(table["cycles"])):
        found = read_step(path, step)
        assert found["points"].tolist() == [[0, 0, 0], [0.1, 0, 0]] and found["types"].tolist() == [VERTEX, VERTEX]
        assert found["depth"].tolist() == fields["depth"][step].tolist()
        assert found["wear_rate"].tolist() == fields["rate"][step].tolist()
        assert found["mean_pressure"] == pytest.approx(fields["load"][step] / AREA, rel=LAST_BIT)
        assert found["slip_share"].tolist() == fields["slip"][step].tolist()
        assert found["open_share"].tolist() == fields["open"][step].tolist()
        assert found["warp"] == pytest.approx(-1000 * np.outer(fields["depth"][step], [1, 0, 0]), rel=1e-6)
        for name in ("cycles", "zeta", "frequency_hz"):
            assert found[name] == table[name][step]


def test_shares_of_slip_are_the_table_s(run):
    """The mean over the pairs, all of one contact, is what the law itself counted."""
    table, fields = line_of(run, 2)
    assert fields["slip"].mean(axis=1) == pytest.approx(table["slip"], abs=LAST_DIGITS) and table["slip"].min() > 0.1


def test_a_picture_of_wear_is_refused_before_anything_is_written(run, tmp_path, capfd):
    assert call("view", run, "--analysis", "wear", "--png", "--out", tmp_path / "worn.png") == 2
    told = capfd.readouterr()
    assert "this is no motion to draw" in told.err and not told.out
    assert not list(tmp_path.iterdir())


def test_amplitudes_asked_for_are_files_of_their_own(run, tmp_path, capfd):
    out = tmp_path / "some.vtkhdf"
    assert call("view", run, "--analysis", "wear", "--amplitude", "2e-6", "2.9e-6", "--out", out) == 0
    for number, amplitude in ((1, 2e-6), (2, 3e-6)):
        assert read_step(tmp_path / f"some_{number}.vtkhdf", 1)["amplitude"] == pytest.approx(amplitude)
    assert call("view", run, "--analysis", "wear", "--amplitude", "9e-6") == 2
    error = capfd.readouterr().err
    assert "no wear at this amplitude" in error and "fix:      --amplitude 3e-06" in error


def test_cycles_as_a_series_for_paraview_before_5_12(run, tmp_path, capfd):
    table, fields = line_of(run, 2)
    assert call("view", run, "--analysis", "wear", "--pvd", "--out", tmp_path / "worn.pvd") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["worn.pvd", "worn_steps"]
    steps = sorted((tmp_path / "worn_steps").iterdir())
    assert len(steps) == len(table["cycles"])
    found, _, _ = read_vtu(steps[-1])
    assert found["depth"] == pytest.approx(fields["depth"][-1], rel=SINGLE)
    assert found["cycles"] == table["cycles"][-1]
    assert call("view", run, "--analysis", "wear", "--png", "--out", tmp_path / "worn.png") == 2
    assert "fix:      --point N" in capfd.readouterr().err


def test_the_motion_of_a_worn_point_is_shown_with_the_law_s_word_on_it(run, tmp_path):
    """The kept forces are the law's with the approach less the depth; status and gap are shown as they are kept."""
    table, fields = line_of(run, 2)
    point, depth = int(table["point"][-1]), fields["depth"][-1]
    with h5py.File(run / "results.h5") as file:
        u, f = (file[f"wear/contact_pads/{key}"][-1][:, 0] for key in "uf")
        status, shares = (file[f"wear/contact_pads/{key}"][-1] for key in ("status", "shares"))
    assert f == pytest.approx(np.maximum(np.array([1e7, 2e7]) * (u - depth), 0.0), rel=SOLVED, abs=SOLVED)
    assert depth.max() > 1e-6 and shares[SLIP].tolist() == fields["slip"][-1].tolist()
    assert np.mean(status == SLIP, axis=0) == pytest.approx(shares[SLIP], abs=2 / len(status))  # begins and ends once
    shutil.copytree(run, tmp_path / "run")
    with h5py.File(tmp_path / "run" / "results.h5", "r+") as file:
        file["wear/contact_pads/gap"][-1] = depth
        file["wear/contact_pads/status"][-1] = OPEN
    out = tmp_path / "motion.vtkhdf"
    assert call("view", tmp_path / "run", "--analysis", "wear", "--point", point, "--phases", "8", "--out", out) == 0
    assert read_step(out, 0)["cycles"] == pytest.approx(8.0)
    found = read_step(tmp_path / "motion_contact.vtkhdf", 3)
    assert found["gap"].tolist() == depth.tolist() and found["status"].tolist() == [OPEN, OPEN]


def contact(positions, faces):
    n = len(positions)
    return fw.Pairs(sp.csr_matrix((3 * n, 3 * n)), faces=faces, positions=np.array(positions, dtype=float))


def test_faces_become_surfaces_without_bridges():
    """Two grids of 6 x 4 pairs, the second with a gap: the triangles fill the cells between pairs, but not the gap."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(6) * 8.0, np.arange(4) * 2.0, indexing="ij"))
    grid = np.column_stack([x, y])
    far = grid + np.where(x[:, None] > 20, [100.0, 0.0], 0.0)
    cells, kind = surface(contact(np.vstack([grid, far]), ["left"] * 24 + ["right"] * 24))
    places = np.vstack([grid, far])[cells]
    sides = places[:, 1:] - places[:, :1]
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    left = (cells < 24).all(axis=1)
    assert kind == TRIANGLE and ((cells >= 24).all(axis=1) | left).all()
    assert area[left].sum() == pytest.approx(40.0 * 6.0) and area[~left].sum() == pytest.approx(2 * 16.0 * 6.0)


@pytest.mark.parametrize("positions", [[[0, 0], [1, 0]], [[0, 0], [1, 0], [2, 0], [3, 0]]])
def test_pairs_in_a_line_stay_points(positions):
    cells, kind = surface(contact(positions, ["one"] * len(positions)))
    assert kind == VERTEX and cells.ravel().tolist() == list(range(len(positions)))
