"""Scenes of friction in one direction: eps, kt, mass of the slider, damping, harmonics and samples, amplitude."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .closed import coulomb_slider, damping, hysteresis, jenkins_stiffness, limits
from .scene import Scene
from .structures import ONSET, TWO_DOF_K, TWO_DOF_M, coulomb, jenkins, mode, number, single, two_dof

ON_X1 = [0.0, 1.0]


def scenes() -> Iterator[Scene]:
    """All of them."""
    for part in (regularisation, stiffness, slider_mass, viscous, harmonics, amplitude, resonance, folds):
        yield from part()


def regularisation() -> Iterator[Scene]:
    axis = "eps 1 to 1e-8"
    for eps in (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8):
        yield two_dof(axis, f"eps_{number(eps)}", mode(), coulomb(5.0, eps, ON_X1), quick=eps in (1.0, 1e-2))
    for eps in (1e-2, 1e-4, 1e-6):
        yield two_dof(axis, f"eps_{number(eps)}_epmc", mode("EPMC"), coulomb(5.0, eps, ON_X1))
    for eps in (1e-3, 1e-4, 1e-5):
        yield two_dof(axis, f"eps_{number(eps)}_H21", mode(H=21, samples=1024), coulomb(5.0, eps, ON_X1))
    for eps in (1e-1, 1e-3, 1e-5, 1e-8):
        form = coulomb_slider(1.0, 1.0, 1.0, above=20.0 * max(eps, 1e-2))
        analysis = mode("EPMC", 1, 1024, (2.0, 200.0))
        yield single(axis, f"coulomb_single_eps_{number(eps)}", analysis, coulomb(1.0, eps, [1.0]), closed=[form])


def stiffness() -> Iterator[Scene]:
    axis = "kt 1e2 to 1e14"
    for decade in range(2, 15):
        kt = 10.0**decade
        # k = 1e6 N/m, limit 10 N: from a tenth of the first slip to a hundred times the limit's static deflection
        # a slider that is stuck for sqrt(8 limit / (kt a)) / 2 pi of a period at the largest damping, in ten samples
        samples = 1024 if kt < 1e12 else 1 << 14
        analysis = mode("CNM" if decade % 2 else "EPMC", 1, samples, (0.1 * 10 / kt, max(1e-3, 100 * 10 / kt)))
        form = hysteresis(1.0, 1e6, lambda a, kt=kt: jenkins_stiffness(kt, 10.0, a))
        contact = jenkins(kt, 10.0, [1.0])
        yield single(axis, f"jenkins_single_kt_1e{decade}", analysis, contact, k=1e6, closed=[form], quick=decade == 6)
    for decade in range(2, 15, 2):
        contact = jenkins(10.0**decade, 5.0, ON_X1)
        yield two_dof(axis, f"two_dof_kt_1e{decade}", mode(), contact, quick=decade == 2)
    for decade in (6, 10, 14):
        analysis = mode("CNM", 9, 512, (1e-6, 1e-3))
        contact = jenkins(10.0**decade, 10.0, ON_X1)
        K = 1e6 * np.array([[2.0, -1.0], [-1.0, 1.0]])
        yield two_dof(axis, f"limit_10N_kt_1e{decade}", analysis, contact, M=np.eye(2), K=K)


def slider_mass() -> Iterator[Scene]:
    axis = "slider mass to 1e-10"
    for decade in (2, 4, 6, 8, 10):
        M = np.diag([1.0, 10.0**-decade])
        yield two_dof(axis, f"mass_1e-{decade}_tanh", mode(), M=M, quick=decade == 4)
        yield two_dof(axis, f"mass_1e-{decade}_jenkins", mode(), jenkins(1e3, 5.0, ON_X1), M=M)


def slowest(M: Any, C: Any, K: Any) -> complex:
    """Eigenvalue lambda of M lambda^2 + C lambda + K with the lowest frequency > 0."""
    n = len(M)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    values = np.linalg.eigvals(companion)
    values = values[values.imag > 1e-6 * abs(values)]
    return complex(values[np.argmin(values.imag)]) if len(values) else 0j


def viscous() -> Iterator[Scene]:
    axis = "zeta 1e-6 to 1.5 and -0.2"
    w = np.sqrt(640.0)
    for zeta in (1e-6, 1e-4, 1e-2, 0.1, 0.5, 0.9, 1.5, -0.2):
        for method in ("CNM", "EPMC"):
            analysis = mode(method, dampers=[{"dof": "x0", "c": 2 * zeta * w}])
            # above zeta = 1 nothing oscillates: no CNM; EPMC's periodic motion is there all the same
            answer = "none" if zeta > 1 and method == "CNM" else "branch"
            # at small amplitude tanh is a damper of 100 N s/m on x1; the first row's third order is 1e-3 of its share
            C = np.diag([2 * zeta * w, 100.0])
            eigen = slowest(TWO_DOF_M, C, TWO_DOF_K)
            known = abs(zeta) >= 1e-2 and answer == "branch" and method == "CNM"
            closed = [damping(0, -eigen.real / abs(eigen), 1e-3)] if known else []
            name = f"zeta_{number(zeta)}_{method.lower()}"
            yield two_dof(axis, name, analysis, closed=closed, answer=answer, quick=zeta in (0.1, -0.2))
    yield two_dof(axis, "damper_c_25.3", mode(H=21, samples=1024, dampers=[{"dof": "x0", "c": 25.3}]))


def harmonics() -> Iterator[Scene]:
    axis = "H 1 to 101, N_t least to 2^14"
    for H in (1, 3, 5, 9, 15, 31, 51, 101):
        samples = max(64, 1 << int(np.ceil(np.log2(8 * H))))
        yield two_dof(axis, f"H_{H}_tanh", mode(H=H, samples=samples), quick=H == 3)
        yield two_dof(axis, f"H_{H}_jenkins", mode(H=H, samples=samples), jenkins(1e4, 5.0, ON_X1))
    for H in (1, 3, 7, 21):
        for law in ("tanh", "jenkins"):
            contact = coulomb(5.0, 0.05, ON_X1) if law == "tanh" else jenkins(1e4, 5.0, ON_X1)
            yield two_dof(axis, f"least_samples_H_{H}_{law}", mode(H=H, samples=2 * H + 2), contact)
    for power in (10, 12, 14):
        yield two_dof(axis, f"samples_2^{power}", mode(samples=1 << power))
        yield two_dof(axis, f"samples_2^{power}_jenkins", mode(samples=1 << power), jenkins(1e4, 5.0, ON_X1))


def amplitude() -> Iterator[Scene]:
    axis = "amplitude 1e-12 to 1e3 of first slip"
    stuck, free = np.sqrt(640.0), 24.156197846911287
    kt = 1e4
    springs = np.diag([0.0, kt])
    stuck_kt = np.sqrt(
        np.linalg.eigvalsh(
            np.diag(TWO_DOF_M.diagonal() ** -0.5) @ (TWO_DOF_K + springs) @ np.diag(TWO_DOF_M.diagonal() ** -0.5)
        )[0]
    )
    # the damper's work falls like 1/a: at 1e3 of first slip the mode is free within zeta^2
    spans = {
        "1e-12_to_half": (1e-12, 0.5),
        "1e-6_to_10": (1e-6, 10.0),
        "tenth_to_1e3": (0.1, 1e3),
        "1e-12_to_1e3": (1e-12, 1e3),
    }
    for name, (low, high) in spans.items():
        far = free if high == 1e3 else None
        span = (low * ONSET, high * ONSET)
        # the stuck tanh is a damper of 100 N s/m on x1: its creep bends the frequency by 1e-5
        closed = [limits(stuck if low < 0.1 else None, far, 1e-4)]
        yield two_dof(axis, f"{name}_tanh", mode(amplitude=span), closed=closed, quick=high == 10.0)
        closed = [limits(stuck_kt if low < 0.1 else None, far, 1e-4)]
        yield two_dof(axis, f"{name}_jenkins", mode(amplitude=span), jenkins(kt, 5.0, ON_X1), closed=closed)


def resonance() -> Iterator[Scene]:
    """w2 = 3 w1 with stuck contact: K = Q diag(1, 9) Q^T - kt e1 e1^T with a slider on x1."""
    axis = "3:1 internal resonance"
    angle = 0.5
    Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for detuning in (0.0, 1e-4, 1e-2, -1e-2):
        whole = Q @ np.diag([1.0, (3 * (1 + detuning)) ** 2]) @ Q.T
        K = whole - np.diag([0.0, 0.5])
        for H in (3, 9):
            analysis = mode(H=H, samples=512, amplitude=(0.05, 100.0))
            contact = jenkins(0.5, 1.0, ON_X1)
            scene = Scene(axis, f"3_1_detuned_{number(detuning)}_H_{H}", np.eye(2), K, [contact], analysis)
            scene.closed = [limits(1.0, None, 1e-9)]
            yield scene


def folds() -> Iterator[Scene]:
    axis = "points asked for, folds"
    a = 0.1350472602799  # with seven harmonics between the folds, at 0.13402 and 0.13541
    for step in (0.3, 0.03, 0.003):
        analysis = mode(report_at=[a], step={"maximum": step, "initial": min(0.05, step)})
        yield two_dof(axis, f"three_solutions_step_{step:g}", analysis, folds=2, reports={a: 3})
    yield two_dof(axis, "epmc_two_folds", mode("EPMC", 21, 1024), folds=2)
    yield two_dof(axis, "cnm_two_folds", mode(H=21, samples=1024), folds=2)
