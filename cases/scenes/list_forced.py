"""Scenes of forced response: starts in friction, stops, first slip of stiff contact, kinks, unbounded levels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .closed import den_hartog
from .scene import Scene
from .structures import BLOCK_B, block, coulomb, forced, jenkins, number, pad, single, two_dof


def scenes() -> Iterator[Scene]:
    """All of them."""
    for part in (starts, stops, first_slip, kinks, levels):
        yield from part()


def starts() -> Iterator[Scene]:
    """x'' + x + F(x') = cos wt with a limit of 0.3, from four frequencies."""
    axis = "forced starts in friction"
    laws = {f"kt_1e{d}": jenkins(10.0**d, 0.3, [1.0]) for d in (2, 3, 4)}
    laws |= {f"eps_1e-{d}": coulomb(0.3, 10.0**-d, [1.0]) for d in (3, 4)}
    for law, contact in laws.items():
        for w in (0.3, 0.5, 0.7, 0.8):
            analysis = forced((w, 0.9 if w == 0.8 else w + 0.1), H=9, samples=512)
            # without stops above w = 0.75; nine harmonics and a law that is not quite Coulomb's
            closed = [den_hartog(1.0, 0.3, 1.0, 1.0, 2e-2, 0.79)] if w == 0.8 else []
            yield single(axis, f"{law}_from_{w:g}", analysis, contact, closed=closed)


def stops() -> Iterator[Scene]:
    """A mass with a damper of 2 % beside a one-sided stop, from 0.4 to 1.2 of its frequency."""
    axis = "one-sided stops"
    B = np.array([[1.0], [0.0], [0.0]])
    for kn in (1e1, 1e2, 1e4, 1e6, 1e8):
        for gap in (0.0, 1.0):
            analysis = forced((0.4, 1.2), H=7, samples=256, retain="all")
            contact = pad(kn, 1.0, 0.0, 0.0, gap, B)
            name = f"stop_kn_{number(kn)}_gap_{gap:g}"
            damper, quick = 0.1 * np.eye(1), kn == 1e8 and gap == 1.0
            yield Scene(axis, name, np.eye(1), np.eye(1), [contact], analysis, C=damper, preload=True, quick=quick)


def first_slip() -> Iterator[Scene]:
    axis = "contacts of 1e14 N/m at first slip"
    for law in ("jenkins", "pad"):
        for level in (0.5, 2.0):
            analysis = forced((0.5, 0.8), [level], H=5, samples=128, **({"retain": "all"} if law == "pad" else {}))
            name = f"first_slip_{law}_level_{level:g}"
            if law == "jenkins":
                K = np.array([[2.0, -1.0], [-1.0, 1.0]])
                yield two_dof(
                    axis, name, analysis, jenkins(1e14, 0.5, [0.0, 1.0]), M=np.eye(2), K=K, C=0.02 * K, quick=level > 1
                )
            else:
                scene = block(axis, name, analysis, pad(1e14, 1e14, 0.5, 1.0, 0.0, BLOCK_B))
                scene.C = 0.02 * scene.K
                yield scene


def kinks() -> Iterator[Scene]:
    """Three masses with a one-sided spring or a slider on few samples: states change one sample at a time."""
    axis = "kinks, 16 step settings"
    K = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.5]])
    for law in ("stop", "slider"):
        for initial in (0.05, 0.01):
            for maximum in (0.3, 0.1):
                for angle in (0.6, 0.3):
                    step = {"initial": initial, "maximum": maximum, "max_angle": angle}
                    kind = {"retain": "all"} if law == "stop" else {}
                    analysis = forced((0.4, 1.1), H=5, samples=32, step=step, **kind)
                    if law == "stop":
                        contact = pad(2.0, 1.0, 0.0, 0.0, 1.0, np.array([[0.0, 0, 1], [0, 0, 0], [0, 0, 0]]))
                    else:
                        contact = jenkins(1.0, 0.6, [0.0, 0.0, 1.0])
                    name = f"kink_{law}_{initial:g}_{maximum:g}_{angle:g}"
                    yield Scene(
                        axis,
                        name,
                        np.eye(3),
                        K,
                        [contact],
                        analysis,
                        C=0.02 * K,
                        preload=True if law == "stop" else None,
                    )


def levels() -> Iterator[Scene]:
    axis = "levels up to none bounded"
    for level in (1e-6, 2.0, 8.0, 8.8):
        analysis = forced(2 * np.pi * np.array([3.2, 4.6]), [level], H=7, samples=256)
        yield two_dof(axis, f"two_dof_level_{level:g}", analysis, quick=level == 2.0)
    analysis = forced(2 * np.pi * np.array([3.2, 4.6]), [20.0], H=7, samples=256)
    yield two_dof(axis, "two_dof_level_20", analysis, answer="unbounded")
    yield two_dof(axis, "two_dof_level_9.2", {**analysis, "levels": [9.2]}, answer="unbounded")
    contact = coulomb(0.3, 0.01, [1.0])
    yield single(axis, "single_beyond_its_friction", forced((0.8, 1.2), [1.0]), contact, answer="unbounded")
