"""Branches that tests follow step by step, and a mass beside a stop."""

from __future__ import annotations

import numpy as np

import fretwave as fw


def follow(problem, low, high, report_at=(), **steps):
    branch = fw.Continuation(problem, problem.initial(low), (low, high), fw.StepControl(**steps), report_at)
    return branch, list(branch)


def named(points, event):
    return [p.parameter for p in points if event in p.event.split()]


def response(model, level, omega, orders=(1, 3, 5), samples=128):
    reference = fw.linear_modes(model, 1, "free")[0]
    force = np.zeros(model.n_dof)
    force[0] = 1.0
    problem = fw.ForcedResponse(model, fw.Harmonics(list(orders), samples), {1: force}, level, 0, reference)
    return problem, fw.Continuation(problem, problem.initial(omega[0]), omega)


def stop(comm, stiffness, gap=0.0):
    """One mass on a spring beside a one-sided stop, with 5 % damping."""
    B = np.array([[1.0], [0.0], [0.0]])
    values = {
        "normal_stiffness": stiffness,
        "tangential_stiffness": 1.0,
        "friction_coefficient": 0.0,
        "normal_load": 0.0,
        "gap": gap,
    }
    return fw.Model(np.eye(1), np.eye(1), 0.1 * np.eye(1), [fw.Contact("coulomb_3d", B, values)], comm)
