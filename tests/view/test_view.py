"""``fretwave view`` of a structure: the physics of what is in the files, and what is refused."""

from __future__ import annotations

import csv
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.chain_case import BUILDER, CHAIN, FORCED
from models.vtkhdf_files import read_step
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING, SOLVED

from fretwave.case.load import load_case
from fretwave.model.cells import KINDS
from fretwave.post.contact_history import OPEN, SLIP, STICK
from fretwave.view.vtkhdf import HEXAHEDRON

pytestmark = pytest.mark.ranks(1)

TEXT = (
    CHAIN
    + """
[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 128
normalise = "tip"
amplitude = [2e-7, 2.2e-6]
report_at = [1e-6, 2e-6]

[[analysis]]
name = "periodic"
type = "mode"
method = "EPMC"
harmonics = 3
samples = 128
normalise = "tip"
amplitude = [2e-7, 2.2e-6]
report_at = [1e-6, 2e-6]
"""
    + FORCED
)
METHODS = ["mode", "periodic"]
#: Newton's rest, relative to the largest force of the fundamental.
BALANCE = 1e-7


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("view")
    shutil.copy(BUILDER, folder / "model.py")
    (folder / "case.toml").write_text(TEXT)
    assert call("run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots") == 0
    return folder / "run"


@pytest.fixture(scope="module", params=METHODS)
def viewed(request, run: Path) -> tuple[str, Path, Path, dict[str, float]]:
    """Name of the analysis, grid and pairs at its largest amplitude, and that row of the table."""
    assert call("view", str(run), "--analysis", request.param, "--phases", "16") == 0
    with (run / f"{request.param}.csv").open() as file:
        rows = [{key: value for key, value in row.items() if key != "event"} for row in csv.DictReader(file)]
    row = max(({key: float(value) for key, value in row.items()} for row in rows), key=lambda row: row["amplitude"])
    return request.param, run / f"{request.param}.vtkhdf", run / f"{request.param}_contact.vtkhdf", row


def amplitudes(found: dict[str, np.ndarray]) -> dict[int, np.ndarray]:
    """q_n = Qc_n - i Qs_n on all dofs."""
    waves = {n: found[f"harmonic_{n}_real"] + 1j * found[f"harmonic_{n}_imag"] for n in (1, 2, 3)}
    return {n: q.ravel() for n, q in {0: found["harmonic_0"], **waves}.items()}


def test_displacement_is_the_sum_of_harmonics(run: Path, viewed) -> None:
    name, grid, _, row = viewed
    with h5py.File(run / "results.h5") as file:
        group = file[name]
        labels, tip = [text.decode() for text in group["harmonic"][()]], list(group["dof"][()]).index(b"tip")
        Q = group["coefficients"][int(row["point"])][tip]
    for step in range(16):
        found, phase = read_step(grid, step), 2 * np.pi * step / 16
        sums = [(np.sin if text[-1] == "s" else np.cos)(int(text.rstrip("cs")) * phase) for text in labels]
        assert found["phase"] == pytest.approx(phase, rel=LAST_BIT) and found["amplitude"] == row["amplitude"]
        assert found["displacement"][-1, 1] == pytest.approx(Q @ sums, rel=ROUNDING)
    first = read_step(grid, 0)["displacement"][-1, 1]
    assert first == pytest.approx(sum(q for q, text in zip(Q, labels) if text[-1] != "s"), rel=ROUNDING)


def test_expanded_motion_solves_the_unreduced_equations(run: Path, viewed) -> None:
    """(K + s C + s^2 M) q_n = 0 on the dofs without contact, s = n (-beta + i omega), or n i omega0 with EPMC's C."""
    name, grid, _, row = viewed
    case = load_case(run.parent / "case.toml")
    C, s = case.damping_with(()), -row["beta"] + 1j * row["omega"]
    if name == "periodic":
        C, s = C - 2 * row["zeta"] * row["omega0"] * case.M, 1j * row["omega0"]
    found = amplitudes(read_step(grid, 0))
    largest = np.abs(case.K @ found[1]).max()
    for n, q in found.items():
        load = case.loads["weight"] if n == 0 else 0.0
        rest = (case.K + n * s * C + (n * s) ** 2 * case.M) @ q - load
        assert np.abs(rest[3:-3]).max() <= BALANCE * largest


