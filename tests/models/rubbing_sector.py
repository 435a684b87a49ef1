"""A case of `built_sector.py`: a travelling wave that slips under the rim."""

from pathlib import Path

BUILDER = Path(__file__).parent / "built_sector.py"
SECTOR = """
[model]
builder = "model.py"
mass_damping = 2.0

[[contact]]
name = "pads"
law = "coulomb_3d"
friction_coefficient = 0.1

[preload]
loads = ["weight"]

[[analysis]]
name = "mode"
type = "mode"
nodal_diameter = 2
harmonics = 3
samples = 96
normalise = "tip"
amplitude = [5e-6, 2e-5]
report_at = [1e-5]
"""
