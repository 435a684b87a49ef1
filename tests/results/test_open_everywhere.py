"""A run's results where fretwave did not make them: by xarray, and on a machine without MPI and PETSc."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from h5py import h5ds
from models.chain_case import BUILDER, CHAIN, FORCED
from models.wear_case import write_case
from tolerances import ROUNDING

import fretwave as fw
from fretwave import _core
from fretwave.files.dimensions import put_array

pytestmark = pytest.mark.ranks(1)
CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
#: Every type of analysis, and what has results without being one.
TYPES = {"static", "mode", "forced", "flutter", "free_decay", "limit_cycle", "wear", "sweep"}
#: Added to the chain on two pads.
MORE = """
[[analysis]]
name = "static"
type = "static"
preload = { pair_loads = false, loads = ["weight"] }
factors = [0.5, 1.0]

[[analysis]]
name = "limits"
type = "sweep"
of = "mode"
over.contact.pads.friction_coefficient = [0.3, 0.5]
"""
#: Of a chain of five sectors, a mass on its spring and a Jenkins element to the next one, in a flow.
FLUTTER = """
[model]
dofs = ["mass", "next"]
M = [[1.0, 0.0], [0.0, 0.0]]
K = [[1.0, 0.0], [0.0, 0.0]]
sectors = 5
low = ["mass"]
high = ["next"]

[[contact]]
name = "between"
law = "jenkins"
pairs = [["mass", "next"]]
tangential_stiffness = 1.0
friction_limit = 1.0

[aerodynamics]
frequency = 0.27
dof = "mass"
influence = { 0 = [0.02, -0.06], 1 = [-0.1, 0.02] }

[[analysis]]
name = "flutter"
type = "flutter"
normalise = "mass"
harmonics = 1
samples = 64
amplitude = [0.2, 2.0]
"""
#: As where neither is installed.
BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("mpi4py", "petsc4py", "slepc4py") or name == "fretwave._core":
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Blocked())
from fretwave import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("everywhere") / "run"
    arguments = ["run", str(CASE), "--quick", "--no-plots", "--out", str(folder)]
    assert fw.main(arguments) == 0
    return folder


@pytest.fixture(scope="module")
def files(run, tmp_path_factory) -> list[Path]:
    """results.h5 of runs of every type of analysis, of a sweep from the command line, and of a study."""
    base = tmp_path_factory.mktemp("types")
    case = write_case(base)
    case.write_text(case.read_text() + MORE)
    (base / "flutter.toml").write_text(FLUTTER)
    calls = (
        ["run", case, "--only", "static,one,limits", "--no-plots", "--out", base / "chain"],
        ["run", base / "flutter.toml", "--no-plots", "--out", base / "flutter"],
        ["sweep", case, "--over", "contact.pads.friction_coefficient=0.3,0.5", "--only", "static", "--no-plots"],
        ["study", CASE, "--analysis", "mode", "--harmonics", "1,3", "--samples", "64", "--tolerance", "1e-8"],
    )
    for call in calls:
        out = [] if "--out" in call else ["--out", base / call[0]]
        repeats = ["--repeats", "1"] if call[0] == "study" else []
        assert fw.main([str(word) for word in (*call, *out, *repeats)]) == 0, call
    return sorted([run / "results.h5", *base.rglob("results.h5")])


@pytest.mark.parametrize("command", ["show", "plot", "report"])
def test_a_run_is_shown_without_mpi_and_petsc(run, command):
    done = blocked(command, run)
    assert done.returncode == 0, done.stderr
    if command == "show":
        assert "limit cycle at a = 0.1375" in done.stdout
    elif command == "plot":
        assert (run / "mode_backbone.png").exists()
    else:
        assert "regularisation_velocity 0.05 m/s" in (run / "report.html").read_text()  # the case could be read


def test_a_reduced_run_of_before_is_shown_without_mpi_and_petsc(tmp_path):
    """Its basis does not tell what the loads do beyond the component modes: a note says so, harmonics stay."""
    (tmp_path / "model.py").write_bytes(BUILDER.read_bytes())
    (tmp_path / "case.toml").write_text(CHAIN.replace("modes = 12", "modes = 2") + FORCED + "time_points = 0\n")
    assert fw.main(["run", str(tmp_path / "case.toml"), "--no-plots", "--out", str(tmp_path / "run")]) == 0
    words, said = ("probe", tmp_path / "run", "--node", 2, "--csv", "--at", "start"), []
    for old in (False, True):
        if old:
            with h5py.File(tmp_path / "run" / "reduction.h5", "a") as file:
                del file["load"], file["beyond"]
        said.append(blocked(*words))
        assert said[-1].returncode == 0, said[-1].stderr
        assert ("is that of the component modes alone" in said[-1].stderr) == old
    now, before = (one.stdout.splitlines()[1:] for one in said)
    assert now[0] != before[0] and now[1:] == before[1:]  # the mean alone
    shown = blocked("view", tmp_path / "run")
    assert shown.returncode == 0 and "the component modes alone" in shown.stdout


def blocked(*words) -> subprocess.CompletedProcess[str]:
    """The command where neither MPI, PETSc nor the core can be imported; with the core's kernels of OpenBLAS."""
    call = [sys.executable, "-c", BLOCKED, *map(str, words)]
    kernels = {"OPENBLAS_CORETYPE": _core.blas_kernels()} if _core.blas_kernels() else {}
    return subprocess.run(call, capture_output=True, text=True, timeout=300, env={**os.environ, **kernels})