def test_warp_enlarges_the_motion_from_rest(viewed) -> None:
    """The automatic scale draws the largest displacement as about a tenth of the model's size, here 5 m."""
    _, grid, pairs, _ = viewed
    found = [read_step(grid, step) for step in range(16)]
    rest = found[0]["rest_displacement"]
    assert np.abs(rest[:, 0]).min() > 0
    moved = np.array([one["displacement"] - rest for one in found])
    warp = np.array([one["warp"] for one in found])
    scale = np.vdot(warp, moved) / np.vdot(moved, moved)
    assert np.abs(warp - scale * moved).max() < 1e-6 * np.abs(warp).max()
    assert np.linalg.norm(warp, axis=2).max() == pytest.approx(0.5, rel=0.06)
    rounding = 1e-12 * np.abs(warp).max()  # of double precision; the field itself is single
    assert read_step(pairs, 3)["warp"][0] == pytest.approx(warp[3, 0], rel=np.finfo("f4").eps, abs=rounding)


def test_status_and_work_of_the_pairs(run: Path, viewed) -> None:
    """Shares are the table's. Work is what the harmonic equations leave: the imaginary part of q^H (...) q.

    W = pi sum n Im(q_n^H F_n) with F_n = - (K + s_n C + s_n^2 M) q_n.
    """
    name, grid, pairs, row = viewed
    found = read_step(pairs, 5)
    for word in ("stick", "slip", "open"):
        assert found[f"share_{word}"].mean() == pytest.approx(row[word], abs=LAST_DIGITS)
    assert row["slip"] > 0.05
    case = load_case(run.parent / "case.toml")
    C, s = case.damping_with(()), -row["beta"] + 1j * row["omega"]
    if name == "periodic":
        C, s = C - 2 * row["zeta"] * row["omega0"] * case.M, 1j * row["omega0"]
    work = 0.0
    for n, q in amplitudes(read_step(grid, 0)).items():
        work -= np.pi * n * np.imag(q.conj() @ ((n * s * C + (n * s) ** 2 * case.M) @ q))
    assert found["dissipated_work"].sum() == pytest.approx(work, rel=1e-6)
    assert found["dissipated_work"].min() > -1e-9 * work


def test_steps_show_the_samples(run: Path, viewed) -> None:
    """16 steps of 128 samples: each shows every eighth sample of the contacts, at the phase of that sample."""
    name, _, pairs, row = viewed
    with h5py.File(run / "results.h5") as file:
        at = file[name]["reported"][()].tolist().index(int(row["point"]))
        f = file[name]["contact_pads/f"][at]
    for step in (0, 3, 15):
        found = read_step(pairs, step)
        assert found["normal_force"].tolist() == f[8 * step, 0].tolist()
        assert found["tangential_force"] == pytest.approx(np.hypot(f[8 * step, 1], f[8 * step, 2]), rel=LAST_DIGITS)
        assert set(found["status"]) <= {STICK, SLIP, OPEN}


def test_points_follow_each_other_on_one_grid(run: Path, tmp_path: Path, capfd) -> None:
    out = tmp_path / "some.vtkhdf"
    arguments = ["--amplitude", "1.1e-6", "2e-6", "--phases", "8", "--scale", "100", "--out", str(out)]
    assert call("view", str(run), *arguments) == 0
    printed = capfd.readouterr().out
    assert "amplitude 1e-06 m" in printed and "nearest to 1.1e-06 m" in printed
    with h5py.File(out) as file:
        assert file["VTKHDF/Points"].shape == (6, 3) and file["VTKHDF/NumberOfPoints"][()].tolist() == [6]
        assert file["VTKHDF/Steps/Values"][()].tolist() == (np.arange(16) / 8).tolist()
    for step, amplitude in ((0, 1e-6), (7, 1e-6), (8, 2e-6), (15, 2e-6)):
        found = read_step(out, step)
        assert found["harmonic_1_real"][-1, 1] == pytest.approx(amplitude, rel=SOLVED)
        assert found["amplitude"] == pytest.approx(amplitude, rel=SOLVED)
        moved = found["displacement"] - found["rest_displacement"]
        assert found["warp"] == pytest.approx(100 * moved, rel=1e-6, abs=ROUNDING)


