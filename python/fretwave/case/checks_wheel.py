"""Checks of the keys that put an analysis on the whole wheel: `wheel`, `wave`, `mistuning`, `sector`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..model.structure import Structure
from ..texts import nearest
from .reporter import Found, Reporter
from .schema import AnalysisSection, HarmonicSection, MistuningSection, ModeAnalysis
from .toml.source import Source


def check_wheels(
    source: Source,
    analyses: Mapping[int, AnalysisSection],
    neighbours: Structure | None,
    dofs: Sequence[str] | None,
    found: Found,
) -> None:
    """All that is wrong with analyses of the whole wheel.

    Parameters
    ----------
    dofs : of one sector
    """
    for number, analysis in analyses.items():
        if isinstance(analysis, HarmonicSection):
            report = Reporter(source, ("analysis", number), found)
            if analysis.wheel and neighbours is None:
                report.wrong(
                    ("wheel",), "is of no sector of a wheel", "a model with sectors", "remove the key, or add sectors"
                )
            _check_needs_wheel(report, analysis)
            if neighbours is not None:
                _check_on_wheel(report, analysis, neighbours, len(dofs or ()))


def _check_needs_wheel(report: Reporter, analysis: HarmonicSection) -> None:
    """Keys that mean something on a whole wheel alone."""
    standing = isinstance(analysis, ModeAnalysis) and analysis.wave == "standing"
    given = {"mistuning": analysis.mistuning is not None, "sector": analysis.sector is not None, "wave": standing}
    for key in (key for key, is_given in given.items() if is_given and not analysis.wheel):
        report.wrong((key,), "needs the whole wheel", "beside `wheel = true`", "add `wheel = true`, or remove the key")


def _check_on_wheel(report: Reporter, analysis: HarmonicSection, neighbours: Structure, n_dof: int) -> None:
    n, diameters = neighbours.sectors, analysis.nodal_diameter
    if analysis.sector is not None and analysis.sector >= n:
        report.wrong(("sector",), "does not exist", f"0 to {n - 1}", "write `sector = 0`, or leave the key out")
    if isinstance(analysis, ModeAnalysis) and analysis.wave == "standing":
        if analysis.mistuning is not None:
            fix = "remove it: the deviations decide how a mode stands"
            report.wrong(("wave",), "is of a tuned wheel", "no `wave` beside `mistuning`", fix)
        elif diameters is not None and not 0 < 2 * diameters < n:
            fix = "remove the key: this wave stands still" if 2 * diameters % n == 0 else "give the diameters a plus"
            report.wrong(
                ("wave",), f"cannot be told apart at nodal_diameter = {diameters}", f"1 to {(n - 1) // 2}", fix
            )
    if analysis.mistuning is not None:
        _check_mistuning(
            Reporter(report.source, (*report.path, "mistuning"), report.found), analysis.mistuning, neighbours
        )
        if diameters is None and n_dof and analysis.linear_mode > n * n_dof:
            expected = f"1 to {n * n_dof}, the number of the wheel's dofs"
            report.wrong(("linear_mode",), "does not exist", expected, "write `linear_mode = 1`")


def _check_mistuning(report: Reporter, mistuning: MistuningSection, neighbours: Structure) -> None:
    if mistuning.of not in neighbours.parts:
        known = list(neighbours.parts)
        fix = nearest(mistuning.of, known) or "name a part that the builder gives (Structure.parts)"
        report.wrong(("of",), "is no part of the stiffness", f"one of {', '.join(known)}", fix)
    given, drawn = mistuning.deviations, mistuning.standard_deviation
    if given is None and drawn is None:
        fix = "add for example `standard_deviation = 0.02`"
        report.wrong((), "says no deviations", "standard_deviation, or deviations", fix)
    if given is not None:
        for key in ("standard_deviation", "seed"):
            if key in mistuning.model_fields_set:
                report.wrong((key,), "is given beside deviations", "deviations drawn, or given", "remove one of them")
        if len(given) != neighbours.sectors:
            expected = f"{neighbours.sectors} numbers, one for each sector"
            report.wrong(("deviations",), f"has {len(given)} numbers", expected, "give one for each sector")
