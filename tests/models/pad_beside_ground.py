"""A mass of two directions on oblique springs, pressed on a pad: x along it, y its normal. Case text."""

from __future__ import annotations

import numpy as np

KN, KT, MU, N0 = 5.0, 4.0, 0.5, 2.0
K = np.array([[3.0, 1.0], [1.0, 2.0]])
MODEL = f"""
[model]
dofs = ["x", "y"]
M = [[1.0, 0.0], [0.0, 1.0]]
K = {K.tolist()}
"""
PAD = f"""
[[contact]]
name = "pad"
law = "coulomb_2d"
pairs = ["y"]
tangents = ["x"]
normal_stiffness = {KN}
tangential_stiffness = {KT}
friction_coefficient = {MU}
normal_load = {N0}
"""
