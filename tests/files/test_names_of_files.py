"""Names that are no text in UTF-8, as of old archives: runs in such folders are written, and said in words."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import fretwave as fw
from fretwave.texts import display, readable

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
SHORT = "--only mode --set mode.harmonics=3 --set mode.amplitude=[0.02,0.03] --set mode.report_at=[]"
NAME = os.fsdecode(b"m\xfcller")


def fretwave(*arguments: str) -> str:
    done = subprocess.run([sys.executable, "-m", "fretwave", *arguments], capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()  # text in UTF-8


def test_a_name_is_said_in_words() -> None:
    assert readable("m\u00fcller \u03bc") == "m\u00fcller \u03bc"
    assert readable(NAME) == display(Path(NAME)) == r"m\xfcller"


def test_a_run_is_written_shown_and_reported(tmp_path: Path) -> None:
    """Python's own errors came out of run.log, the last words of a signal, and the report."""
    case, out = tmp_path / f"{NAME}.toml", str(tmp_path / f"of {NAME}")
    case.write_text(CASE.read_text(encoding="utf-8"), encoding="utf-8")
    assert r"of m\xfcller" in fretwave("run", str(case), "--out", out, "--no-plots", *SHORT.split())
    assert fw.open_run(out)["mode"]["amplitude"][-1] == pytest.approx(0.03, rel=1e-9)
    for command in ("show", "report", "resume"):
        fretwave(command, out)
    assert r"m\xfcller.toml" in (Path(out) / "report.html").read_text(encoding="utf-8")
