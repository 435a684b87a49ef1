"""The recipe of a column of a table: its steps done to a copy of the package, the column then right and read back."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import own_environment
from tolerances import LAST_DIGITS

import fretwave
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

#: File of the package, what stands there, and what is written behind it.
STEPS = (
    (
        "columns.py",
        '    Column("zeta", "1", "modal damping ratio"),\n',
        '    Column("period", "s", "period of the mode"),\n',
    ),
    ("columns.py", '    *("point", "amplitude", "omega", "omega0", "frequency_hz", "beta", "zeta"', ', "period"'),
    ("hb/states.py", '("amplitude", "omega", "omega0", "frequency_hz", "beta", "zeta"', ', "period"'),
    ("hb/states.py", ", omega, omega0, omega / (2 * math.pi), beta, zeta", ", 2 * math.pi / omega"),
)
CASE = """
[model]
dofs = ["x"]
M = [[1.0]]
K = [[4.0e6]]
[[contact]]
name = "damper"
law = "jenkins"
tangential_stiffness = 1e6
friction_limit = 1.0
pairs = ["x"]
[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 64
normalise = "x"
amplitude = [1e-7, 1e-5]
"""


def changed_copy(folder: Path) -> None:
    """The package with the recipe's steps done; files that stay as they are, are links."""
    package = Path(fretwave.__file__).parent
    shutil.copytree(
        package, folder / "fretwave", copy_function=os.symlink, ignore=shutil.ignore_patterns("__pycache__")
    )
    for name, stands, added in STEPS:
        path = folder / "fretwave" / name
        text = path.read_text()
        assert text.count(stands) == 1, f"{name} has no longer: {stands}"
        path.unlink()
        path.write_text(text.replace(stands, stands + added))


def test_a_column_is_two_lines_and_its_producer(tmp_path: Path) -> None:
    changed_copy(tmp_path)
    (tmp_path / "case.toml").write_text(CASE)
    run = [sys.executable, "-m", "fretwave", "run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run")]
    done = subprocess.run(
        run, cwd=tmp_path, env=own_environment(PYTHONPATH=str(tmp_path)), capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    table = Run(tmp_path / "run").table("mode")
    assert table["period"] == pytest.approx(2 * np.pi / table["omega"], rel=LAST_DIGITS)
    with h5py.File(tmp_path / "run" / "results.h5") as file:
        period = file["mode/points/period"]
        assert period[()].tolist() == table["period"].tolist()
        assert (period.attrs["units"], period.attrs["long_name"]) == ("s", "period of the mode")
