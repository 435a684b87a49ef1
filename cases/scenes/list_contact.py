"""Scenes of contact with a normal direction: stiffness, friction, load, gap, stops; splittings, units, many pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from .closed import at_amplitude, closed_modes, hysteresis, jenkins_stiffness, limits, unilateral
from .equations import Contact
from .growth import grown
from .scene import Scene
from .structures import BLOCK_B, block, chain, coulomb, jenkins, mode, number, pad, two_dof


def scenes() -> Iterator[Scene]:
    """All of them."""
    for part in (stiffness, stop, friction, load, splitting, units, pairs):
        yield from part()


def on_block(
    axis: str, name: str, kn: float = 5.0, mu: float = 0.5, N0: float = 1.0, gap: float = 0.0, **more: Any
) -> Scene:
    """The block, normalised on the dof that moves most: stuck at first, slipping and lifting off at the end."""
    span = (more.pop("low", 1e-2), more.pop("high", 20.0))
    keys = {"normalise": more.pop("normalise", "x2"), **more.pop("keys", {})}
    analysis = mode(more.pop("method", "CNM"), 5, 128, span, **keys)
    scene = block(axis, name, analysis, pad(kn, more.pop("kt", 0.8 * kn), mu, N0, gap, BLOCK_B), **more)
    limit = mu * (N0 - kn * gap)
    if limit > span[0] and keys["normalise"] == "x2":
        scene.closed = [limits(closed_modes(scene)[0], None, 1e-6)]
    elif analysis["normalise"] != "x2":  # it slips from the first; which sliding mode it comes to no theory says
        scene.closed = [grown()]
    elif limit > 0:  # friction takes limit / a off the way to the sliding mode
        scene.closed = [at_amplitude(1.0, closed_modes(scene, sliding=True)[0], 1e-3)]
    return scene


def stiffness() -> Iterator[Scene]:
    axis = "kn and kt 1e2 to 1e14"
    for decade in range(0, 15, 2):
        for method in ("CNM", "EPMC") if decade % 4 == 2 else ("CNM",):
            name = f"block_kn_1e{decade}_{method.lower()}"
            yield on_block(axis, name, 10.0**decade, method=method, quick=decade == 2)
    for decade in (4, 9, 14):
        yield on_block(axis, f"block_kn_1e{decade}_kt_1", 10.0**decade, kt=1.0)
        yield on_block(axis, f"block_kn_1_kt_1e{decade}", 1.0, kt=10.0**decade)
    for decade in (2, 6, 10):
        # x0 moves a hundredth of x2: the first point slips
        yield on_block(axis, f"block_starts_in_slip_kn_1e{decade}", 10.0**decade, normalise="x0")


def stop() -> Iterator[Scene]:
    """One mass, a unilateral spring without gap: no linear limit, the same frequency at every amplitude."""
    axis = "gaps and one-sided springs"
    B = np.array([[1.0], [0.0], [0.0]])
    for kn in (3.0, 1e2, 1e4, 1e6):
        H = 15
        analysis = mode("EPMC", H, 512, (0.1, 10.0), retain="all")
        contact = pad(kn, 1.0, 0.0, 0.0, 0.0, B)
        # truncation: the force has a corner, its harmonics fall like (k/k1)/n^2
        closed = [unilateral(1.0, np.sqrt(1 + kn), 2e-3)] if kn == 3.0 else []
        yield Scene(
            axis, f"unilateral_kn_{number(kn)}", np.eye(1), np.eye(1), [contact], analysis, closed=closed, preload=True
        )
    for gap in (1e-3, 0.1, 1.0):
        for kn in (10.0, 1e4):
            contact = pad(kn, 1.0, 0.0, 0.0, gap, B)
            analysis = mode("EPMC", 9, 256, (0.1 * gap, 10 * gap), retain="all")
            closed = [limits(1.0, None, 1e-9)]
            name = f"gap_{number(gap)}_kn_{number(kn)}"
            yield Scene(axis, name, np.eye(1), np.eye(1), [contact], analysis, closed=closed, preload=True)
    for gap in (-0.5, 0.2):
        yield on_block(axis, f"block_gap_{gap:g}", N0=0.0 if gap < 0 else 2.0, gap=gap)
    yield on_block(axis, "block_open_gap", N0=0.0, gap=0.5)


def friction() -> Iterator[Scene]:
    axis = "mu 0 to 1e3"
    for mu in (0.0, 1e-6, 1e-3, 0.1, 1.0, 10.0, 100.0, 1e3):
        yield on_block(axis, f"mu_{number(mu)}", mu=mu, quick=mu in (1e-3, 100.0, 1000.0))


def load() -> Iterator[Scene]:
    axis = "load 0 to 1e6"
    for N0 in (0.0, 1e-9, 1e-3, 1e3, 1e6):
        low = 1e-2 * min(max(N0, 1e-3), 1.0)  # a pad without load slips at any amplitude
        yield on_block(axis, f"load_{number(N0)}", N0=N0, low=low, quick=N0 == 1e-9)
    contact = pad(5.0, 4.0, 0.5, 1.0, 0.0, BLOCK_B)
    analysis = mode("CNM", 5, 128, (1e-2, 20.0), retain="all", normalise="x2")
    yield block(axis, "load_not_balanced", analysis, contact, preload=False)
    yield two_dof(
        axis,
        "limit_0_tanh",
        mode(),
        coulomb(0.0, 0.05, [0.0, 1.0]),
        closed=[limits(24.156197846911287, 24.156197846911287, 1e-9)],
    )
    yield two_dof(
        axis, "limit_0_jenkins", mode(), jenkins(1e4, 0.0, [0.0, 1.0]), closed=[limits(None, 24.156197846911287, 1e-9)]
    )
    yield two_dof(
        axis,
        "limit_1e-12_jenkins",
        mode(),
        jenkins(1e4, 1e-12, [0.0, 1.0]),
        closed=[limits(None, 24.156197846911287, 1e-9)],
    )


def splitting() -> Iterator[Scene]:
    """Two equal masses on springs 1 and 1 + d, a slider each; then both coupled by a third spring."""
    axis = "splitting 1e-12 to 1e-2"
    for d in (1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2):
        two = jenkins(0.2, 1.0, np.eye(2))
        K = np.diag([1.0, 1.0 + d])
        form = hysteresis(1.0, 1.0, lambda a: jenkins_stiffness(0.2, 1.0, a))
        analysis = mode("EPMC", 1, 1024, (1.0, 100.0))
        yield Scene(axis, f"apart_{number(d)}", np.eye(2), K, [two], analysis, closed=[form], quick=d == 1e-4)
        # the slider on the first alone turns two nearly equal modes into one stuck and one that never feels it
        turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
        K = turn @ np.diag([1.0, 1.0 + d]) @ turn.T
        analysis = mode("CNM", 5, 256, (1.0, 100.0), linear_mode=2)
        yield Scene(axis, f"turned_{number(d)}", np.eye(2), K, [jenkins(0.2, 1.0, [1.0, 0.0])], analysis)


def scaled(scene: Scene, name: str, mass: float, length: float, time: float) -> Scene:
    """The scene in other units: numbers of mass, length and time are multiplied by these factors."""
    k, c, f, v = mass / time**2, mass / time, mass * length / time**2, length / time
    factors = {
        "friction_limit": f,
        "regularisation_velocity": v,
        "tangential_stiffness": k,
        "normal_stiffness": k,
        "normal_load": f,
        "gap": length,
    }
    contacts = [
        Contact(x.name, x.law, x.B, {key: value * factors.get(key, 1.0) for key, value in x.parameters.items()})
        for x in scene.contacts
    ]
    a = dict(scene.analysis)
    a["amplitude"] = [x * length for x in a["amplitude"]]
    a["report_at"] = [x * length for x in a["report_at"]]
    C = None if scene.C is None else scene.C * c
    return replace(
        scene, name=name, M=scene.M * mass, K=scene.K * k, C=C, contacts=contacts, analysis=a, closed=(), twin=None
    )


def units() -> Iterator[Scene]:
    axis = "unit systems, scaling by 1e14"
    systems = {
        "mm_t_s": (1e-3, 1e3, 1.0),
        "matrices_1e14": (1e14, 1.0, 1.0),
        "matrices_1e-14": (1e-14, 1.0, 1.0),
        "us_um": (1.0, 1e6, 1e6),
    }
    tanh = two_dof(axis, "tanh", mode(report_at=[0.1, 0.2, 1.0]))
    slider = two_dof(axis, "jenkins", mode("EPMC", report_at=[0.1, 0.2, 1.0]), jenkins(1e4, 5.0, [0.0, 1.0]))
    pads = on_block(axis, "pad", keys={"report_at": [0.1, 1.0, 10.0]})
    for base in (tanh, slider, pads):
        for name, (mass, length, time) in systems.items():
            twin = scaled(base, f"{base.name}_{name}", mass, length, time)
            yield replace(twin, twin=(base, length, time), quick=name == "mm_t_s" and base is tanh)


def pairs() -> Iterator[Scene]:
    axis = "1 to 768 pairs"
    for n in (1, 2, 4, 12, 48, 192, 768):
        M, K = chain(n + 1)
        B = sp.identity(n + 1, format="csr")[1:]
        limit = np.linspace(0.5, 1.5, n)
        analysis = mode("CNM", 3, 128, (0.05, 20.0), step={"maximum": 0.3})
        yield Scene(axis, f"jenkins_{n}_pairs", M, K, [jenkins(0.1, limit, B)], analysis, timeout=90.0)
    for n in (1, 4, 16, 48, 96):
        M, K = chain(n + 1)
        three = sp.kron(K, sp.csr_matrix([[1.0, 0.2, 0.1], [0.2, 0.8, 0.1], [0.1, 0.1, 0.9]]), format="csr")
        B = sp.identity(3 * n + 3, format="csr")[3:]
        contact = pad(0.3, 0.2, 0.4, np.linspace(0.5, 1.5, n), 0.0, B)
        analysis = mode("CNM", 3, 64, (0.05, 10.0))
        M3 = sp.kron(M, sp.identity(3), format="csr")
        yield Scene(axis, f"coulomb_3d_{n}_pairs", M3, three, [contact], analysis, preload=True, timeout=90.0)