def test_straight_lines_through_the_curve_of_a_branch_are_the_branch(run):
    """What a reader of plain CSV draws or interpolates, against the cubic; twice as far off by the points alone."""
    found = fw.open_run(run)
    for name in ("mode", "flutter", "forced"):
        analysis, table = found[name], found.table(f"{name}_curve")
        assert len(analysis) < len(table["place"]) < 5 * len(analysis)
        fine, quantity = analysis.curve(16), "amplitude" if name == "forced" else "zeta"
        levels = fine["level"] if name == "forced" else np.zeros(len(fine))
        for level in np.unique(levels):
            here = levels == level
            place, coarse = fine["place"][here], fine["place"][here] % 1 == 0
            for column in ("frequency_hz", quantity):
                values = fine[column][here]
                lines = np.interp(place, table["place"], table[column]) - values
                chords = np.interp(place, place[coarse], values[coarse]) - values
                assert np.abs(lines).max() <= (1 + ROUNDING) * 1e-3 * np.ptp(values)
                assert column == "frequency_hz" or np.abs(chords).max() > 2e-3 * np.ptp(values)


@pytest.mark.parametrize("reduced", [False, True])
def test_a_motion_is_viewed_without_mpi_and_petsc(tmp_path, reduced):
    """The same files, value by value; those of a reduced model as those of a reduction that is made again."""
    case, folder = write_case(tmp_path), tmp_path / "run"
    begin, end = CHAIN.index("[reduction]"), CHAIN.index("[preload]")
    if not reduced:
        case.write_text(case.read_text().replace(CHAIN[begin:end], ""))
    assert fw.main(["run", str(case), "--only", "mode,one", "--no-plots", "--out", str(folder)]) == 0
    views = {"without": blocked, "with": lambda *words: fw.main([str(word) for word in words])}
    for place, view in views.items():
        (tmp_path / place).mkdir()
        for name in ("mode", "one"):
            out = tmp_path / place / f"{name}.vtkhdf"
            done = view("view", folder, "--analysis", name, "--phases", "8", "--out", out)
            assert done == 0 if place == "with" else done.returncode == 0, done.stderr
        probed = view("probe", folder, "--node", "3", "--csv", "--out", tmp_path / f"{place}.csv")
        assert probed == 0 if place == "with" else probed.returncode == 0
        assert (folder / "reduction.h5").exists() == (reduced and place == "without")
        (folder / "reduction.h5").unlink(missing_ok=True)
    made = {place: sorted((tmp_path / place).iterdir()) for place in ("with", "without")}
    assert len(made["with"]) == 3 and [p.name for p in made["with"]] == [p.name for p in made["without"]]
    for mine, its in zip(*made.values()):
        with h5py.File(mine) as one, h5py.File(its) as other:
            names = []
            one.visititems(lambda name, item, names=names: names.append(name) if hasattr(item, "dims") else None)
            assert len(names) > 10
            for name in names:
                expected, found = np.asarray(one[name][()]), np.asarray(other[name][()])
                error = ROUNDING * np.abs(expected).max() if reduced and expected.dtype.kind == "f" else 0.0
                np.testing.assert_allclose(found, expected, rtol=0, atol=error, err_msg=name)


