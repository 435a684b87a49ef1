"""The shrouded sector from its deck: the mesh, CalculiX' own waves of the wheel, and the case's short form."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fretwave as fw
from fretwave.importers.nodes import cells_of, read_nodes

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).resolve().parents[2] / "cases" / "shrouded_sector"
#: Digits that CalculiX prints of a frequency, and what rounding of both programs leaves.
PRINTED = 1e-6
needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of the case with its model file."""
    folder = tmp_path_factory.mktemp("case") / "shrouded_sector"
    shutil.copytree(CASE, folder, ignore=shutil.ignore_patterns("model", "pictures"))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", folder / "prepare"], env={**os.environ, "PATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_the_deck_is_one_of_24_sectors(tmp_path: Path) -> None:
    """693 nodes, 88 cells, every one of the faces and shroud ends with its partner 15 degrees ahead."""
    subprocess.run([sys.executable, CASE / "deck.py", tmp_path / "sector.inp"], check=True)
    nodes = read_nodes(tmp_path / "sector.inp")
    assert nodes.coordinates.shape == (693, 3) and cells_of(nodes)[0].shape == (88, 20)
    for low, high, count in (("LOW", "HIGH", 37), ("SHLOW", "SHHIGH", 23)):
        matched = fw.match_faces(nodes.coordinates, *(nodes.places(nodes.node_set(name)) for name in (low, high)), 24)
        assert len(matched[0]) == count
    assert np.hypot(*nodes.coordinates[nodes.places(nodes.node_set("BORE")), :2].T) == pytest.approx(120)


@needs_ccx
@pytest.mark.parametrize(("ranks", "limits"), [(1, ["free", "sliding", "stuck", "tied"]), (2, ["stuck"])])
def test_waves_are_those_of_calculix(prepared: Path, launch, ranks: int, limits: list[str]) -> None:
    """Four of 0, 3, 6 and 12 nodal diameters each (CalculiX 2.20, run by the script)."""
    done = launch(ranks, str(prepared / "limits.py"), *limits, timeout=200)
    assert done.returncode == 0, done.stderr
    off = [abs(float(word)) for word in re.findall(r"\(([-+]\S+)\)", done.stdout)]
    assert len(off) == 16 * len(limits) and max(off) < PRINTED, done.stdout


@needs_ccx
def test_the_short_form(prepared: Path, tmp_path: Path, launch) -> None:
    """From the stuck wave of CalculiX (1279.531 Hz) towards the sliding one (1184.768 Hz), damped in between; the
    reduction leaves 3e-6. Driven by the engine order, the wave peaks on the mode's backbone.
    """
    command = ["-m", "fretwave", "run", str(prepared / "case.toml"), "--quick", "--only", "mode,forced", "--no-plots"]
    done = launch(1, *command, "--out", str(tmp_path), timeout=200)
    assert done.returncode == 0, done.stderr
    run = fw.open_run(tmp_path)
    mode, forced = run["mode"], run["forced"]
    hz, zeta = mode["frequency_hz"], mode["zeta"]
    assert hz.max() < 1279.531 * (1 + 5e-6) and 1184.768 < hz.min() < 1200
    assert (np.diff(hz) < 0).all() and 0.03 < zeta.max() < 0.04 and 0 < zeta.argmax() < len(zeta) - 1
    peak = forced["amplitude"].argmax()
    on_the_mode = np.interp(forced["amplitude"][peak], mode["amplitude"], hz)
    assert forced["frequency_hz"][peak] == pytest.approx(on_the_mode, rel=2e-3)
