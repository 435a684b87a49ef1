"""Cases of a linear analysis with closed forms: a mass on its contact, and rings of equal masses."""

from __future__ import annotations

import numpy as np

#: One mass that moves along the normal and the tangent of its contact, and a second one behind it.
M, KN, KT = np.diag([2.0, 2.0, 1.0]), 30.0, 7.0
K = np.array([[50.0, 4.0, -10.0], [4.0, 40.0, -8.0], [-10.0, -8.0, 25.0]])
MASS_SHARE, STIFFNESS_SHARE = 0.02, 1e-3
POINT = f"""
[model]
dofs = ["n", "t", "m"]
M = {M.tolist()}
K = {K.tolist()}
mass_damping = {MASS_SHARE}
stiffness_damping = {STIFFNESS_SHARE}

[[contact]]
name = "face"
law = "coulomb_2d"
pairs = ["n"]
tangents = ["t"]
normal_stiffness = {KN}
tangential_stiffness = {KT}
friction_coefficient = 0.3
normal_load = 1.0

[[analysis]]
name = "linear"
type = "linear"
"""
#: A ring of N masses on ground springs, a spring and a Jenkins element to the next one.
MASS, GROUND, NEXT, CONTACT = 1.3, 2.0, 0.7, 0.4


def ring(sectors: int) -> str:
    coupling = NEXT * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return f"""
[model]
dofs = ["mass", "next"]
M = [[{MASS}, 0.0], [0.0, 0.0]]
K = {(np.diag([GROUND, 0.0]) + coupling).tolist()}
C = [[0.01, 0.0], [0.0, 0.0]]
sectors = {sectors}
low = ["mass"]
high = ["next"]

[[contact]]
name = "between"
law = "jenkins"
pairs = [["mass", "next"]]
tangential_stiffness = {CONTACT}
friction_limit = 1.0

[[analysis]]
name = "linear"
type = "linear"
speed_rpm = 6.0
"""