def test_a_reduced_model_is_refused_in_words_where_it_cannot_be_expanded(files):
    """The runs of a sweep do not keep their basis."""
    (chain,) = [path.parent for path in files if path.parent.name == "chain"]
    done = blocked("view", chain / "limits" / "0000")
    assert done.returncode == 2 and "fix:" in done.stderr and "Traceback" not in done.stderr
    assert "the motion of a reduced model cannot be shown here" in done.stderr


def test_every_axis_has_its_name(files):
    """A scale in the dataset's own group or in one above, as netCDF-4 wants it; or it is one itself."""
    nameless, foreign, types = [], [], set()

    def look(name, item):
        if not hasattr(item, "dims") or h5ds.is_scale(item.id):
            return
        for axis in item.dims:
            if len(axis) != 1:
                nameless.append(name)
            elif axis[0].parent not in (item.parent, item.parent.parent):
                foreign.append(name)

    for path in files:
        with h5py.File(path) as file:
            file.visititems(look)
            types |= {group.attrs["type"] for group in file.values() if "type" in group.attrs}
    assert not nameless and not foreign and types == TYPES


def test_every_type_of_analysis_is_a_tree_of_datasets(files):
    """xarray reads every dataset of every file, with the same values and as many axes as HDF5 has."""
    xarray = pytest.importorskip("xarray")
    for path in files:
        with xarray.open_datatree(path, engine="h5netcdf") as tree, h5py.File(path) as file:
            found = []
            file.visititems(lambda name, item, found=found: found.append(name) if hasattr(item, "dims") else None)
            assert found
            for name in found:
                values, kept = np.asarray(tree[name].values), file[name][()]
                assert values.shape == np.shape(kept), (path, name)
                if np.asarray(kept).dtype.kind in "fiu":
                    np.testing.assert_array_equal(values, kept, err_msg=name)


def test_arrays_of_one_name_in_two_groups_keep_their_own_axes():
    """Places of the pairs of two contacts, unlike in number, the first of them written again."""
    with h5py.File("axes", "w", driver="core", backing_store=False) as file:
        group = file.create_group("mode")
        for name, size in (("pairs_ring/position", 4), ("pairs_root/position", 7), ("pairs_ring/position", 5)):
            put_array(group, name, np.zeros((size, 2)), {})
        for name, size in (("pairs_ring/position", 5), ("pairs_root/position", 7)):
            assert [len(axis[0]) for axis in group[name].dims] == [size, 2]


def test_results_are_a_tree_of_datasets(run):
    """All analyses of the case: every axis has its name, every column its unit."""
    xarray = pytest.importorskip("xarray")
    tree = xarray.open_datatree(run / "results.h5", engine="h5netcdf")
    assert set(tree.children) == {"mode", "mode_epmc", "forced", "flutter", "free_decay", "limit_cycle"}
    mode = tree["mode"]
    zeta = mode["points"]["zeta"]
    assert zeta.dims == ("point",) and zeta.attrs["units"] == "1"
    coefficients = mode["coefficients"]
    assert coefficients.dims == ("point", "dof", "harmonic")
    assert coefficients.sel(dof="m1", harmonic="1s").shape == zeta.shape
    amplitude = np.hypot(coefficients.sel(dof="m1", harmonic="1c"), coefficients.sel(dof="m1", harmonic="1s"))
    np.testing.assert_allclose(amplitude, mode["points"]["amplitude"], rtol=ROUNDING)
    assert mode["contact_damper"]["f"].dims == ("reported", "sample", "component", "pair")
