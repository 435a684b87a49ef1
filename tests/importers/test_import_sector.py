"""A sector of a wheel from an FE code: its waves are the whole wheel's modes, and contradictions are refused."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from models.meshed_wheel import PAIRS, SECTORS, STIFFNESS, Wheel, imported, sector_of
from tolerances import LAST_BIT, TIGHT

import fretwave as fw
from fretwave.commands.main import main
from fretwave.importers.nodes import Nodes
from fretwave.importers.pairs import match
from fretwave.model.contact import in_limit
from fretwave.model.sectors import rotation
from fretwave.mpi.guard import on_first_rank
from fretwave.results import model_file

DATA = Path(__file__).parents[1] / "data" / "calculix"
PARAMETERS = {"normal_stiffness": STIFFNESS, "tangential_stiffness": STIFFNESS, "friction_coefficient": 0.3}


def waves_hz(structure: fw.Structure, diameter: int, count: int, limit: str, comm, stiffness=STIFFNESS) -> np.ndarray:
    """Of the tied sector in a limit of its contact."""
    tied = structure.tied()
    given = {**PARAMETERS, "normal_stiffness": stiffness, "tangential_stiffness": stiffness, "normal_load": 1.0}
    contacts = [fw.Contact("coulomb_3d", pairs, given, name) for name, pairs in tied.pairs.items()]
    with tied.model(in_limit(contacts, limit), comm, diameter) as model:
        return np.array([mode.frequency_hz for mode in fw.linear_modes(model, count)])


def all_waves(structure: fw.Structure, limit: str, comm) -> np.ndarray:
    """Of all sectors, in ascending order."""
    count = structure.n_dof - len(structure.high)
    return np.sort(np.concatenate([waves_hz(structure, d, count, limit, comm) for d in range(SECTORS)]))


@pytest.mark.parametrize(("axis", "offset"), [("z", 0.0), ("z", 0.37), ("x", -1.6), ("y", 2.9)])
def test_waves_are_the_modes_of_the_whole_wheel(comm, shared_tmp: Path, axis: str, offset: float) -> None:
    """Wherever the wheel is cut, about whatever axis: assembled in one frame it has the same frequencies."""
    structure = imported(comm, shared_tmp, Wheel(offset), *sector_of(axis), axis=axis)
    np.testing.assert_allclose(all_waves(structure, "free", comm), Wheel().hz(), rtol=TIGHT)


@pytest.mark.parametrize(("axis", "offset"), [("z", 0.0), ("y", 0.37)])
@pytest.mark.parametrize("limit", ["stuck", "sliding"])
def test_pairs_reach_the_next_sector(comm, shared_tmp: Path, limit: str, axis: str, offset: float) -> None:
    """Springs between the shrouds of the whole wheel; the normal is found along the circumference."""
    structure = imported(comm, shared_tmp, Wheel(offset), *sector_of(axis), *PAIRS, axis=axis)
    np.testing.assert_allclose(all_waves(structure, limit, comm), Wheel().hz(limit), rtol=TIGHT)


def test_the_wheel_of_an_imported_sector(comm, shared_tmp: Path) -> None:
    """All sectors at once."""
    tied = imported(comm, shared_tmp, Wheel(), *sector_of(), *PAIRS).tied().around()
    contact = fw.Contact("coulomb_3d", tied.pairs["shroud"], {**PARAMETERS, "normal_load": 1.0})
    with tied.model([contact], comm) as model:
        found = [mode.frequency_hz for mode in fw.linear_modes(model, 12)]
    np.testing.assert_allclose(found, Wheel().hz("stuck")[:12], rtol=TIGHT)


@pytest.mark.ranks(1)
def test_what_a_model_file_says_of_a_sector(comm, shared_tmp: Path) -> None:
    wheel = Wheel(0.2)
    found = imported(comm, shared_tmp, wheel, *sector_of(), *PAIRS)
    with h5py.File(shared_tmp / "m.h5") as file:
        assert file.attrs["format_version"] == 2
        assert dict(file["sector"].attrs) == {"sectors": SECTORS, "axis": "z"}
    again = shared_tmp / "again.h5"
    model_file.write_model(again, found)
    for one in (found, model_file.read_model(again)):
        assert (one.sectors, one.axis) == (SECTORS, "z")
        nodes = {name: one.labels[face].reshape(-1, 3, 2) for name, face in (("low", one.low), ("high", one.high))}
        assert (nodes["low"][:, :, 1] == [1, 2, 3]).all() and (nodes["high"][:, :, 1] == [1, 2, 3]).all()
        partner = dict(zip(wheel.face("rim", "low") + 1, wheel.face("rim", "high") + 1))
        assert all(partner[a] == b for a, b in zip(nodes["low"][:, 0, 0], nodes["high"][:, 0, 0]))
        assert len(one.low) == 3 * 2  # the bore's nodes are held
        shroud = one.pairs["shroud"]
        assert sorted(shroud.B) == [0, 1]
        for k in (0, 1):
            assert (shroud.B[k] != found.pairs["shroud"].B[k]).nnz == 0
        ends = dict(zip(wheel.face("shroud", "high") + 1, wheel.face("shroud", "low") + 1))
        assert all(ends[a] == b for a, b in shroud.nodes)


@pytest.mark.ranks(1)
def test_a_rigid_turn_of_the_wheel_moves_no_pair(comm, shared_tmp: Path) -> None:
    """About its axis all sectors move alike in their frames; along another axis they do not."""
    shroud = (found := imported(comm, shared_tmp, Wheel(0.2), *sector_of(), *PAIRS)).pairs["shroud"]
    places = found.coordinates[found.labels[::3, 0] - 1]
    turned, lifted = np.cross([0, 0, 1.0], places).ravel(), np.tile([0, 0, 1.0], len(places))
    both = sp.csr_matrix(shroud.B[0] + shroud.B[1])
    assert abs(both @ turned).max() < 1e-15 and abs(both @ lifted).max() < 1e-15
    assert abs(both @ np.tile([1.0, 0, 0], len(places))).max() > 0.5


@pytest.mark.ranks(1)
def test_an_axis_beside_the_origin(comm, shared_tmp: Path) -> None:
    """Coordinates are kept from the point that is given."""
    wheel = Wheel()
    straight = imported(comm, shared_tmp, wheel, *sector_of())
    with np.load(shared_tmp / "nodes.npz") as archive:
        moved = {**archive, "coordinates": archive["coordinates"] + [0.5, -2.0, 0.1]}
    np.savez(shared_tmp / "nodes.npz", **moved)
    words = ["--mass", "M.npz", "--stiffness", "K.npz", "--dofs", "dofs.csv", "--coordinates", "nodes.npz"]
    command = ["import", str(shared_tmp / "n.h5"), *(str(shared_tmp / w) if "." in w else w for w in words)]
    assert main([*command, *sector_of()]) == 2
    assert main([*command, *sector_of(), "--origin", "0.5,-2,0.1"]) == 0
    found = model_file.read_model(shared_tmp / "n.h5")
    np.testing.assert_allclose(found.coordinates, straight.coordinates, atol=1e-15)
    np.testing.assert_array_equal(found.low, straight.low)


#: Of CalculiX 2.20, *CYCLIC SYMMETRY MODEL, N=24 on the deck of sector.inp [Hz], by nodal diameter, seven digits.
#: Free: *TIE, CYCLIC SYMMETRY of HIGH to LOW without the held nodes; tied: of SHHIGH to SHLOW as well.
#: Stuck: SPRING2 of 1e5 N/mm along x, y, z between SHHIGH and further nodes in the same places, tied to SHLOW;
#: sliding: along the circumference alone (*ORIENTATION).
CALCULIX_HZ = {
    "free": {
        0: [3738.454, 3747.81, 5958.979, 14186.9],
        3: [3716.435, 3799.758, 5957.176, 14157.34],
        6: [3817.642, 3836.193, 5958.409, 14220.67],
        12: [3830.723, 4224.923, 5972.745, 14332.39],
    },
    "sliding": {
        0: [3738.454, 3763.354, 5958.979, 15261.77],
        3: [3716.5, 7650.843, 7772.103, 15291.91],
        6: [3824.406, 11020.79, 12852.07, 16054.64],
        12: [4224.923, 14332.39, 15553.65, 20254.45],
    },
    "stuck": {
        0: [3763.354, 4689.964, 15261.77, 20477.69],
        3: [3840.038, 8448.759, 15465.26, 20555.69],
        6: [5337.193, 14073.43, 16565.48, 21927.49],
        12: [13127.27, 15553.65, 18847.41, 20254.45],
    },
    "tied": {
        0: [3769.839, 4748.009, 16021.53, 20514.87],
        3: [3862.902, 10682.99, 16504.84, 20594.27],
        6: [5767.113, 16307.07, 20801.08, 22072.14],
        12: [14747.0, 19031.25, 19181.04, 28590.26],
    },
}


@pytest.mark.parametrize("limit", CALCULIX_HZ)
def test_waves_of_calculix(comm, shared_tmp: Path, limit: str) -> None:
    """To its seven digits."""
    deck = shared_tmp / "sector.inp"
    for suffix in (".inp", ".sti", ".mas", ".dof"):
        on_first_rank(comm, lambda s=suffix: deck.with_suffix(s).write_bytes((DATA / f"sector{s}").read_bytes()))
    tied = limit == "tied"
    faces = sector_of(sectors="24", low="TIELOW" if tied else "LOW", high="TIEHIGH" if tied else "HIGH")
    pairs = [] if tied else ["--pairs", "shroud=SHHIGH", "SHLOW@next"]
    assert main(["import", str(deck), *faces, *pairs, "--units", "mm-t-s"]) == 0
    structure = on_first_rank(comm, lambda: model_file.read_model(deck.with_suffix(".h5")))
    for diameter, expected in CALCULIX_HZ[limit].items():
        found = waves_hz(structure, diameter, 4, "free" if tied else limit, comm, 1e5)
        np.testing.assert_allclose(found, expected, rtol=5e-7)


@pytest.mark.ranks(1)
def test_normals_and_areas_of_elements(tmp_path: Path) -> None:
    """The shroud's end of 24 x 6 mm, half a sector from its middle, looks at the next sector."""
    deck = tmp_path / "sector.inp"
    for suffix in (".inp", ".sti", ".mas", ".dof"):
        deck.with_suffix(suffix).write_bytes((DATA / f"sector{suffix}").read_bytes())
    faces = sector_of(sectors="24", low="LOW", high="HIGH")
    assert main(["import", str(deck), *faces, "--pairs", "shroud=SHHIGH", "SHLOW@next", "--units", "mm-t-s"]) == 0
    shroud = model_file.read_model(deck.with_suffix(".h5")).pairs["shroud"]
    angle = np.radians(7.5)
    np.testing.assert_allclose(shroud.frames[:, 0], [[-np.sin(angle), np.cos(angle), 0]] * 4, atol=1e-10)
    np.testing.assert_allclose(shroud.areas, 36, rtol=1e-10)