def test_every_solved_point_can_be_shown(run: Path, tmp_path: Path, capfd) -> None:
    """Without its contacts where their motion is not kept; a forced response at its peak."""
    out = tmp_path / "any.vtkhdf"
    assert call("view", str(run), "--out", str(out)) == 0
    assert out.with_name("any_contact.vtkhdf").exists()
    assert call("view", str(run), "--point", "1", "--out", str(out)) == 0
    assert "not kept at point 1" in capfd.readouterr().out
    assert read_step(out, 0)["point"] == 1 and not out.with_name("any_contact.vtkhdf").exists()
    assert call("view", str(run), "--analysis", "forced", "--out", str(out)) == 0
    with h5py.File(run / "results.h5") as file:
        amplitude = file["forced/points/amplitude"][()]
    peak, found = int(np.argmax(amplitude)), read_step(out, 5)
    assert 0 < peak < len(amplitude) - 1 and found["point"] == peak
    q = found["harmonic_1_real"] + 1j * found["harmonic_1_imag"]
    assert abs(q[-1, 1]) == pytest.approx(amplitude[peak], rel=SOLVED)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--point", "999"], "there is no such point"),
        (["--amplitude", "3e-6"], "does not reach"),
        (["--analysis", "modes"], "did you mean `mode`?"),
        (["--scale", "large"], "the scale is no number"),
        (["--phases", "0"], "no phases"),
        (["--out", "missing/motion.vtkhdf"], "cannot be written"),
    ],
)
def test_wrong_wishes_are_answered(run: Path, arguments: list[str], said: str, capfd) -> None:
    assert call("view", str(run), *arguments) == 2
    error = capfd.readouterr().err
    assert said in error and "fix:" in error
    if "--point" in arguments or "--amplitude" in arguments:
        with h5py.File(run / "results.h5") as file:
            assert all(f"{point} (" in error for point in file["mode/reported"])


def test_a_model_without_nodes_is_refused(tmp_path: Path, capfd) -> None:
    builder = BUILDER.read_text()
    place = builder.index("        coordinates=")
    (tmp_path / "model.py").write_text(builder[:place] + "    )\n")
    (tmp_path / "case.toml").write_text(TEXT)
    assert call("run", str(tmp_path / "case.toml"), "--only", "mode", "--out", str(tmp_path / "run"), "--no-plots") == 0
    assert call("view", str(tmp_path / "run")) == 2
    assert "it has no nodes" in capfd.readouterr().err


def test_another_model_is_not_expanded(run: Path, tmp_path: Path, monkeypatch, capfd) -> None:
    """What a builder reads beside its own text is not in the case: the reduction gives it away."""
    text = BUILDER.read_text().replace(
        "STIFFNESS, AREA = 4e6,", "import os\n\nSTIFFNESS, AREA = float(os.environ['K']),"
    )
    (tmp_path / "model.py").write_text(text)
    (tmp_path / "case.toml").write_text(TEXT)
    monkeypatch.setenv("K", "4e6")
    assert call("run", str(tmp_path / "case.toml"), "--only", "mode", "--out", str(tmp_path / "run"), "--no-plots") == 0
    assert call("view", str(tmp_path / "run")) == 0
    monkeypatch.setenv("K", "4.001e6")
    assert call("view", str(tmp_path / "run")) == 2
    assert "no longer that of the run" in capfd.readouterr().err


def test_the_case_as_it_was_run_is_shown(run: Path, tmp_path: Path, capfd) -> None:
    """A case edited after its run does not matter, a builder does."""
    shutil.copytree(run.parent, tmp_path / "all")
    folder = tmp_path / "all" / "run"
    record = (folder / "run.json").read_text().replace(str(run.parent), str(tmp_path / "all"))
    (folder / "run.json").write_text(record)
    (tmp_path / "all" / "case.toml").write_text(TEXT.replace("samples = 128", "samples = 64"))
    assert call("view", str(folder)) == 0
    (tmp_path / "all" / "model.py").write_text(BUILDER.read_text() + "\n")
    assert call("view", str(folder)) == 2
    assert "model.builder" in capfd.readouterr().err


