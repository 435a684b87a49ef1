"""``[model] at_speed``: K + Omega^2 K2 through the stiffness of a model at rest and at one or two speeds.

With ``[model] speed_rpm`` the model turns: K is that at this speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..model.checks import check_symmetric
from ..model.sectors import Sparse
from ..model.structure import SPIN, Structure
from ..texts import number_in
from . import matrices
from .fields import FASTEST, SLOWEST, Matrix
from .origin import read_file
from .reporter import Found
from .schema import ModelSection
from .toml.locate import Path as KeyPath
from .toml.source import Source

#: Mass matrices of one model at two speeds differ by less.
SAME_MASS = 1e-9
#: Share of a mesh's stiffness that rotation does not change: stresses are some thousandths of the modulus.
MOST_CHANGED = 0.3
SHELLS = ("triangle", "quadrilateral")
#: Share of the nodes of its cells that have dofs in a mesh that was not reduced.
MOST_MESHED = 0.5
#: Sizes of another model's stiffness over that at rest beyond which its stress stiffness, or other units, are meant.
LEAST_LEFT, MOST_GROWN = 0.5, 100.0
EXAMPLE = 'at_speed = { 3000 = "K3000.mtx" }'


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
        return _turning(section, structure), identity
    squares, changes = [], []
    for text, given in section.at_speed.items():
        key = ("model", "at_speed", text)
        square, read = (
            square_of(text, key, source, found, EXAMPLE),
            _stiffness(given, key, structure, source, notes, found),
        )
        if square is not None and read is not None:
            squares.append(square)
            changes.append(read[0] - at_rest)
            notes += _much(changes[-1], at_rest, structure, source.where(key), found)
            known[f"model.at_speed.{text}"] = read[1]
    if not changes:
        return structure, identity
    K2, left = least_squares(squares, changes, _size)
    if len(changes) > 1:
        notes.append(f"stiffness at speed: K + Omega^2 K2 leaves {100 * left:.2g} % of its change")
    return _turning(section, replace(structure, parts={**structure.parts, SPIN: sp.csr_matrix(K2)})), known


def _much(change: Sparse, at_rest: Sparse, structure: Structure, where: str, found: Found) -> list[str]:
    """An error where cells of solids change by more than any stress does; a note of other models that look so.

    A beam reduced to its tip changes rightly by most of its stiffness, with a table of its few dofs too.
    """
    size = _size(at_rest) or 1.0
    share, ratio = _size(change) / size, _size(at_rest + change) / size
    solid, changed = _is_solid(structure), f"K changes by {share:.2g} of that at rest"
    if solid and share > MOST_CHANGED:
        fix = "give elastic and stress stiffness in one K, in the units and the order of dofs of that at rest"
        expected = f"at most {MOST_CHANGED:g}, as stresses are some thousandths of the modulus"
        found.append(InputError("the stiffness at speed is not that of this mesh", where, changed, expected, fix))
    if solid:
        return []
    if not LEAST_LEFT < ratio < MOST_GROWN:
        changed = f"its entries are {ratio:.2g} of those at rest"
    elif structure.labels is None or share <= MOST_CHANGED:
        return []
    return [f"stiffness at speed: {changed}: is it all of K at this speed, and in the same units and order of dofs?"]


def _is_solid(structure: Structure) -> bool:
    """Its dofs are those of cells of solids: most nodes of these have some, as those of a reduced mesh have not."""
    tables = [structure.hexahedra, *(table for kind, table in structure.cells.items() if kind not in SHELLS)]
    found = [np.ravel(table) for table in tables if table is not None]
    if not found or structure.labels is None or structure.node_numbers is None:
        return False
    meshed = np.asarray(structure.node_numbers)[np.unique(np.concatenate(found))]
    return bool(np.isin(meshed, structure.labels[:, 0]).mean() >= MOST_MESHED)


def _turning(section: ModelSection, structure: Structure) -> Structure:
    """The structure at the speed of the case."""
    if not section.speed_rpm or SPIN not in structure.parts:
        return structure
    return structure.stiffened(SPIN, omega_squared(section.speed_rpm))


def omega_squared(speed_rpm: float) -> float:
    """Of the angular velocity [rad^2/s^2]."""
    return float((2 * np.pi * speed_rpm / 60) ** 2)


def least_squares(squares: Sequence[float], given: Sequence[Any], size: Callable[[Any], float]) -> tuple[Any, float]:
    """A2 of Omega^2 A2 through what is given at speeds of these Omega^2, and the largest share that it leaves."""
    A2 = sum(w * A for w, A in zip(squares, given)) / sum(w * w for w in squares)
    left = max(size(A - w * A2) / (size(A) or 1.0) for w, A in zip(squares, given))
    return A2, float(left)


def known_parts(section: ModelSection, structure: Structure) -> list[str] | None:
    """Names of the parts of the stiffness; None where stiffness at speed could not be read."""
    lacks = section.at_speed is not None and SPIN not in structure.parts
    return None if lacks else list(structure.parts)


def _size(A: Sparse) -> float:
    return float(np.sqrt(A.multiply(A).sum()))


def square_of(text: str, key: KeyPath, source: Source, found: Found, example: str) -> float | None:
    """Omega^2 [rad^2/s^2]; None of what is no speed."""
    try:
        speed = number_in(text)
    except ValueError:
        speed = np.nan
    if SLOWEST <= speed <= FASTEST:
        return omega_squared(speed)
    what, fix = f"'{text}' is no speed of a turning model", f"write for example `{example}`"
    found.append(InputError(what, source.where(key), text, f"rev/min, {SLOWEST:g} to {FASTEST:g}", fix))
    return None


def _stiffness(
    given: Matrix, key: KeyPath, structure: Structure, source: Source, notes: list[str], found: Found
) -> tuple[Sparse, Any] | None:
    """K at a speed, on the dofs of the model at rest, and what identifies it; None when something is wrong."""
    digest: Any
    if isinstance(given, str) and given.lower().endswith(matrices.MODEL_FILE):
        read = read_file(given, key, source, found)
        if read is None:
            return None
        other, digest = read
        complaint, K = _other_model(structure, other), sp.csr_matrix(other.own("K"))
    else:
        loaded = matrices.load("K", given, source, notes, found, key)
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
