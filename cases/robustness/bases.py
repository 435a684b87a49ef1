"""The right cases that `fuzz_cases.py` makes wrong, and short forms of them that run in about a second."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

import tomllib

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests")]
import further_bases  # noqa: E402
from models.chain_case import BUILDER, CHAIN  # noqa: E402

TWO_DOF, BLISK = ROOT / "cases/two_dof", ROOT / "cases/blisk_lumped"
SHORT_STEPS = {"max_points": 8}

#: What is done with the suite's chain on two pads in 3-D contact.
CHAIN_ANALYSES = """
[[analysis]]
name = "static"
type = "static"
factors = [0.5, 1.0]

[[analysis]]
name = "mode"
type = "mode"
harmonics = 2
samples = 32
normalise = "tip"
amplitude = [2e-7, 4e-6]
report_at = [1e-6]
step = { max_points = 8 }

[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
samples = 32
force = { tip = 0.1 }
levels = [1.0]
frequency = [50.0, 60.0]
observe = "tip"
backbone = ["mode"]
step = { max_points = 8 }

[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [1e-6]
cycles = 0.5
coefficient = 1e-13

[[analysis]]
name = "sweep"
type = "sweep"
of = "mode"
over = { mode.harmonics = [1, 2] }
"""


def load(folder: Path) -> tuple[dict[str, Any], Path]:
    """Data of a committed case, and where it is."""
    return tomllib.loads((folder / "case.toml").read_text(encoding="utf-8")), folder


def two_dof() -> dict[str, Any]:
    """Every analysis of the oscillator, on few points and periods."""
    case = load(TWO_DOF)[0]
    case["title"] = "short"
    for analysis in case["analysis"]:
        if "harmonics" in analysis:
            analysis.update(harmonics=3, samples=64, step=dict(SHORT_STEPS))
        if "amplitude" in analysis and "mode" in (analysis["type"], analysis["name"]):
            analysis["amplitude"] = [0.1, 0.12]
        if analysis["type"] in ("free_decay", "limit_cycle"):
            analysis.update(amplitude=[0.11], periods=12, samples_per_period=32, tolerance=1e-6)
    modes = [analysis for analysis in case["analysis"] if analysis["type"] == "mode"]
    for mode in modes:
        mode.update(amplitude=[0.1, 0.12], report_at=[])
    forced = next(analysis for analysis in case["analysis"] if analysis["type"] == "forced")
    forced.update(levels=[2.0], time_points=0, report_at=[4.0], frequency=[3.9, 4.1])
    case["quick"] = {"mode": {"harmonics": 1}}
    return case


def blisk() -> dict[str, Any]:
    """Sector, wheel, mistuned wheel, flutter and linear waves of the lumped blisk, on few points."""
    case = load(BLISK)[0]
    for analysis in case["analysis"]:
        if "harmonics" in analysis:
            analysis.update(harmonics=1, samples=48, step={"max_points": 2})
        if analysis["type"] in ("flutter", "linear"):
            analysis["nodal_diameters"] = [4]
    case["quick"] = {"mode.harmonics": 1}
    return case


def chain() -> dict[str, Any]:
    """The chain by its builder: reduced, preloaded, static, forced, worn and swept."""
    case = tomllib.loads(CHAIN + CHAIN_ANALYSES)
    case["model"]["options"] = {"masses": 6, "mass": 0.5, "tilt": [0.0, 0.0]}
    case["reduction"] = {"modes": 6, "compare": 2}
    return case


#: Builders beside the cases.
BUILDERS = {"blisk": BLISK / "model.py", "chain": BUILDER}
SHORT = {"two_dof": two_dof, "blisk": blisk, "chain": chain, **further_bases.SHORT}


def prepare(folder: Path) -> None:
    """Put the builders beside the cases that are written into `folder`."""
    for name in SHORT:
        (folder / name).mkdir(parents=True, exist_ok=True)
        if name in BUILDERS:
            shutil.copy(BUILDERS[name], folder / name / "model.py")
    further_bases.prepare(folder)
