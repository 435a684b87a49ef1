"""A case of `built_chain.py` under its own weight, to which tests add analyses."""

from pathlib import Path

BUILDER = Path(__file__).parent / "built_chain.py"
#: All 12 component modes: the expanded motion solves the unreduced equations.
CHAIN = """
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
"""
#: A response of it through resonance.
FORCED = """
[[analysis]]
name = "forced"
type = "forced"
harmonics = 3
samples = 64
observe = "tip"
force = { tip = 0.05 }
frequency = [205.0, 220.0]
levels = [1.0]
"""
