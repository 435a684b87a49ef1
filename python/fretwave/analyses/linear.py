"""``type = "linear"``: frequencies and shapes with the contact stuck, sliding and free, and what engine orders meet.

With ``wheel = true`` those of all sectors, tuned or mistuned, and how far mistuning amplifies a forced response.

The three limits are those that the backbone of a nonlinear mode runs between: every pair closed and stuck, closed and
sliding without friction, and no contact at all. Pairs count as closed whatever the loads at rest are.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Optional

import numpy as np
from pydantic import Field

from ..case.analysis import AnalysisSection, register_analysis
from ..case.analysis_tables import MistuningSection
from ..case.checks_common import about
from ..case.checks_wheel import check_mistuning, check_needs_wheel
from ..case.fields import Dof, Speed, SpeedOrRest, Whole, key
from ..model.contact import LIMITS
from ..model.structure import SPIN
from ..post.engine_orders import excited_by, usual_orders
from ..results.summaries import AMPLIFIED, LINEAR_MODES
from ..texts import counted, nearest, toml, without_nan
from .parts.asymptotes import sector_phase
from .parts.context import AnalysisContext, Outcome
from .parts.gyroscopic import gyroscopic_lines, gyroscopic_shift
from .parts.linear_waves import columns_of, crossings_of, modes_of_wave
from .parts.linear_wheel import AMPLIFICATION, AROUND, amplification_lines, amplifications, around_wheel, undamped

if TYPE_CHECKING:
    from ..case.case import Case
    from ..case.facts import Facts
    from ..case.reporter import Reporter
    from ..errors import InputError
    from ..model.modes import LinearMode

#: Time samples of a period in views.
SAMPLES = 96
#: Crossings told on the terminal.
TOLD = 3


@register_analysis
class LinearAnalysis(AnalysisSection):
    """``type = "linear"``: linear modes, of a sector over nodal diameters; crossings with engine orders."""

    pictures = ("safe", "campbell")
    summary = LINEAR_MODES

    type: Literal["linear"]
    modes: Whole = key("linear modes of each contact and wave, from the lowest", example="6", default=6, ge=1)
    contact: Optional[list[Literal["stuck", "sliding", "free"]]] = key(
        "every pair closed and stuck, closed and sliding without friction, or no contact; all that differ unless told",
        example='["stuck", "free"]',
        default=None,
        min_length=1,
    )
    nodal_diameters: Optional[list[Annotated[Whole, Field(ge=0)]]] = key(
        "waves of a sector, all unless told", example="[0, 1, 2, 3]", default=None, min_length=1
    )
    speed_rpm: Optional[Speed] = key("operating speed of the crossings' margins", "rev/min", "3000.0", default=None)
    up_to_rpm: Optional[Speed] = key(
        "highest speed of the Campbell diagram (1.25 times speed_rpm unless told)", "rev/min", "4000.0", default=None
    )
    engine_orders: Optional[list[Annotated[Whole, Field(ge=1)]]] = key(
        "orders whose crossings are sought; unless told ND and N - ND of each wave, of a structure 1 to 6",
        example="[4, 20]",
        default=None,
        min_length=1,
    )
    speeds_rpm: Optional[list[SpeedOrRest]] = key(
        "speeds at which modes are found, of a model whose stiffness depends on it ([model] at_speed)",
        "rev/min",
        "[0.0, 1500.0, 3000.0]",
        default=None,
        min_length=2,
    )
    wheel: bool = key("modes of all sectors of the wheel in place of waves on one", example="true", default=False)
    mistuning: Optional[MistuningSection] = key(
        "deviations of the wheel's sectors", example='{ of = "blade", standard_deviation = 0.02 }', default=None
    )
    observe: Optional[Dof] = key(
        "dof of a sector whose amplitudes around the wheel are told of every mode", example='"tip"', default=None
    )
    engine_order: Optional[Whole] = key(
        "of a force at `observe` in every sector: largest peak of the mistuned wheel over that of the tuned one",
        example="4",
        default=None,
        ge=1,
    )
    spin_stiffness: str = key(
        "part K2 of the model's stiffness [mass] with speeds_rpm: K + Omega^2 K2", example='"spin"', default=SPIN
    )

    def whole_wheel(self) -> tuple[bool, Optional[MistuningSection]]:
        return self.wheel, self.mistuning

    def kept_dofs(self) -> list[str]:
        return [*super().kept_dofs(), *([] if self.observe is None else [self.observe])]

    def limits(self, normal: bool, any_contact: bool) -> list[str]:
        """Linear limits of the contact that it looks at: those it names, or all that differ."""
        if self.contact is not None:
            return [limit for limit in LIMITS if limit in self.contact]
        differ = {"stuck": any_contact, "sliding": normal, "free": True}
        return [limit for limit in LIMITS if differ[limit]]

    def waves(self, sectors: int) -> list[int]:
        """Nodal diameters that it looks at, ascending; of a structure (no sectors) 0."""
        if not sectors:
            return [0]
        return sorted(set(self.nodal_diameters or range(sectors // 2 + 1)))

    def spins(self) -> tuple[str, list[float]]:
        return self.spin_stiffness, list(self.speeds_rpm or [])

    def speeds(self) -> list[float]:
        """Speeds [rev/min] at which it finds modes: 0 where they are the same at all."""
        return [0.0] if self.speeds_rpm is None else list(self.speeds_rpm)

    def orders(self, sectors: int) -> list[int]:
        """Engine orders whose crossings it seeks; none without an operating speed."""
        if self.speed_rpm is None:
            return []
        return sorted(set(self.engine_orders or usual_orders(self.waves(sectors), sectors)))

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        self._check_waves(report, facts)
        if facts.complete and not facts.contacts and set(self.contact or ()) - {"free"}:
            report.wrong(("contact",), "is of a model without contact", '["free"]', "remove the key")
        self._check_wheel(report, facts)
        self._check_operating_speed(report)
        self._check_spin(report, facts)

    def _check_waves(self, report: Reporter, facts: Facts) -> None:
        if facts.model_known and facts.sectors is None and self.nodal_diameters is not None:
            fix = "remove the key, or give [model] its sectors"
            about(
                report, "nodal_diameters", "has nodal diameters, but no sector of a wheel", "a model with sectors", fix
            )
        for index, diameters in enumerate(self.nodal_diameters or []):
            if facts.sectors is not None and diameters > facts.sectors // 2:
                expected = f"0 .. {facts.sectors // 2} of {facts.sectors} sectors"
                report.wrong(("nodal_diameters", index), "is no wave of this wheel", expected, "take it out")
        for index, order in enumerate(self.engine_orders or []):
            excited = excited_by(order, facts.sectors) if facts.sectors else None
            if excited is not None and excited not in self.waves(facts.sectors or 0):
                fix = f"take it out, or add {excited} to nodal_diameters"
                expected = f"an order of its waves; {order} excites {counted(excited, 'nodal diameter')}"
                report.wrong(("engine_orders", index), "excites none of the waves", expected, fix)

    def check_chosen(self, case: Case) -> list[InputError]:
        """The response to an engine order needs damping; of single modes that lack it the run says so."""
        if self.engine_order is None or case.damped(self.dampers).C is not None:
            return []
        return [undamped(self.name, "no damping")]

    def _check_wheel(self, report: Reporter, facts: Facts) -> None:
        if self.wheel and facts.model_known and facts.neighbours is None:
            fix = "remove the key, or add sectors"
            report.wrong(("wheel",), "is of no sector of a wheel", "a model with sectors", fix)
        for name in ("mistuning", "observe", "engine_order"):
            if getattr(self, name) is not None:
                check_needs_wheel(report, self, name)
        if self.wheel and self.nodal_diameters is not None:
            report.wrong(("nodal_diameters",), "are waves on one sector", "modes of the whole wheel", "remove the key")
        if self.observe is not None:
            report.dof(("observe",), self.observe, facts.named)
        elif self.engine_order is not None:
            fix = 'add for example `observe = "tip"`'
            report.wrong(("engine_order",), "drives no dof", "`observe` beside it", fix)
        if self.engine_order is not None and self.speeds_rpm is not None:
            fix = "remove one of the keys, or take [model] speed_rpm"
            report.wrong(("engine_order",), "is given beside speeds_rpm", "one speed", fix)
        if self.mistuning is not None and facts.neighbours is not None:
            check_mistuning(report, self.mistuning, facts.neighbours)

    def _check_operating_speed(self, report: Reporter) -> None:
        if self.speed_rpm is None:
            for name in ("engine_orders", "up_to_rpm"):
                if getattr(self, name) is not None:
                    what, fix = (
                        "says no operating speed to measure margins from",
                        "add for example `speed_rpm = 3000.0`",
                    )
                    report.wrong((name,), what, "speed_rpm beside it", fix)
        elif self.up_to_rpm is not None and not self.up_to_rpm > self.speed_rpm:
            fix = f"write `up_to_rpm = {1.25 * self.speed_rpm:g}`, or leave the key out"
            report.wrong(("up_to_rpm",), "leaves out the operating speed", f"more than {self.speed_rpm:g}", fix)

    def _check_spin(self, report: Reporter, facts: Facts) -> None:
        speeds, parts = self.speeds_rpm, facts.parts
        if speeds is None:
            if "spin_stiffness" in self.model_fields_set:
                fix = "add for example `speeds_rpm = [0.0, 3000.0]`, or remove the key"
                report.wrong(("spin_stiffness",), "acts at no speed", "speeds_rpm beside it", fix)
            return
        if any(not before < after for before, after in zip(speeds, speeds[1:])):
            report.wrong(
                ("speeds_rpm",),
                "is out of order",
                "ascending speeds",
                f"write `speeds_rpm = {toml(sorted(set(speeds)))}`",
            )
        if parts is not None and self.spin_stiffness not in parts:
            fix = (
                nearest(self.spin_stiffness, parts) or 'add for example `at_speed = { 3000 = "K3000.mtx" }` to [model]'
            )
            what, name = "needs a model whose stiffness depends on the speed", self.spin_stiffness
            report.wrong(("speeds_rpm",), what, f"a part '{name}', from [model] at_speed or the builder", fix)

    def headline(self) -> str:
        named = "" if self.nodal_diameters is None else f", nodal diameters {', '.join(map(str, self.nodal_diameters))}"
        contact = "each contact that differs" if self.contact is None else f"contact {', '.join(self.contact)}"
        about_speed = "" if self.speed_rpm is None else f", crossings about {self.speed_rpm:g} rev/min"
        named += "" if not self.wheel else ", of the whole wheel" + (", mistuned" if self.mistuning else "")
        over = "" if self.speeds_rpm is None else f", at {counted(len(self.speeds_rpm), 'speed')}"
        return f"{counted(self.modes, 'linear mode')} of {contact}{named}{over}{about_speed}"

    def run(self, context: AnalysisContext[LinearAnalysis]) -> Outcome:
        """Solve every wave in every limit of the contact, at every speed. Collective."""
        neighbours = context.case.neighbours
        sectors = neighbours.sectors if neighbours else 0
        columns = columns_of(sectors, self.speeds_rpm is not None)
        columns += AROUND if self.observe is not None else ()
        orders = json.dumps(self.orders(sectors))
        writer = context.writer(columns, ["1c", "1s"], samples=SAMPLES, sectors=sectors, engine_orders=orders)
        rows: list[dict[str, Any]] = []
        found: dict[str, list[LinearMode]] = {}
        C, shift = context.case.damped(self.dampers).C, 0.0
        for diameters in self.waves(sectors):
            for speed in self.speeds():
                wave: dict[str, list[LinearMode]] = {}
                for row, mode in modes_of_wave(context, diameters, speed):
                    wave.setdefault(row["contact"], []).append(mode)
                    rows.append({"point": writer.rows, **row, **around_wheel(context, mode)})
                    if speed == self.speeds()[-1]:
                        found.setdefault(row["contact"], []).append(mode)
                    writer.append(rows[-1], np.column_stack([mode.shape, -mode.imaginary]))
                theta = sector_phase(context.case, diameters)
                shift = max([shift, *(gyroscopic_shift(modes, C, theta) for modes in wave.values())])
        amplified = amplifications(context, found) if self.engine_order is not None else []
        summary = [*_summary(context, rows), *_meet(context, rows, sectors), *_amplify(context, amplified)]
        summary += gyroscopic_lines(self.name, shift)
        writer.close("done", "all modes", **({AMPLIFIED: json.dumps(without_nan(amplified))} if amplified else {}))
        return Outcome(writer.rows, "all modes", True, summary)


def _amplify(context: AnalysisContext[LinearAnalysis], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Write ``<name>_amplification.csv``; a line for each family. Collective."""
    if context.analysis.engine_order is None:
        return []
    context.write_table("amplification", {name: [row[name] for row in rows] for name in AMPLIFICATION})
    return amplification_lines(context.name, rows, context.wheel.sectors)