@pytest.mark.ranks(1)
def test_the_report_of_a_sector(comm, shared_tmp: Path, capfd) -> None:
    structure = imported(comm, shared_tmp, Wheel(), *sector_of(), *PAIRS)
    text = capfd.readouterr().out
    first = waves_hz(structure, 0, 1, "free", comm)[0]
    assert f"sector: one of {SECTORS} about z, 2 free nodes on each face, RIMLOW and RIMHIGH" in text
    assert "contact 'shroud': its normal is along the circumference" in text
    assert f"0 nodal diameters, no contact [1/time]: {first:.6g}, " in text


WRONG = {
    "swapped": (sector_of(low="RIMHIGH", high="RIMLOW"), "swap low and high\n"),
    "number": (sector_of(sectors="6"), "give 5 sectors\n"),
    "axis": (sector_of("x"), "give the axis z\n"),
    "all": (sector_of("x", sectors="6", low="RIMHIGH", high="RIMLOW"), "and give 5 sectors and give the axis z\n"),
    "other": (sector_of(high="SHROUDHIGH"), "mesh both faces alike"),
    "same": (sector_of(high="RIMLOW"), "of them on both"),
    "name": (sector_of(high="RIMHIHG"), "did you mean `RIMHIGH`?"),
    "part": (sector_of(high=""), "add --high\n"),
    "one": (sector_of(sectors="1"), "two sectors or more"),
    "pairs": ([*sector_of(), "--pairs", "s=SHROUDLOW", "SHROUDHIGH@next"], "write SHROUDHIGH SHROUDLOW@next"),
    "here": ([*sector_of(), "--pairs", "s=SHROUDHIGH", "SHROUDLOW"], "write SHROUDHIGH SHROUDLOW@next"),
    "back": ([*sector_of(), "--pairs", "s=SHROUDLOW", "SHROUDHIGH"], "write SHROUDHIGH SHROUDLOW@next"),
    "tied": ([*sector_of(low="WHOLELOW", high="WHOLEHIGH"), *PAIRS], "leave them out of WHOLELOW and WHOLEHIGH"),
    "alone": (PAIRS, "there is no next sector"),
    "origin": ([*sector_of(), "--origin", "1,0"], "no three numbers"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("wrong", WRONG)
def test_what_contradicts_the_mesh(wrong: str, tmp_path: Path, capfd) -> None:
    options, said = WRONG[wrong]
    assert main([*Wheel().write(tmp_path), *options]) == 2
    text = capfd.readouterr().err
    assert said in text and text.count("fix:") == 1
    assert not (tmp_path / "m.h5").exists()


@pytest.mark.ranks(1)
def test_a_node_that_lies_apart(tmp_path: Path, capfd) -> None:
    """Named with its number and place."""
    wheel = Wheel()
    node = wheel.face("rim", "high")[1]
    wheel.sector.nodes[node] += [0, 0, 1e-4]
    assert main([*wheel.write(tmp_path), *sector_of()]) == 2
    text = capfd.readouterr().err
    assert f"high face: {node + 1} (" in text and "1 of 4 low and 1 of 4 high nodes" in text and "0.0001 away" in text
    assert main([*wheel.write(tmp_path), *sector_of(), "--tolerance", "2e-4"]) == 0


@pytest.mark.ranks(1)
@pytest.mark.parametrize("held", ["node", "direction"])
def test_faces_held_unlike(tmp_path: Path, capfd, held: str) -> None:
    """A node free on one face alone, and one that keeps two of its directions."""
    wheel = Wheel()
    command = wheel.write(tmp_path)
    faces = [wheel.face("rim", side) + 1 for side in ("low", "high")]
    node, partner = next((a, b) for a, b in zip(*faces) if a - 1 in wheel.free)
    dropped = {(node, d) for d in (1, 2, 3)} if held == "node" else {(node, 2), (partner, 2)}
    lines = (tmp_path / "dofs.csv").read_text().split()
    kept = [k for k, line in enumerate(lines) if tuple(map(int, line.split(","))) not in dropped]
    (tmp_path / "dofs.csv").write_text("".join(lines[k] + "\n" for k in kept))
    for letter in "MK":
        A = sp.load_npz(tmp_path / f"{letter}.npz").tocsr()
        sp.save_npz(tmp_path / f"{letter}.npz", A[kept][:, kept])
    assert main([*command, *sector_of()]) == 2
    text = capfd.readouterr().err
    said = {"node": f"n{partner}x is free, its partner is held", "direction": f"n{node}x, n{node}z"}
    assert said[held] in text


@pytest.mark.ranks(1)
def test_a_slanted_shroud_says_its_normal(tmp_path: Path, capfd) -> None:
    wheel = Wheel()
    for side in ("low", "high"):  # the ends lean by an angle over their height
        end = wheel.face("shroud", side)
        x, y, z = wheel.sector.nodes[end].T
        wheel.sector.nodes[end] = np.column_stack([x - 0.3 * y * z / 0.03, y + 0.3 * x * z / 0.03, z])
    command = wheel.write(tmp_path)
    assert main([*command, *sector_of(), *PAIRS]) == 2
    assert "give --normal" in capfd.readouterr().err
    assert main([*command, *sector_of(), *PAIRS, "--normal=-0.6,0.7,-0.2"]) == 0


@pytest.mark.ranks(1)
@pytest.mark.parametrize("ends", [(1, 2), (2, 1)])
def test_one_of_two_sectors(ends: tuple[int, int]) -> None:
    """The next sector is the one before: both ends reach it, and a rigid turn moves no pair."""
    points = np.array([[0.0, -2, 0.5], [0.0, 2, 0.5]])
    nodes = Nodes(np.array([1, 2]), points, "two", {"LOW": np.array([ends[0]]), "HIGH": np.array([ends[1]])})
    labels = np.column_stack([np.repeat([1, 2], 3), np.tile([1, 2, 3], 2)])
    turn = rotation(np.pi, "z")
    pairs = match("shroud", nodes, "HIGH", "LOW@next", np.array([1.0, 0, 0]), labels, turn=turn)
    motion = np.cross([0, 0, 1.0], points).ravel()
    assert abs(pairs.B[0] @ motion).max() == 2
    np.testing.assert_allclose(pairs.B[0] @ motion + pairs.B[1] @ motion, 0, atol=LAST_BIT)


@pytest.mark.ranks(1)
def test_a_deck_without_its_matrices(tmp_path: Path, capfd) -> None:
    (tmp_path / "sector.inp").write_bytes((DATA / "sector.inp").read_bytes())
    assert main(["import", str(tmp_path / "sector.inp")]) == 2
    assert "SOLVER=MATRIXSTORAGE into its step and run `ccx sector`" in capfd.readouterr().err
    assert main(["import", str(tmp_path / "m.h5"), "--stiffness", "K.npz"]) == 2
    assert "add --mass FILE" in capfd.readouterr().err
