"""A contact law in one file, as a case names it under `plugins`: a pad without memory."""

import numpy as np

import fretwave as fw
from fretwave import Limit, ParameterInfo, Role


@fw.register_law
class ToyPad(fw.PythonLaw):
    """A pad without memory, each tangent clipped by itself, whose parameters no other file has heard of."""

    name = "toy_pad"
    components = 3
    limit = Limit.EACH
    stuck_stiffness = 1e6
    parameters = (
        ParameterInfo("squeeze", "force/length", "along the normal", 0.0, True, None, Role.NORMAL_STIFFNESS),
        ParameterInfo("shear", "force/length", "along the tangents", 0.0, True, None, Role.TANGENTIAL_STIFFNESS),
        ParameterInfo("rub", "-", "friction", 0.0, False, None, Role.FRICTION_COEFFICIENT),
        ParameterInfo("push", "force", "load", 0.0, False, 7.0, Role.LOAD),
        ParameterInfo("air", "length", "gap", -1.0, False, 0.0, Role.GAP),
    )

    def force(self, u, v):
        normal = np.maximum(0.0, self.push + self.squeeze * (u[:, :1] - self.air))
        bound = self.rub * normal
        return np.concatenate([normal, np.clip(self.shear * u[:, 1:], -bound, bound)], axis=1)

    def status(self, u, v, f):
        slips = self.at_limit(np.abs(f[:, 1:]).max(axis=1), self.rub * f[:, 0])
        return np.where(f[:, 0] <= 0, 2, np.where(slips, 1, 0))

    def gap(self, u, v, f):
        return np.where(f[:, 0] > 0, 0.0, np.maximum(self.air - u[:, 0] - self.push / self.squeeze, 0.0))
