"""``type = "static"``: the static state under the preload, pair by pair."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal, Optional

import numpy as np

from ..arrays import Array
from ..case.analysis import AnalysisSection, register_analysis
from ..case.fields import Size, key
from ..case.schema import PreloadSection
from ..columns import Column
from ..errors import InputError, NotConverged
from ..model.contact import Contact
from ..model.law_info import STATUS
from ..post.contact_history import normal_force, tangential_force
from ..results.file import ENDED
from ..results.summaries import STATES_AT_REST
from .parts.at_rest import static_at_rest
from .parts.context import AnalysisContext, Outcome
from .parts.rest import keep_pairs, loaded_state

if TYPE_CHECKING:
    from ..case.facts import Facts
    from ..case.reporter import Reporter
    from ..model.rest import Rest

COLUMNS = (
    Column("point", "1", "number of the row", "i"),
    Column("factor", "1", "factor on the loads"),
    Column("contact", "", "name of the contact", "s"),
    Column("pair", "1", "number of the pair", "i"),
    Column("x", "length", "place of the pair"),
    Column("y", "length", "place of the pair"),
    Column("z", "length", "place of the pair"),
    Column("normal_force", "force", "compressive normal force"),
    Column("tangential_force", "force", "magnitude of the tangential force"),
    Column("status", "", "stick, slip or open", "s"),
    Column("gap", "length", "distance to contact of an open pair"),
)
#: Names of the states as the laws number them.
WORDS = {state: word for word, state in STATUS.items()}


@register_analysis
class StaticAnalysis(AnalysisSection):
    """``type = "static"``: the static state under the preload, pair by pair."""

    summary = STATES_AT_REST

    type: Literal["static"]
    factors: list[Size] = key("factors on the loads of the preload", "-", "[0.5, 1.0]", default=[1.0], min_length=1)
    preload: Optional[PreloadSection] = key(
        "in place of [preload]", example='{ loads = ["centrifugal"] }', default=None
    )

    def own_preload(self) -> Optional[PreloadSection]:
        return self.preload

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        section = self.preload or facts.preload
        if self.factors != [1.0] and not (section and section.loads):
            fix = 'remove the key, or name loads: `preload = { loads = ["centrifugal"] }`'
            report.wrong(("factors",), "has no load to act on", "static loads in [preload]", fix)

    def headline(self) -> str:
        return f"static state at load factors {', '.join(f'{factor:g}' for factor in self.factors)}"

    def at_rest(self, context: AnalysisContext[StaticAnalysis]) -> tuple[list[str], list[InputError]]:
        return static_at_rest(context, max(self.factors)) if context.case.contacts else ([], [])

    def run(self, context: AnalysisContext[StaticAnalysis]) -> Outcome:
        """Solve the static state at every load factor. Collective."""
        context.leave_out([] if section_loads(context) else ["static loads (there are none: only the pairs' own act)"])
        writer = context.writer(COLUMNS)
        summary: list[str] = []
        solved: list[float] = []
        failure = None
        try:
            for factor in sorted(self.factors):
                rest = loaded_state(context, factor)
                for row in _rows(context, rest, factor):
                    writer.append({**row, "point": writer.rows})
                summary += _summary(context, rest, factor)
                solved.append(factor)
        except NotConverged as error:
            failure = error
        reason = "all factors solved" if failure is None else f"factor {factor:g}: {failure.measured}"
        if writer.rows:
            keep_pairs(context, writer)
        writer.close("done" if failure is None else "stopped", reason, **{ENDED: json.dumps(solved)})
        advice = failure.fix or "" if failure is not None else ""
        return Outcome(writer.rows, reason, failure is None, summary, "a static state at every load factor", advice)


def section_loads(context: AnalysisContext[StaticAnalysis]) -> list[str]:
    """Names of the static loads that act."""
    section = context.case.preload_of(context.analysis)
    return section.loads if section else []


def _rows(context: AnalysisContext[StaticAnalysis], rest: Rest, factor: float) -> Iterator[dict[str, Any]]:
    """One row for each pair, on every rank."""
    contacts = context.comm.bcast(rest.contacts)
    for spec, state in zip(context.case.contacts, contacts):
        points = spec.pairs.points
        for pair in range(spec.n_pairs):
            place = (np.nan,) * 3 if points is None else points[pair]
            yield {
                "factor": factor,
                "contact": spec.name,
                "pair": pair,
                **dict(zip("xyz", place)),
                **pair_state(spec, state, pair),
            }


def pair_state(spec: Contact, state: Mapping[str, Any], pair: int) -> dict[str, Any]:
    """Forces, status and gap of one pair, the last two as its law tells them.

    Parameters
    ----------
    state : force f (components, n_pairs), status and gap (n_pairs,)
    """
    f, normal = state["f"][:, pair : pair + 1], spec.info.normal
    return {
        "normal_force": float(normal_force(f, normal)[0]),
        "tangential_force": float(tangential_force(f, normal)[0]),
        "status": WORDS[int(state["status"][pair])],
        "gap": float(state["gap"][pair]),
    }


def _summary(context: AnalysisContext[StaticAnalysis], rest: Rest, factor: float) -> list[str]:
    """Status of the pairs and balance of the forces."""
    lines, unit = [], context.units("force")
    contacts = context.comm.bcast(rest.contacts)
    for spec, state in zip(context.case.contacts, contacts):
        rows = [pair_state(spec, state, pair) for pair in range(spec.n_pairs)]
        count = {word: sum(row["status"] == word for row in rows) for word in WORDS.values()}
        forces = np.array([row["normal_force"] for row in rows])
        text = f"{context.name}: factor {factor:g}, contact '{spec.name}': " + ", ".join(
            f"{number} {word}" for word, number in count.items()
        )
        if spec.info.normal is not None:
            text += f"; normal forces {forces.min():.4g} to {forces.max():.4g} {unit}, sum {forces.sum():.6g} {unit}"
        lines += [text, *_resultant(context, spec, state["f"])]
    if section_loads(context):
        lines.append(f"{context.name}: imbalance of the forces {rest.imbalance:.1e} of the load")
    return lines


def _resultant(context: AnalysisContext[StaticAnalysis], spec: Contact, f: Array) -> list[str]:
    """Sum of the contact forces in space, beside that of the loads."""
    frames, loads = spec.pairs.frames, context.case.structure.resultant(section_loads(context))
    if frames is None or loads is None:
        return []
    total = np.einsum("kcx,ck->x", frames, f)
    unit = context.units("force")
    found, given = (f"({', '.join(f'{value:.5g}' for value in vector)}) {unit}" for vector in (total, loads))
    return [f"{context.name}: contact carries {found} along x, y, z of the loads' {given} at factor 1"]
