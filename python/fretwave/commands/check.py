"""``fretwave check``: is the case right, and what would run?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..case import checks
from ..case.build import build_model
from ..case.load import Case, load_case
from ..case.reduce import reduce_case
from ..case.schema import (
    AnalysisSection,
    FlutterAnalysis,
    ForcedAnalysis,
    HarmonicSection,
    ModeAnalysis,
    StaticAnalysis,
    SweepAnalysis,
    TransientSection,
    WearAnalysis,
)
from ..errors import EXIT_DONE
from ..mpi.guard import on_first_rank
from ..run.order import RunOptions, in_order
from ..run.runner import check_sweeps
from ..run.sweep_plan import table_plan
from ..texts import display


def check_case(path: Path, overrides: Sequence[str], only: Sequence[str], quick: bool, comm: Any) -> int:
    """Validate a case and print what would run. Collective.

    Raises
    ------
    CaseErrors
        All that is wrong; with the short form of ``[quick]`` too, when the case has one.
    """
    case = on_first_rank(comm, lambda: _load(path, overrides, quick))
    names = in_order(case, checks.choose(list(case.analyses), only))
    check_sweeps(case, names, RunOptions(overrides=list(overrides), quick=quick), comm)
    case = reduce_case(case, comm)
    with build_model(case, (), comm) as model:
        described = {name: describe(case.analyses[name], model) for name in names}
    if comm.rank == 0:
        print("\n".join(_report(case, described)))
    return EXIT_DONE


def _load(path: Path, overrides: Sequence[str], quick: bool) -> Case:
    case = load_case(path, overrides, quick)
    if not quick and case.has_quick:
        load_case(path, overrides, True)
    return case


def _report(case: Case, described: dict[str, list[str]]) -> list[str]:
    lines = [f"{display(case.path)}: no errors", case.title]
    shown = ", ".join(case.dofs[:8]) + (", ..." if len(case.dofs) > 8 else "")
    lines.append(f"  {len(case.dofs)} dofs: {shown}")
    for contact in case.contacts:
        count = contact.n_pairs
        values = ", ".join(f"{key} = {_short(value)}" for key, value in contact.parameters.items())
        lines.append(f"  contact '{contact.name}': {contact.law}, {count} contact pair{'s' * (count != 1)}, {values}")
    lines.extend(f"  {line}" for line in (case.reduced.lines() if case.reduced else ()))
    lines.extend(f"  note: {note}" for note in case.notes)
    for name, texts in described.items():
        lines.append(f"  {name}: {texts[0]}")
        lines.extend(f"    {text}" for text in texts[1:])
    return [line for line in lines if line]


def _short(value: Any) -> str:
    if isinstance(value, float) or value.min() == value.max():
        return f"{np.max(value):g}"
    return f"{value.min():g} to {value.max():g}"


def describe(analysis: AnalysisSection, model: Any) -> list[str]:
    """What an analysis would compute: a headline and details. Collective."""
    lines = [_headline(analysis)]
    if analysis.dampers:
        lines.append(
            "added dampers: " + ", ".join(f"{damper.c:g} N s/m at {damper.dof}" for damper in analysis.dampers)
        )
    if isinstance(analysis, HarmonicSection):
        from ..hb.problems import choose_harmonics

        harmonics = choose_harmonics(model, analysis.harmonics, analysis.samples, analysis.retain)
        n_dof = model.n_dof * (model.sectors if analysis.wheel else 1)
        lines.append(
            f"harmonics {_orders(harmonics.orders)}, {harmonics.samples} samples a period,"
            f" {n_dof} x {harmonics.block_size} = {n_dof * harmonics.block_size} coefficients"
        )
        if analysis.nodal_diameter is not None or analysis.wheel:
            lines.append(_wave_line(analysis, model.sectors))
        if harmonics.left_out:
            lines.append("left out: " + "; ".join(harmonics.left_out))
    return lines


def _wave_line(analysis: HarmonicSection, sectors: int) -> str:
    place = f"all {sectors} sectors" if analysis.wheel else f"one sector of {sectors}"
    if analysis.mistuning is not None:
        place = f"{place}, their '{analysis.mistuning.of}' stiffness mistuned"
    if analysis.nodal_diameter is None:
        return place
    wave = "standing wave" if getattr(analysis, "wave", "") == "standing" else "wave"
    return f"a {wave} of {analysis.nodal_diameter} nodal diameters on {place}"


def _headline(analysis: AnalysisSection) -> str:
    if isinstance(analysis, ModeAnalysis):
        low, high = analysis.amplitude
        start = f"nonlinear mode ({analysis.method}) from linear mode {analysis.linear_mode}"
        return f"{start}, a = {low:g} to {high:g} m of {analysis.normalise}"
    if isinstance(analysis, FlutterAnalysis):
        low, high = analysis.amplitude
        named = ", ".join(map(str, analysis.nodal_diameters or [])) or "all"
        start = f"flutter ({analysis.method}), nodal diameters {named}, linear mode {analysis.linear_mode}"
        return f"{start}, a = {low:g} to {high:g} m of {analysis.normalise}"
    if isinstance(analysis, ForcedAnalysis):
        low, high = analysis.frequency
        levels = ", ".join(f"{level:g}" for level in analysis.levels)
        order = f" to engine order {analysis.engine_order}" if analysis.engine_order else ""
        return f"forced response of {analysis.observe}{order}, {low:g} to {high:g} Hz, levels {levels}"
    if isinstance(analysis, StaticAnalysis):
        return f"static state at load factors {', '.join(f'{factor:g}' for factor in analysis.factors)}"
    if isinstance(analysis, SweepAnalysis):
        plan = table_plan(analysis.over)
        over = " x ".join(f"{key} = {', '.join(map(str, values))}" for key, values in plan.over.items())
        return f"'{analysis.of}' for every value of {over}: {len(plan)} branches"
    if isinstance(analysis, WearAnalysis):
        amplitudes = ", ".join(f"{amplitude:g}" for amplitude in analysis.amplitude)
        return f"wear of '{analysis.mode}' at a = {amplitudes} m over {analysis.cycles:g} normalised cycles"
    assert isinstance(analysis, TransientSection)
    kind = analysis.type.replace("_", " ")
    starts = ", ".join(f"{amplitude:g}" for amplitude in analysis.amplitude)
    return f"{kind} by time integration from '{analysis.mode}', starts a = {starts} m, {analysis.periods} periods"


def _orders(orders: Sequence[int]) -> str:
    """``1, 3, ..., 21`` for an even spacing, all of them otherwise."""
    steps = {after - before for before, after in zip(orders, orders[1:])}
    if len(orders) > 4 and len(steps) == 1:
        return f"{orders[0]}, {orders[1]}, ..., {orders[-1]}"
    return ", ".join(str(order) for order in orders)
