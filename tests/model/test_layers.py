"""The physics stands without the case files: scripts load neither TOML's layer nor pydantic."""

from __future__ import annotations

import subprocess
import sys

import pytest

IMPORT = """
import pkgutil, importlib, sys
import fretwave.{folder} as folder
names = [name for _, name, _ in pkgutil.iter_modules(folder.__path__)]
for name in names:
    importlib.import_module(f"fretwave.{folder}.{{name}}")
wrong = [name for name in sys.modules if name.startswith(("fretwave.case", "fretwave.analyses", "pydantic"))]
print(len(names), wrong)
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize("folder", ["model", "hb", "cyclic", "solve"])
def test_physics_loads_no_case_layer(folder: str) -> None:
    code = IMPORT.format(folder=folder)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    count, _, wrong = done.stdout.partition(" ")
    assert int(count) > 1 and wrong.strip() == "[]"


@pytest.mark.ranks(1)
def test_structures_pairs_and_files_need_no_parallel_library() -> None:
    """What builders and readers of results use: NumPy and SciPy alone."""
    code = "import sys; from fretwave import Contact, Pairs, Structure, read_model; " + (
        "print([name for name in ('mpi4py', 'petsc4py', 'pydantic') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr
