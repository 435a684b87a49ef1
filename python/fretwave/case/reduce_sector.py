"""The reduction that a case asks for its sector: before the faces are tied, and tied again on reduced coordinates."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..cyclic.waves import WaveError
from .checks_tables import waves_of
from .reduction_report import ReductionReport
from .schema import ReductionSection
from .sector import CutSector, fold

if TYPE_CHECKING:
    from ..cyclic.reduction import SectorReduction
    from ..hb.reduction_error import NonlinearError
    from .analysis import AnalysisSection
    from .load import Case


def reduce_sector_case(case: Case, comm: Any, modes: int | None = None) -> Case:
    """The case of a sector on its reduced matrices. Collective.

    Parameters
    ----------
    modes : int, optional
        Component modes, in place of the case's.
    """
    assert case.neighbours is not None and case.reduction is not None
    began = time.perf_counter()
    with sector_reduction_of(case, comm, modes) as reduction:
        cut, wall = cut_on(case.neighbours.cut, reduction), time.perf_counter() - began
        origin, contacts, neighbours = fold(cut, case.neighbours.sectors)
        loaded = {letter: matrix.values for letter, matrix in origin.matrices.items()}
        return replace(
            case,
            dofs=origin.dofs,
            M=loaded["M"],
            K=loaded["K"],
            C=loaded.get("C"),
            contacts=contacts,
            loads=dict(origin.built.loads) if origin.built else {},
            neighbours=neighbours,
            reduced=_report(case, reduction, wall),
            unreduced=case if case.reduction.error_at is not None else None,
        )


def wave_error_at(case: Case, analysis: AnalysisSection, problem: Any, y: Any) -> NonlinearError:
    """As `fretwave.case.reduce.nonlinear_error_at`, of a wave on a sector. Collective."""
    from ..cyclic.reduction_error import sector_nonlinear_error

    full = case.unreduced
    assert full is not None and full.neighbours is not None and case.reduced is not None
    preload, modes = full.preload_of(analysis), case.reduced.component_modes
    loads = [full.loads[name] for name in preload.loads] if preload is not None else []
    C = full.ahead_damping(full.damping_with(analysis.dampers)) or {}
    terms = (full.neighbours.with_own("K", full.K), C, full.neighbours.with_own("M", full.M))
    with sector_reduction_of(full, problem.model.comm, modes) as reduction:
        return sector_nonlinear_error(reduction, terms, problem, y, np.sum(loads, axis=0) if loads else None)


def sector_reduction_of(case: Case, comm: Any, modes: int | None = None) -> SectorReduction:
    """The reduction of a case's sector; the same whenever and on whatever ranks it is made. Collective."""
    from ..cyclic.reduction import reduce_sector
    from ..model.model import Contact

    neighbours, section = case.neighbours, case.reduction
    assert neighbours is not None and section is not None
    cut = neighbours.cut
    loaded = {letter: matrix.values for letter, matrix in cut.origin.matrices.items()}
    return reduce_sector(
        loaded["M"],
        loaded["K"],
        cut.low,
        cut.high,
        neighbours.sectors,
        loaded.get("C"),
        contacts=[Contact(c.law, c.rows, c.parameters, c.name) for c in cut.contacts],
        keep=np.array(case.keep, dtype=np.intp),
        axis=cut.axis,
        interface_diameters=section.interface_diameters if section.interface == "modes" else None,
        interface_waves=section.interface_waves,
        interface_tolerance=section.interface_tolerance,
        modes=section.modes if modes is None else modes,
        highest_hz=section.up_to_hz if modes is None else None,
        comm=comm,
    )


def cut_on(cut: CutSector, reduction: SectorReduction) -> CutSector:
    """The sector with both faces on the reduced coordinates. Collective."""
    from ..model.model import by_sector

    origin, built = cut.origin, cut.origin.built
    matrices = {
        letter: replace(matrix, values=sp.csr_matrix(getattr(reduction, letter)))
        for letter, matrix in origin.matrices.items()
    }
    if built is not None:
        unit = reduction.expand(np.eye(reduction.size)) if built.parts else None
        built = replace(
            built,
            dofs={name: reduction.places[dof] for name, dof in built.dofs.items() if dof in reduction.places},
            loads={name: reduction.project(load) for name, load in built.loads.items()},
            parts={name: sp.csr_matrix(reduction.project(part @ unit)) for name, part in built.parts.items()},
            axis=None,  # the reduced faces correspond as they are
            expansion=None,
        )
    rows = [sp.csr_matrix(by_sector(contact.B)[0]) for contact in reduction.contacts]
    return CutSector(
        replace(origin, matrices=matrices, dofs=_names(origin.dofs, reduction), built=built),
        [replace(contact, rows=B) for contact, B in zip(cut.contacts, rows)],
        reduction.low,
        reduction.high,
    )


def _names(dofs: list[str], reduction: SectorReduction) -> list[str]:
    """Kept dofs keep their names."""
    names = [""] * reduction.size
    for k in range(reduction.n_interface):
        names[reduction.low[k]], names[reduction.high[k]] = f"interface_{k + 1}", f"next_interface_{k + 1}"
    modes = len(reduction.component_hz)
    names[reduction.size - modes :] = [f"component_{k + 1}" for k in range(modes)]
    for dof, place in reduction.places.items():
        names[place] = dofs[dof]
    return names


def _report(case: Case, reduction: SectorReduction, wall: float) -> ReductionReport:
    began = time.perf_counter()
    assert case.reduction is not None
    diameters = _compared(case.reduction, case.analyses)
    errors = reduction.error(diameters, case.reduction.compare) if case.reduction.compare else []
    first = _plain(errors[0]) if errors else {"full_hz": [], "reduced_hz": [], "relative": []}
    return ReductionReport(
        unreduced=len(case.neighbours.cut.origin.dofs) if case.neighbours else 0,
        kept=int(reduction.low[0]),
        component_modes=len(reduction.component_hz),
        highest_component_hz=float(reduction.component_hz[-1]) if len(reduction.component_hz) else 0.0,
        full_hz=first["full_hz"],
        reduced_hz=first["reduced_hz"],
        relative=first["relative"],
        wall_s=round(wall, 3),
        compare_wall_s=round(time.perf_counter() - began, 3),
        interface=reduction.n_interface,
        waves=[_plain(error) for error in errors],
        wave_lines=[error.line() for error in errors],
    )


def _compared(section: ReductionSection, analyses: Mapping[str, AnalysisSection]) -> list[int]:
    """Nodal diameters whose error is stated: unless told, those of the analyses and of the interface modes."""
    if section.compare_diameters is not None:
        return section.compare_diameters
    found = [abs(d) for d in waves_of(analyses.values())] + list(section.interface_diameters or ())
    return list(dict.fromkeys(found)) or [0]


def _plain(error: WaveError) -> dict[str, Any]:
    """For run.json; rigid motions have no relative error (None)."""
    return {
        "nodal_diameter": error.nodal_diameter,
        "contact": error.state,
        "gave_interface_modes": error.gave_interface_modes,
        "full_hz": error.full_hz.tolist(),
        "reduced_hz": error.reduced_hz.tolist(),
        "relative": [float(e) if np.isfinite(e) else None for e in error.relative],
    }
