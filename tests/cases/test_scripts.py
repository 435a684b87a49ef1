"""Scripts beside the cases: at most 25 lines each, public names alone, and the numbers of the command line."""

from __future__ import annotations

import ast
import csv
import re
from pathlib import Path

import numpy as np
import pytest
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw

CASES = Path(__file__).resolve().parents[2] / "cases"
SCRIPTS = [
    "blade_root/wear.py",
    "blisk_lumped/engine_order.py",
    "blisk_lumped/flutter.py",
    "blisk_lumped/mistuned.py",
    "blisk_lumped/standing_wave.py",
    "two_dof/sweep.py",
]
MOST_LINES = 25

pytestmark = pytest.mark.ranks(1)


def printed(launch, script: str) -> list[list[float]]:
    """Numbers of each line that a script prints."""
    done = launch(1, str(CASES / script), timeout=120)
    assert done.returncode == 0, done.stderr
    return [[float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", line)] for line in done.stdout.splitlines()]


def table(launch, folder: Path, case: str, analysis: str, *settings: str, before: str = "") -> list[dict[str, str]]:
    """Rows that the command line gives of the case's short form."""
    changed = [part for setting in settings for part in ("--set", setting)]
    only = ",".join(filter(None, (before, analysis)))
    arguments = [str(CASES / case / "case.toml"), "--quick", "--no-plots", "--only", only, "--out", str(folder)]
    done = launch(1, "-m", "fretwave", "run", *arguments, *changed, timeout=120)
    assert done.returncode == 0, done.stderr
    with (folder / f"{analysis}.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_is_short_and_uses_public_names(script):
    tree = ast.parse((CASES / script).read_text())
    lines = {node.lineno for node in ast.walk(ast.Module(tree.body[1:], [])) if hasattr(node, "lineno")}
    text = (CASES / script).read_text().splitlines()
    code = [line for line in text[tree.body[0].end_lineno :] if line.strip() and not line.strip().startswith("#")]
    assert max(len(lines), len(code)) <= MOST_LINES
    used = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and getattr(n.value, "id", "") == "fw"}
    assert used <= set(fw.__all__), used - set(fw.__all__)
    imported = [name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for name in [node.module]]
    assert not [name for name in imported if str(name).startswith("fretwave")]


def test_sweep_scales_with_the_friction_limit_and_has_the_damping_of_the_case(launch, tmp_path):
    """A homogeneous law: one largest damping, amplitudes in proportion to the limit; at 5 N it is the case's."""
    _, *lines = printed(launch, "two_dof/sweep.py")
    limit, zeta, amplitude = np.array(lines).T
    assert limit.tolist() == [1.0, 5.0, 25.0]
    np.testing.assert_allclose(zeta, zeta[1], rtol=REPEATED)
    np.testing.assert_allclose(amplitude / limit, amplitude[1] / 5.0, rtol=1e-6)
    rows = table(launch, tmp_path, "two_dof", "mode")
    peak = next(row for row in rows if "peak_damping" in row["event"])
    assert zeta[1] == pytest.approx(100 * float(peak["zeta"]), rel=REPEATED)
    assert amplitude[1] == pytest.approx(float(peak["amplitude"]), rel=1e-6)


def test_mistuned_wheel_is_that_of_the_case(launch, tmp_path):
    lines = printed(launch, "blisk_lumped/mistuned.py")
    rows = table(launch, tmp_path, "blisk_lumped", "mode_mistuned")
    wanted = [row for row in rows if row["event"] in ("start", "report", "stop")]
    assert len(wanted) == 3
    assert lines[0][1] == pytest.approx(616.578, rel=0.01), (
        "the second family, within its scatter; the first is at 194 Hz"
    )
    for row, (amplitude, hz, _), (blade, amplification) in zip(wanted, lines[::2], lines[1::2]):
        assert amplitude == pytest.approx(float(row["amplitude"]), rel=1e-5)
        assert hz == pytest.approx(float(row["frequency_hz"]), rel=REPEATED)
        assert blade == float(row["largest_sector"])
        assert amplification == pytest.approx(float(row["amplification"]), rel=REPEATED)


def test_standing_wave_is_that_of_the_case_and_takes_part_by_two_thirds(launch, tmp_path):
    """Stuck, both waves have one frequency, and participation ratios 1 and 2/3; slipping, the case's table."""
    lines = printed(launch, "blisk_lumped/standing_wave.py")
    travelling, standing = np.array(lines[:3]), np.array(lines[3:])
    np.testing.assert_allclose(travelling[:, 3], 1.0, rtol=REPEATED)
    assert standing[0, 3] == pytest.approx(2 / 3, rel=REPEATED)
    assert standing[0, 1] == pytest.approx(travelling[0, 1], rel=SOLVED)
    rows = table(launch, tmp_path, "blisk_lumped", "mode_wheel", "mode_wheel.wave=standing")
    wanted = [row for row in rows if row["event"] in ("start", "report", "stop")]
    names = ("amplitude", "frequency_hz", "zeta", "participation")
    expected = np.array([[float(row[name]) for name in names] for row in wanted])
    np.testing.assert_allclose(standing, expected, rtol=2e-6, atol=ROUNDING)


def test_wear_of_the_blade_root_is_that_of_the_case(launch, tmp_path):
    settings = ("wear_profile.cycles=2.0", "wear_profile.report_at=[1.0]", "mode.report_at=[]")
    rows = table(launch, tmp_path, "blade_root", "wear_profile", *settings, before="mode")
    found = [line[:4] for line in printed(launch, "blade_root/wear.py")]
    names = ("cycles", "frequency_hz", "zeta")
    expected = np.array([[*(float(row[name]) for name in names), _worn(row)] for row in rows])
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-30)


def _worn(row: dict[str, str]) -> float:
    return sum(float(row[name]) for name in row if name.startswith("worn_"))
