"""m x'' + c x' + k x + g x^3 = f cos w t, whose modes and responses with one harmonic are closed forms."""

from __future__ import annotations

import numpy as np
from models.core_models import CubicLaw

import fretwave as fw

K, C, G = 4.0, 0.02, 0.5


class Spring(CubicLaw):
    """A cubic spring never sticks."""

    stuck_stiffness = 0.0


def duffing(damping=C):
    """With one harmonic the spring's force is 3/4 g a^3, exactly."""
    return fw.Model([[1.0]], [[K]], [[damping]], [fw.Contact(Spring(G), [[1.0]])])


def stiffness(a):
    return K + 0.75 * G * np.asarray(a) ** 2


def mode(method="CNM", damping=C):
    """lambda^2 + c lambda + k + 3/4 g a^2 = 0."""
    model = duffing(damping)
    return fw.NonlinearMode(model, fw.choose_harmonics(model, 1), method)


def response(force=0.1, level=1.0):
    """((k + 3/4 g a^2 - w^2)^2 + (c w)^2) a^2 = (level force)^2."""
    model = duffing()
    start = fw.linear_modes(model, 1)[0]
    return fw.ForcedResponse(model, fw.choose_harmonics(model, 1), {1: [force]}, level, 0, start)


def steps(length):
    return fw.StepControl(initial=length, maximum=length, max_error=1.0)
