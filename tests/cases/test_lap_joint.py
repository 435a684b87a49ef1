"""The lap joint from its deck: CalculiX' own frequencies, and the mode from stick past its largest damping."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).resolve().parents[2] / "cases" / "lap_joint"
#: Digits that CalculiX prints of a frequency, and what rounding of both programs leaves.
PRINTED = 1e-6


@pytest.fixture(scope="module")
def prepared() -> Path:
    """The case's folder with its model file."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(["bash", CASE / "prepare"], env={**os.environ, "PATH": path}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return CASE


def test_the_deck_is_what_its_script_writes() -> None:
    written = subprocess.run([sys.executable, CASE / "deck.py"], capture_output=True, text=True, check=True).stdout
    assert (CASE / "joint.inp").read_text(encoding="utf-8") == written


def test_limits_are_those_of_calculix(prepared: Path, launch) -> None:
    """Stuck and sliding, with CalculiX' equations and with its springs (CalculiX 2.20, run by the script)."""
    done = launch(1, str(prepared / "limits.py"), timeout=120)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    off = [[abs(float(word)) for word in re.findall(r"\((\S+)\)", line)] for line in lines]
    assert [len(words) for words in off] == [6, 3, 6, 3]  # sliding the second plate has three rigid motions
    assert max(map(max, off)) < PRINTED, done.stdout


def test_mode_past_its_largest_damping(prepared: Path, tmp_path: Path, launch) -> None:
    """Against fretwave 99015ca's direct route, 12 points: 0.2875 % at 1.721 mm, 0.1902 % at 4 mm."""
    command = ["-m", "fretwave", "run", str(prepared / "case.toml"), "--quick", "--only", "mode", "--no-plots"]
    done = launch(1, *command, "--out", str(tmp_path), timeout=120)
    assert done.returncode == 0, done.stderr
    assert "asymptotes: stuck 42.4338 Hz, closed and sliding 42.0155 Hz" in done.stdout
    mode = fw.open_run(tmp_path)["mode"]
    assert mode["zeta"].max() == pytest.approx(0.2875e-2, abs=5e-7)
    assert mode["amplitude"][mode["zeta"].argmax()] == pytest.approx(1.721, rel=0.01)
    assert mode["zeta"][-1] == pytest.approx(0.1902e-2, abs=1e-6)


def stuck(folder: Path, launch, cells: str, first: str, second: str) -> np.ndarray:
    """Six frequencies, the second plate in other cells, of 3125 N/mm a mm^2: 1e5 N/mm a pair in the mean."""
    deck = subprocess.run(
        [sys.executable, CASE / "deck.py", "--second", *cells.split()], capture_output=True, text=True, check=True
    ).stdout
    (folder / "joint.inp").write_text(deck)
    subprocess.run(["ccx", "joint"], cwd=folder, check=True, capture_output=True)
    files = ["--mass", "joint.mas", "--stiffness", "joint.sti", "--coordinates", "joint.inp", "--units", "mm-t-s"]
    command = ["-m", "fretwave", "import", "joint.h5", *files, "--pairs", f"joint={first}", second]
    done = launch(1, *command, cwd=folder, timeout=120)
    assert done.returncode == 0 and "area 800 in all" in done.stdout, done.stderr
    plates = fw.read_model(folder / "joint.h5")
    k = 3125.0 * plates.pairs["joint"].areas
    law = {"normal_stiffness": k, "tangential_stiffness": k, "friction_coefficient": 0.3, "normal_load": 20.0}
    joint = fw.Contact("coulomb_3d", B=plates.pairs["joint"].B, parameters=law)
    with fw.Model(plates.M, plates.K, contacts=[joint], units="mm-t-s") as model:
        return np.array([mode.omega for mode in fw.linear_modes(model, 6, "stuck")]) / (2 * np.pi)


def test_meshes_that_do_not_match(tmp_path: Path, launch) -> None:
    """Within 1 % of the matching mesh in all six modes, whichever side is projected, by sets and by surfaces."""
    same = stuck(tmp_path, launch, "16 4 1", "A", "B")
    for first, second in (("A", "B"), ("LOWER", "UPPER")):
        other = stuck(tmp_path, launch, "24 6 1", first, second)
        assert abs(other / same - 1).max() < 0.01
