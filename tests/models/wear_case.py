"""A cheap case of wear: a chain on two pads, of which one slips."""

from __future__ import annotations

import shutil
from pathlib import Path

from models.chain_case import BUILDER, CHAIN

TEXT = (
    CHAIN
    + """
[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 128
normalise = "tip"
amplitude = [2e-7, 4e-6]

[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [1e-6, 2e-6, 3e-6]
cycles = 8.0
coefficient = 1e-13
report_at = [2.0]

[[analysis]]
name = "one"
type = "wear"
mode = "mode"
amplitude = [2.5e-6]
cycles = 8.0
coefficient = 1e-13
"""
)


def write_case(folder: Path) -> Path:
    """The case file with its builder."""
    shutil.copy(BUILDER, folder / "model.py")
    (folder / "case.toml").write_text(TEXT)
    return folder / "case.toml"