def _summary(context: AnalysisContext[LinearAnalysis], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each limit of the contact."""
    lines = []
    for limit in dict.fromkeys(row["contact"] for row in rows):
        own = [row for row in rows if row["contact"] == limit]
        waves = len({row["nodal_diameter"] for row in own})
        over = f" in {counted(waves, 'wave')}" if context.case.neighbours else ""
        elastic = [row["frequency_hz"] for row in own if row["frequency_hz"] > 0.0]
        rigid = f", {len(own) - len(elastic)} rigid at 0 Hz" if len(elastic) < len(own) else ""
        to = f", {min(elastic):.6g} to {max(elastic):.6g} Hz" if elastic else ""
        lines.append(f"{context.name}: {limit}: {counted(len(own), 'mode')}{over}{rigid}{to}")
    return lines


def _meet(context: AnalysisContext[LinearAnalysis], rows: Sequence[Mapping[str, Any]], sectors: int) -> list[str]:
    """Write ``<name>_crossings.csv``; a line for each of the nearest."""
    speed = context.analysis.speed_rpm
    if speed is None:
        return []
    names, found = crossings_of(rows, context.analysis.orders(sectors), sectors, speed)
    context.write_table("crossings", {name: [one[name] for one in found] for name in names})
    near = sorted(found, key=lambda one: abs(one["margin"]))[:TOLD]
    return [f"{context.name}: {_told(one)}" for one in near]


def _told(one: Mapping[str, Any]) -> str:
    wave = f" of {counted(one['nodal_diameter'], 'nodal diameter')}" if "nodal_diameter" in one else ""
    return (
        f"engine order {one['engine_order']} meets mode {one['mode']}{wave}, {one['contact']}, at"
        f" {one['speed_rpm']:.5g} rev/min ({100 * one['margin']:+.3g} % of the operating speed)"
    )
