"""A run's results where fretwave did not make them: by xarray, and on a machine without MPI and PETSc."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from h5py import h5ds

import fretwave as fw
from fretwave.files.dimensions import put_array

pytestmark = pytest.mark.ranks(1)
CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
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


@pytest.mark.parametrize("command", ["show", "plot"])
def test_a_run_is_shown_without_mpi_and_petsc(run, command):
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, command, str(run)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    if command == "show":
        assert "limit cycle at a = 0.1375" in done.stdout
    else:
        assert (run / "mode_backbone.png").exists()


def test_every_axis_has_its_name(run):
    """A scale in the dataset's own group or in the one above, as netCDF-4 wants it; or it is one itself."""
    nameless, foreign = [], []

    def look(name, item):
        if not hasattr(item, "dims") or h5ds.is_scale(item.id):
            return
        for axis in item.dims:
            if len(axis) != 1:
                nameless.append(name)
            elif axis[0].parent not in (item.parent, item.parent.parent):
                foreign.append(name)

    with h5py.File(run / "results.h5") as file:
        file.visititems(look)
        assert len(file["mode/points"]) > 10
    assert not nameless and not foreign


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
    np.testing.assert_allclose(amplitude, mode["points"]["amplitude"], rtol=1e-12)
    assert mode["contact_damper"]["f"].dims == ("reported", "sample", "component", "pair")
