"""``[model] at_speed``: K + Omega^2 K2 through the stiffness of a model at rest and at one or two speeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import FretwaveError, InputError
from ..model.checks import check_symmetric
from ..model.sectors import Sparse
from ..model.structure import SPIN, Structure
from . import matrices
from .origin import read_file
from .schema import Matrix, ModelSection
from .toml.locate import Path as KeyPath
from .toml.source import Source

Found = list[FretwaveError]
#: Mass matrices of one model at two speeds differ by less.
SAME_MASS = 1e-9
MODEL_FILE = ".h5"


def with_speeds(
    section: ModelSection,
    source: Source,
    structure: Structure,
    identity: Mapping[str, Any],
    notes: list[str],
    found: Found,
) -> tuple[Structure, Mapping[str, Any]]:
    """The structure with the part that grows with the speed squared, and what identifies it.

    Of two speeds K2 is the least-squares fit, weighted as Omega^2 is; a note says what it leaves.
    """
    at_rest, known = structure.own("K"), dict(identity)
    if section.at_speed is None or at_rest is None:  # told where K is read
        return structure, identity
    squares, changes = [], []
    for text, given in section.at_speed.items():
        key = ("model", "at_speed", text)
        square, read = _square(text, key, source, found), _stiffness(given, key, structure, source, found)
        if square is not None and read is not None:
            squares.append(square)
            changes.append(read[0] - at_rest)
            known[f"model.at_speed.{text}"] = read[1]
    if not changes:
        return structure, identity
    K2 = sum(w * A for w, A in zip(squares, changes)) / sum(w * w for w in squares)
    left = max(_size(A - w * K2) / (_size(A) or 1.0) for w, A in zip(squares, changes))
    if len(changes) > 1:
        notes.append(f"stiffness at speed: K + Omega^2 K2 leaves {100 * left:.2g} % of its change")
    return replace(structure, parts={**structure.parts, SPIN: sp.csr_matrix(K2)}), known


def known_parts(section: ModelSection, structure: Structure) -> list[str] | None:
    """Names of the parts of the stiffness; None where stiffness at speed could not be read."""
    lacks = section.at_speed is not None and SPIN not in structure.parts
    return None if lacks else list(structure.parts)


def _size(A: Sparse) -> float:
    return float(np.sqrt(A.multiply(A).sum()))


def _square(text: str, key: KeyPath, source: Source, found: Found) -> float | None:
    """Omega^2 [rad^2/s^2]."""
    try:
        speed = float(text)
    except ValueError:
        speed = np.nan
    if np.isfinite(speed) and speed > 0:
        return float((2 * np.pi * speed / 60) ** 2)
    what, fix = f"'{text}' is no speed of a turning model", 'write for example `at_speed = { 3000 = "K3000.mtx" }`'
    found.append(InputError(what, source.where(key), text, "rev/min, above 0; K is that at rest", fix))
    return None


def _stiffness(
    given: Matrix, key: KeyPath, structure: Structure, source: Source, found: Found
) -> tuple[Sparse, Any] | None:
    """K at a speed, on the dofs of the model at rest, and what identifies it; None when something is wrong."""
    digest: Any
    if isinstance(given, str) and given.endswith(MODEL_FILE):
        read = read_file(given, key, source, found)
        if read is None:
            return None
        other, digest = read
        complaint, K = _other_model(structure, other), sp.csr_matrix(other.own("K"))
    else:
        loaded = matrices.load("K", given, source, found, key)
        if loaded is None:
            return None
        K, digest = loaded[0], loaded[2] or given
        complaint = _other_size(structure, K)
    if complaint:
        fix = "take the same mesh, with the same dofs in the same order"
        found.append(InputError("the stiffness at speed is of another model", source.where(key), complaint, None, fix))
        return None
    asymmetry = check_symmetric("K", K, source.where(key), structure.dof_names)
    if asymmetry is not None:
        found.append(asymmetry)
    return None if asymmetry else (K, digest)


def _other_size(structure: Structure, K: Sparse) -> str:
    n = len(structure.dof_names)
    return "" if K.shape[0] == n else f"{K.shape[0]} dofs, at rest {n}"


def _other_model(structure: Structure, other: Structure) -> str:
    """In what another structure is not the same at another speed, empty when it is."""
    if (other.units or structure.units) != structure.units:
        return f"units {other.units}, at rest {structure.units}"
    M, same = structure.own("M"), sp.csr_matrix(other.own("M"))
    if M is None or M.shape != same.shape:
        return _other_size(structure, same)
    away = _size(M - same) / _size(M)
    return f"its mass differs by {100 * away:.2g} %" if away > SAME_MASS else ""