IMPORTED = """
[model]
file = "block.h5"
[[contact]]
name = "pad"
law = "coulomb_3d"
normal_stiffness = 1e6
tangential_stiffness = 1e6
friction_coefficient = 0.3
normal_load = 10.0
[preload]
[[analysis]]
name = "mode"
type = "mode"
harmonics = 1
samples = 32
normalise = "tip"
amplitude = [1e-8, 2e-8]
"""


def shown(folder: Path, job: str) -> dict[str, np.ndarray]:
    """First step of the view of a deck's mode, its matrices in job.mas and job.sti."""
    files = [f"--mass={folder / job}.mas", f"--stiffness={folder / job}.sti", f"--coordinates={folder / job}.inp"]
    wishes = ["--pairs", "pad=END", "GROUND", "--normal=1,0,0", "--name", "tip=n12z", "--modes", "2"]
    assert call("import", str(folder / "block.h5"), *files, *wishes) == 0
    (folder / "case.toml").write_text(IMPORTED)
    assert call("run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots") == 0
    assert call("view", str(folder / "run"), "--phases", "4") == 0
    return read_step(folder / "run" / "mode.vtkhdf", 0)


def test_an_imported_model_brings_its_mesh(tmp_path: Path) -> None:
    """Two elements C3D8 of a deck whose held side has no dofs in the matrices: it stays at rest."""
    data = Path(__file__).parents[1] / "data" / "calculix"
    for name in ("block.mas", "block.sti", "block.dof"):
        shutil.copy(data / name, tmp_path / name)
    deck = (data / "block.inp").read_text()
    (tmp_path / "block.inp").write_text(deck + "*NSET, NSET=END\n9, 10, 11, 12\n")
    found = shown(tmp_path, "block")
    assert found["types"].tolist() == [HEXAHEDRON] * 2
    assert found["cells"][1].tolist() == [4, 8, 10, 6, 5, 9, 11, 7]
    assert found["points"][[0, 11]].tolist() == [[0.0, 0.0, 0.0], [0.04, 0.03, 0.01]]
    assert not found["displacement"][:4].any()
    assert found["displacement"][11, 2] == pytest.approx(2e-8, rel=1e-6)
    with h5py.File(tmp_path / "run" / "results.h5") as file:
        names = file["mode/dof"][()].tolist()
        Q = file["mode/coefficients"][-1]
        assert found["displacement"][9, 2] == pytest.approx(Q[names.index(b"n10z"), :2].sum(), rel=ROUNDING)


#: The first of the block's two boxes in six tetrahedra about its diagonal, the second in two wedges.
CUT = """*ELEMENT, TYPE=C3D4, ELSET=SOLID
1, 1, 5, 7, 8
2, 1, 7, 3, 8
3, 1, 3, 4, 8
4, 1, 4, 2, 8
5, 1, 2, 6, 8
6, 1, 6, 5, 8
*ELEMENT, TYPE=C3D6, ELSET=SOLID
7, 5, 9, 11, 6, 10, 12
8, 5, 11, 7, 6, 12, 8
"""


def test_tetrahedra_and_wedges_of_an_imported_model(tmp_path: Path) -> None:
    """A deck of both, its matrices by CalculiX: cells of two kinds in one grid, wedges in VTK's order."""
    deck = (Path(__file__).parents[1] / "data" / "calculix" / "block.inp").read_text()
    begin, end = deck.index("*ELEMENT"), deck.index("*NSET, NSET=HELD")
    (tmp_path / "cut.inp").write_text(deck[:begin] + CUT + "*NSET, NSET=END\n9, 10, 11, 12\n" + deck[end:])
    done = subprocess.run(["ccx", "cut"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    found = shown(tmp_path, "cut")
    tetrahedron, wedge = KINDS["tetrahedron"].vtk, KINDS["wedge"].vtk
    assert found["types"].tolist() == [tetrahedron] * 6 + [wedge] * 2
    assert found["cells"][0].tolist() == [0, 4, 6, 7] and found["cells"][6].tolist() == [5, 9, 11, 4, 8, 10]
