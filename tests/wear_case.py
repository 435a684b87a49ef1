"""A cheap case of wear: a chain on two pads, of which one slips."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from fretwave.cli import main

BUILDER = Path(__file__).parent / "built_chain.py"
TEXT = """
title = "Chain on two pads"

[model]
builder = "model.py"
mass_damping = 2.0

[reduction]
modes = 12

[preload]
pair_loads = false
loads = ["weight"]

[[contact]]
name = "pads"
law = "coulomb_3d"
friction_coefficient = 0.4
tangential_stiffness_per_area = 2e10

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


def call(*arguments: str) -> int:
    """The command line, without its hook for exceptions left behind."""
    hook = sys.excepthook
    try:
        return main([str(argument) for argument in arguments])
    finally:
        sys.excepthook = hook


def write_case(folder: Path) -> Path:
    """The case file with its builder."""
    shutil.copy(BUILDER, folder / "model.py")
    (folder / "case.toml").write_text(TEXT)
    return folder / "case.toml"
