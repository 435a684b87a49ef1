"""What all analyses in the frequency domain share: keys of harmonics, wave and wheel, and their checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Optional

from pydantic import ConfigDict, model_validator

from ..columns import with_discretisation
from ..cyclic.engine_order import waves_of
from ..texts import toml
from .analysis import AnalysisSection
from .analysis_tables import MistuningSection, StepSection
from .checks_size import harmonic_memory
from .checks_wheel import check_wave, check_wheel
from .fields import Positive, Whole, key
from .flow import check_damped
from .schema import PreloadSection

if TYPE_CHECKING:
    from ..model.model import Model
    from .facts import Facts
    from .observed import Observed
    from .reporter import Reporter


#: The least set, which an accuracy begins with.
LEAST_HARMONICS, LEAST_SAMPLES = 5, 128


def _either(schema: dict[str, Any]) -> None:
    """Of the JSON schema: one of the two keys must be there."""
    schema["required"] = [name for name in schema["required"] if name != "harmonics"]
    schema["anyOf"] = [{"required": ["harmonics"]}, {"required": ["accuracy"]}]


class HarmonicSection(AnalysisSection):
    """Keys of the analyses in the frequency domain."""

    model_config = ConfigDict(json_schema_extra=_either)

    harmonics: Whole = key("highest harmonic", example="21", ge=1)
    accuracy: Optional[Positive] = key(
        "relative accuracy: how far a point may lie from the true branch, in damping, frequency and amplitude of a "
        "mode or amplitude and frequency of a response (where that is steep the error at the same amplitude is "
        "larger); it chooses harmonics and samples point by point, in place of the keys",
        example="1e-3",
        default=None,
        lt=1,
    )
    retain: Literal["auto", "odd", "all"] = key(
        "which harmonics up to the highest are kept", example='"auto"', default="auto"
    )
    samples: Optional[Whole] = key(
        "time samples of a period that pictures and tables are drawn from; of the forces cubic springs and laws in "
        "Python alone are sampled",
        example="1024",
        default=None,
        ge=4,
    )
    linear_mode: Whole = key("linear mode to start from, 1 is the lowest", example="1", default=1, ge=1)
    nodal_diameter: Optional[Whole] = key(
        "nodal diameters of the wave on a sector, negative for a backward wave", example="4", default=None
    )
    aerodynamics: bool = key("the forces of [aerodynamics] act", example="true", default=False)
    wheel: bool = key("solve all sectors of the wheel in place of one", example="true", default=False)
    mistuning: Optional[MistuningSection] = key(
        "deviations of the wheel's sectors", example='{ of = "blade", standard_deviation = 0.02 }', default=None
    )
    sector: Optional[Whole] = key(
        "sector of the wheel whose dof is normalised or observed (0; of a mistuned mode where it moves most)",
        example="7",
        default=None,
        ge=0,
    )
    errors: bool = key("estimate the errors of every point", example="false", default=True)
    step: StepSection = key("step control", example="{ initial = 0.05, maximum = 0.3 }", default_factory=StepSection)
    preload: Optional[PreloadSection] = key("in place of [preload]", example="{ pair_loads = true }", default=None)

    @model_validator(mode="before")
    @classmethod
    def _first_set(cls, given: object) -> object:
        """An accuracy stands in place of the harmonics."""
        if isinstance(given, Mapping) and given.get("accuracy") is not None:
            return {"harmonics": LEAST_HARMONICS, **given}
        return given

    def own_preload(self) -> Optional[PreloadSection]:
        return self.preload

    def columns_of(self, columns: Sequence[Any]) -> list[Any]:
        """Columns of its table; with an accuracy also the harmonics and samples of each point."""
        return list(columns) if self.accuracy is None else with_discretisation(columns)

    def harmonic(self) -> Optional[HarmonicSection]:
        return self

    def up_to_hz(self) -> float:
        """The highest frequency [Hz] that it is told to reach; 0 where none is."""
        return 0.0

    def observed(self) -> Optional[tuple[str, Observed]]:
        """Its key that says what its amplitude is of, and what that is; None where it has no such key."""
        return None

    def follows_waves(self) -> bool:
        """It looks at waves that it names in another way than by `nodal_diameter`, each on one sector."""
        return False

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        check_harmonics(report, self, facts.dofs)
        if facts.model_known:
            check_wheel(report, self, facts)
        if facts.model_known and not self.follows_waves():
            check_wave(report, self, facts)
            if self.aerodynamics and not facts.has_flow:
                fix = "add [aerodynamics]"
                report.wrong(("aerodynamics",), "needs forces of the flow", "a table [aerodynamics]", fix)
            if self.aerodynamics and facts.sectors is not None:
                check_damped(report, "aerodynamics", self.waves(facts.sectors), facts)

    def waves(self, sectors: int) -> list[int]:
        """Of a mistuned wheel all."""
        if self.mistuning is not None:
            return waves_of(sectors)
        return [] if self.nodal_diameter is None else [self.nodal_diameter]

    def least_memory(self, facts: Facts) -> Mapping[str, float]:
        return harmonic_memory(self.harmonics, self.samples, (facts.sectors or 1) if self.wheel else 1, facts)

    def details(self, model: Model, preloaded: bool = False) -> list[str]:
        from ..hb.harmonics import choose_harmonics

        lines = super().details(model, preloaded)
        sizes = (self.harmonics, self.samples) if self.accuracy is None else (LEAST_HARMONICS, LEAST_SAMPLES)
        harmonics = choose_harmonics(model, *sizes, retained_by(self, preloaded))
        n_dof = model.n_dof * (model.sectors if self.wheel else 1)
        if self.accuracy is not None:
            lines.append(f"accuracy {self.accuracy:g}: harmonics and samples follow from it, at the least")
        lines.append(
            f"harmonics {_orders(harmonics.orders)}, {harmonics.samples} samples a period,"
            f" {n_dof} x {harmonics.block_size} = {n_dof * harmonics.block_size} coefficients"
        )
        if self.nodal_diameter is not None or self.wheel:
            lines.append(self._wave_line(model.sectors))
        if harmonics.left_out:
            lines.append("left out: " + "; ".join(harmonics.left_out))
        return lines

    def wave_word(self) -> str:
        """What its wave is called."""
        return "wave"

    def _wave_line(self, sectors: int) -> str:
        place = f"all {sectors} sectors" if self.wheel else f"one sector of {sectors}"
        if self.mistuning is not None:
            place = f"{place}, their '{self.mistuning.of}' stiffness mistuned"
        if self.nodal_diameter is None:
            return place
        return f"a {self.wave_word()} of {self.nodal_diameter} nodal diameters on {place}"


def retained_by(analysis: HarmonicSection, preloaded: bool) -> str:
    """Which harmonics are kept: about a state at rest the even ones too, unless told otherwise."""
    return "all" if analysis.retain == "auto" and preloaded else analysis.retain


def nodal_diameter(analysis: AnalysisSection) -> int:
    """Of the wave of an analysis; 0 where it has none."""
    section = analysis.harmonic()
    return (section.nodal_diameter or 0) if section is not None else 0


def with_flow_forces(analysis: AnalysisSection) -> bool:
    """The forces of the flow act on its model."""
    section = analysis.harmonic()
    return section is not None and section.aerodynamics


def check_harmonics(report: Reporter, analysis: HarmonicSection, dofs: Optional[Sequence[str]]) -> None:
    """Samples enough for the harmonics, a linear mode that exists, steps in order."""
    least = 2 * analysis.harmonics + 2
    if analysis.samples is not None and analysis.samples % 2:
        report.wrong(("samples",), "is odd", "an even number", f"write `samples = {analysis.samples + 1}`")
    elif analysis.samples is not None and analysis.samples < least:
        report.wrong(
            ("samples",),
            "is too small",
            f"at least 2 H + 2 = {least} for harmonics = {analysis.harmonics}",
            f"write `samples = {_samples(analysis.harmonics)}`, or leave the key out",
        )
    by_wave = analysis.mistuning is None or analysis.nodal_diameter is not None  # else of the whole wheel
    if dofs is not None and by_wave and analysis.linear_mode > len(dofs):
        report.wrong(
            ("linear_mode",), "does not exist", f"1 to {len(dofs)}, the number of dofs", "write `linear_mode = 1`"
        )
    if analysis.accuracy is not None and not analysis.errors:
        report.wrong(("errors",), "takes away what `accuracy` is judged by", "errors = true", "remove one of the keys")
    step = analysis.step
    if not step.minimum <= step.initial <= step.maximum:
        report.wrong(
            ("step",),
            "is out of order",
            f"minimum <= initial <= maximum, not {step.minimum:g}, {step.initial:g}, {step.maximum:g}",
            "for example `step = { minimum = 1e-8, initial = 0.05, maximum = 0.3 }`",
        )


def _samples(harmonics: int) -> int:
    """A power of two with room above the highest harmonic."""
    return int(2 ** max(6, (8 * harmonics).bit_length()))


def check_range(report: Reporter, key: str, ends: list[float], inside: list[float]) -> None:
    """First value below last, and the points to report at between them."""
    if not ends[0] < ends[1]:
        last = ends[0] if ends[1] < ends[0] else 2 * ends[0]
        report.wrong((key,), "is not a range", "first value < last value", f"write `{key} = [{ends[1]}, {last}]`")
        return
    for index, value in enumerate(inside):
        if not ends[0] <= value <= ends[1]:
            report.wrong(
                ("report_at", index),
                "is outside the branch",
                f"a value within {key} = {toml(ends)}",
                "move it, or widen the range",
            )


def _orders(orders: Sequence[int]) -> str:
    """``1, 3, ..., 21`` for an even spacing, all of them otherwise."""
    steps = {after - before for before, after in zip(orders, orders[1:])}
    if len(orders) > 4 and len(steps) == 1:
        return f"{orders[0]}, {orders[1]}, ..., {orders[-1]}"
    return ", ".join(str(order) for order in orders)
