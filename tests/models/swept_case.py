"""A case that sweeps the limit of a slider, and the command line in this process."""

from __future__ import annotations

import sys

from fretwave.commands.main import main

#: A mass on a spring and a Jenkins element, m = k = kt = 1 (one harmonic: in closed form).
CASE = """
[model]
dofs = ["x"]
M = [[1.0]]
K = [[1.0]]

[[contact]]
name = "slider"
law = "jenkins"
pairs = ["x"]
tangential_stiffness = 1.0
friction_limit = 1.0

[[analysis]]
name = "mode"
type = "mode"
method = "EPMC"
harmonics = 1
samples = 512
normalise = "x"
amplitude = [0.05, 60.0]
step = { maximum = 0.1 }

[[analysis]]
name = "limits"
type = "sweep"
of = "mode"
over.contact.slider.friction_limit = [0.2, 1.0, 5.0]
overrides.mode.amplitude = [0.1, 30.0]
"""
LIMITS = (0.2, 1.0, 5.0)
#: The law that time integration knows in place of one with memory.
MEMORYLESS = (
    'law = "jenkins"\npairs = ["x"]\ntangential_stiffness = 1.0',
    'law = "regularised_coulomb"\npairs = ["x"]\nregularisation_velocity = 0.1',
)
OVER_LINE = 1 + CASE[: CASE.index("over.contact")].count("\n")
OVER = ["--over", "contact.slider.friction_limit=0.2,1.0,5.0"]


def fretwave(*arguments: object) -> int:
    """The command in this process."""
    hook = sys.excepthook
    try:
        return main([str(argument) for argument in arguments])
    finally:
        sys.excepthook = hook
