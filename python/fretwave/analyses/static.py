"""``type = "static"``: the static state under the preload, pair by pair."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..columns import Column
from ..contacts import ContactSpec
from ..errors import NotConverged
from ..schema import StaticAnalysis
from .context import AnalysisContext, Outcome
from .rest import keep_pairs, rest_state

COLUMNS = (
    Column("point", "1", "number of the row", "i"),
    Column("factor", "1", "factor on the loads"),
    Column("contact", "", "name of the contact", "s"),
    Column("pair", "1", "number of the pair", "i"),
    Column("x", "m", "place of the pair"),
    Column("y", "m", "place of the pair"),
    Column("z", "m", "place of the pair"),
    Column("normal_force", "N", "compressive normal force"),
    Column("tangential_force", "N", "magnitude of the tangential force"),
    Column("status", "", "stick, slip or open", "s"),
    Column("gap", "m", "distance to contact of an open pair"),
)
#: A pair slips when its tangential force is this near to its limit.
AT_LIMIT = 1e-9


def run_static(context: AnalysisContext) -> Outcome:
    """Solve the static state at every load factor. Collective."""
    analysis = context.analysis
    assert isinstance(analysis, StaticAnalysis)
    context.leave_out([] if section_loads(context) else ["static loads (there are none: only the pairs' own act)"])
    writer = context.writer(COLUMNS)
    summary: list[str] = []
    failure = None
    try:
        for factor in sorted(analysis.factors):
            rest = rest_state(context, factor)
            for row in _rows(context, rest, factor):
                writer.append({**row, "point": writer.rows})
            summary += _summary(context, rest, factor)
    except NotConverged as error:
        failure = error
    reason = "all factors solved" if failure is None else f"factor {factor:g}: {failure.measured}"
    if writer.rows:
        keep_pairs(context, writer)
    writer.close("done" if failure is None else "stopped", reason)
    advice = failure.fix or "" if failure is not None else ""
    return Outcome(writer.rows, reason, failure is None, summary, "a static state at every load factor", advice)


def section_loads(context: AnalysisContext) -> list[str]:
    """Names of the static loads that act."""
    section = context.case.preload_of(context.analysis)
    return section.loads if section else []


def _rows(context: AnalysisContext, rest: Any, factor: float) -> Iterator[dict[str, Any]]:
    """One row for each pair, on every rank."""
    contacts = context.comm.bcast(rest.contacts)
    for spec, state in zip(context.case.contacts, contacts):
        built = context.case.built.contacts.get(spec.name) if context.case.built else None
        points = built.points if built is not None else None
        for pair in range(spec.n_pairs):
            place = (np.nan,) * 3 if points is None else points[pair]
            yield {
                "factor": factor,
                "contact": spec.name,
                "pair": pair,
                **dict(zip("xyz", place)),
                **pair_state(spec, state["u"][:, pair], state["f"][:, pair], pair),
            }


def pair_state(spec: ContactSpec, u: Any, f: Any, pair: int) -> dict[str, Any]:
    """Forces, status and gap of one pair.

    Parameters
    ----------
    u, f : (components,) relative displacement and force; with three components the first is normal, > 0 closing
    """

    def value(name: str) -> float:
        return float(np.broadcast_to(spec.parameters.get(name, np.nan), (spec.n_pairs,))[pair])

    if spec.components == 1:
        normal, tangential, limit, gap = np.nan, abs(float(f[0])), value("friction_limit"), np.nan
        is_open = False
    else:
        normal, tangential = float(f[0]), float(np.hypot(f[1], f[2]))
        limit, is_open = value("friction_coefficient") * normal, normal <= 0
        # The law's N = N0 + kn (u_n - gap) is negative by kn times the distance (src/contact/coulomb_3d.h).
        gap = max(0.0, value("gap") - u[0] - spec_load(spec, pair) / value("normal_stiffness")) if is_open else 0.0
    slips = bool(tangential >= (1 - AT_LIMIT) * limit)
    status = "open" if is_open else "slip" if slips else "stick"
    return {"normal_force": normal, "tangential_force": tangential, "status": status, "gap": gap}


def spec_load(spec: ContactSpec, pair: int) -> float:
    """Normal load of a pair as its law has it [N]."""
    return float(np.broadcast_to(spec.parameters.get("normal_load", 0.0), (spec.n_pairs,))[pair])


def _summary(context: AnalysisContext, rest: Any, factor: float) -> list[str]:
    """Status of the pairs and balance of the forces."""
    lines = []
    contacts = context.comm.bcast(rest.contacts)
    for spec, state in zip(context.case.contacts, contacts):
        rows = [pair_state(spec, state["u"][:, k], state["f"][:, k], k) for k in range(spec.n_pairs)]
        count = {word: sum(row["status"] == word for row in rows) for word in ("stick", "slip", "open")}
        forces = np.array([row["normal_force"] for row in rows])
        text = f"{context.name}: factor {factor:g}, contact '{spec.name}': " + ", ".join(
            f"{number} {word}" for word, number in count.items()
        )
        if spec.components == 3:
            text += f"; normal forces {forces.min():.4g} to {forces.max():.4g} N, sum {forces.sum():.6g} N"
        lines += [text, *_resultant(context, spec, state["f"])]
    if section_loads(context):
        lines.append(f"{context.name}: imbalance of the forces {rest.imbalance:.1e} of the load")
    return lines


def _resultant(context: AnalysisContext, spec: ContactSpec, f: Any) -> list[str]:
    """Sum of the contact forces in space, beside that of the loads (dof = 3 * node + axis)."""
    built = context.case.built
    frames = built.contacts[spec.name].frames if built and spec.name in built.contacts else None
    names = section_loads(context)
    if frames is None or built is None or built.displacements is not None or not names:
        return []
    total = np.einsum("kcx,ck->x", frames, f)
    loads = np.sum([built.loads[name] for name in names], axis=0).reshape(-1, 3).sum(axis=0)
    shown = [", ".join(f"{value:.5g}" for value in vector) for vector in (total, loads)]
    return [f"{context.name}: contact carries ({shown[0]}) N along x, y, z of the loads' ({shown[1]}) N at factor 1"]
