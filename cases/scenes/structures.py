"""Structures that scenes are made of, each a few lines of matrices; the numbers are those of the tests' oracles."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from .equations import Contact
from .scene import Scene

TWO_DOF_M = np.diag([1.0, 0.02])
TWO_DOF_K = np.array([[640.0, -40.0], [-40.0, 40.0]])
ONSET = 0.134  #: m, amplitude at which the second mass of the two-dof oscillator begins to slip (limit 5 N)


def number(x: float) -> str:
    """Short text of a number for names."""
    return f"{x:.0e}" if x and (abs(x) >= 1e4 or abs(x) < 1e-2) else f"{x:g}"


def mode(
    method: str = "CNM", H: int = 7, samples: int = 256, amplitude: Any = (0.02, 3.0), **more: Any
) -> dict[str, Any]:
    """An [[analysis]] of a mode normalised on x0."""
    base = {"type": "mode", "method": method, "harmonics": H, "samples": samples, "normalise": "x0"}
    return {**base, "amplitude": [float(a) for a in amplitude], **more}


def forced(w: Any, levels: Any = (1.0,), H: int = 9, samples: int = 512, **more: Any) -> dict[str, Any]:
    """An [[analysis]] of the response of x0 to a force on x0, angular frequencies w."""
    hertz = [float(x) / (2 * np.pi) for x in w]
    base = {"type": "forced", "harmonics": H, "samples": samples, "force": {"x0": 1.0}, "observe": "x0"}
    return {**base, "levels": [float(x) for x in levels], "frequency": hertz, **more}


def _rows(B: Any) -> Any:
    return B if sp.issparse(B) else np.atleast_2d(B)


def coulomb(limit: float, eps: float, B: Any, name: str = "damper") -> Contact:
    """Regularised friction on rows B."""
    return Contact(name, "regularised_coulomb", _rows(B), {"friction_limit": limit, "regularisation_velocity": eps})


def jenkins(kt: Any, limit: Any, B: Any, name: str = "damper") -> Contact:
    """Elastic sliders on rows B."""
    return Contact(name, "jenkins", _rows(B), {"tangential_stiffness": kt, "friction_limit": limit})


def pad(kn: Any, kt: Any, mu: Any, load: Any, gap: Any, B: Any, name: str = "pad") -> Contact:
    """3-D contact on rows B, three a pair."""
    values = {
        "normal_stiffness": kn,
        "tangential_stiffness": kt,
        "friction_coefficient": mu,
        "normal_load": load,
        "gap": gap,
    }
    return Contact(name, "coulomb_3d", B, values)


def two_dof(axis: str, name: str, analysis: dict[str, Any], contact: Contact | None = None, **more: Any) -> Scene:
    """The oscillator of Laxalde et al. (2008): x1 rubs on ground."""
    contact = contact or coulomb(5.0, 0.05, [0.0, 1.0])
    return Scene(axis, name, more.pop("M", TWO_DOF_M), more.pop("K", TWO_DOF_K), [contact], analysis, **more)


def single(
    axis: str, name: str, analysis: dict[str, Any], contact: Contact, m: float = 1.0, k: float = 1.0, **more: Any
) -> Scene:
    """One mass on one spring."""
    return Scene(axis, name, np.array([[m]]), np.array([[k]]), [contact], analysis, **more)


def block(axis: str, name: str, analysis: dict[str, Any], contact: Contact, **more: Any) -> Scene:
    """Two nodes of three dofs in a row (x0 to x2 and x3 to x5), the first held, the second on a pad (normal x3).

    The springs are oblique, so that normal and tangential motions are coupled.
    """
    k1 = np.array([[3.0, 0.6, 0.3], [0.6, 2.0, 0.4], [0.3, 0.4, 1.0]])
    k2 = np.array([[2.0, 0.5, 0.2], [0.5, 1.5, 0.3], [0.2, 0.3, 1.2]])
    K = more.pop("stiffness", 1.0) * np.block([[k1 + k2, -k2], [-k2, k2]])
    return Scene(axis, name, np.eye(6), K, [contact], analysis, preload=more.pop("preload", True), **more)


BLOCK_B = np.hstack([np.zeros((3, 3)), np.eye(3)])


def chain(n: int, spring: float = 1.0, ground: float = 0.1) -> tuple[Any, Any]:
    """Matrices of n unit masses in a row, each held to ground too."""
    K = sp.diags(
        [np.r_[1.0, 2 * np.ones(n - 2), 1.0] if n > 1 else [0.0], -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]
    )
    return sp.identity(n, format="csr"), sp.csr_matrix(spring * K + ground * sp.identity(n))
