"""What may stand in a case file: every key with its one-line doc, unit and default.

The models below are the only place where keys, defaults and plain bounds are written. Checks that need
matrices or other entries are in :mod:`fretwave.case.checks`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Optional, Union

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticKnownError

#: Longest name: results are files of that name, whose systems allow 255 characters with all that is added.
LONGEST_NAME = 100
LARGEST_WHOLE = 2**31 - 1


def _of_the_core(value: int) -> int:
    """Whole numbers have 32 bits in the core; harmonics, sectors and points beyond are a slip."""
    if value > LARGEST_WHOLE:
        raise PydanticKnownError("less_than_equal", {"le": LARGEST_WHOLE})
    if value < -LARGEST_WHOLE:
        raise PydanticKnownError("greater_than_equal", {"ge": -LARGEST_WHOLE})
    return value


Whole = Annotated[int, AfterValidator(_of_the_core)]
Dof = Annotated[
    str,
    BeforeValidator(lambda value: str(value) if type(value) is int else value),
    Field(pattern=r"^[^\x00-\x1f\x7f]{1,100}$"),
]
Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Matrix = Union[str, list[list[float]]]
Numbers = Union[float, list[float]]


def key(doc: str, unit: str | None = None, example: str | None = None, **rules: Any) -> Any:
    """A field with its doc, unit and a line of TOML that shows it."""
    extra: dict[str, Any] = {"unit": unit, "example": example}
    return Field(description=doc, json_schema_extra=extra, **rules)


class Section(BaseModel):
    """A table of the case file: no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True)


class ModelSection(Section):
    """``[model]``: matrices and names of the degrees of freedom, or what makes them."""

    dofs: Optional[list[Dof]] = key(
        "names of the dofs, in the order of the matrices", example='["m1", "m2"]', default=None
    )
    M: Optional[Matrix] = key("mass matrix, rows or a .npz/.mtx file", "kg", "[[1.0, 0.0], [0.0, 0.02]]", default=None)
    K: Optional[Matrix] = key(
        "stiffness matrix, rows or a .npz/.mtx file", "N/m", "[[2.0, -1.0], [-1.0, 1.0]]", default=None
    )
    C: Optional[Matrix] = key(
        "damping matrix, rows or a .npz/.mtx file", "N s/m", "[[0.1, 0.0], [0.0, 0.1]]", default=None
    )
    builder: Optional[str] = key(
        "Python file whose build(**options) gives the model, in place of matrices", example='"model.py"', default=None
    )
    file: Optional[str] = key(
        "model file of `fretwave import`, in place of matrices; it brings names of dofs and contacts",
        example='"blade.h5"',
        default=None,
    )
    options: dict[str, Any] = key("options of the builder", example="{ speed_rpm = 2000 }", default_factory=dict)
    sectors: Optional[Whole] = key(
        "the model is one of this many equal sectors of a wheel", example="24", default=None, ge=2, le=10_000
    )
    low: Optional[list[Dof]] = key("dofs of the sector's low face", example='["rim_0"]', default=None, min_length=1)
    high: Optional[list[Dof]] = key(
        "dofs of its high face, which move like the low face of the next sector", example='["rim_1"]', default=None
    )
    stiffness_damping: float = key("C grows by this times K", "s", "2e-6", default=0.0, ge=0, allow_inf_nan=False)
    mass_damping: float = key("C grows by this times M", "1/s", "0.1", default=0.0, ge=0, allow_inf_nan=False)


class ReductionSection(Section):
    """``[reduction]``: Craig-Bampton; kept are the dofs of contacts and those that the case or its builder names."""

    modes: Optional[Whole] = key("number of component modes (10 unless told)", example="10", default=None, ge=0)
    up_to_hz: Optional[Positive] = key("instead of modes: all component modes up to here", "Hz", "5000.0", default=None)
    compare: Whole = key("linear modes compared with the unreduced model, 0 for none", example="5", default=5, ge=0)
    interface: Literal["whole", "modes"] = key(
        "faces of a sector: kept whole, or moving in modes that waves of the unreduced sector give",
        example='"modes"',
        default="whole",
    )
    interface_diameters: Optional[list[Annotated[Whole, Field(ge=0)]]] = key(
        "nodal diameters of the waves that give interface modes", example="[4, 12]", default=None, min_length=1
    )
    interface_waves: Whole = key("lowest waves of each, stuck and as many sliding", example="10", default=10, ge=1)
    interface_tolerance: Positive = key(
        "singular values of interface modes that are kept, over the largest", "-", "1e-5", default=1e-5, lt=1
    )
    compare_diameters: Optional[list[Annotated[Whole, Field(ge=0)]]] = key(
        "nodal diameters compared (those of the analyses and of the interface modes)", example="[4, 8]", default=None
    )
    error_at: Optional[Positive] = key(
        "amplitude at which each mode's error against the unreduced model is estimated", "m", "1e-3", default=None
    )


class PreloadSection(Section):
    """``[preload]``: the static state that the dynamics move about."""

    pair_loads: bool = key(
        "normal loads given pair by pair act, balanced as they are; false sets them to zero",
        example="true",
        default=True,
    )
    loads: list[str] = key("static loads of the model that act", example='["centrifugal"]', default_factory=list)


class AerodynamicsSection(Section):
    """``[aerodynamics]``: forces of the flow on the vibrating blades, where `aerodynamics = true` and in flutter."""

    frequency: Positive = key("vibration frequency at which they hold", "Hz", "194.3")
    influence: Optional[dict[str, list[float]]] = key(
        "complex force on a blade by the unit motion of the blade k places ahead: k = [real, imaginary]",
        "N/m at a dof, 1/s2 modal",
        "{ 0 = [0.0, -20.0], 1 = [-8.0, 3.0], -1 = [8.0, 3.0] }",
        default=None,
        min_length=1,
    )
    dof: Optional[Dof] = key(
        "dof of `influence`; without it modal: the force on a mode of unit modal mass", example='"tip"', default=None
    )
    damping: Optional[dict[str, float]] = key(
        "in place of influence: modal damping ratio by nodal diameter, negative for backward waves",
        example="{ 4 = -0.002, -4 = 0.003 }",
        default=None,
        min_length=1,
    )


class ContactSection(BaseModel):
    """``[[contact]]``: pairs that share a contact law; the law's parameters are further keys."""

    model_config = ConfigDict(extra="allow", strict=True)

    name: Name = key("name of the contact", example='"damper"', default="contact", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    law: str = key("contact law", example='"regularised_coulomb"')
    pairs: Optional[list[Union[Dof, list[Dof]]]] = key(
        "contact pairs: a dof against ground, or [first, second] for second minus first; a builder brings its own",
        example='["m2"] or [["m1", "m2"]]',
        default=None,
        min_length=1,
    )
    tangents: Optional[list[Union[Dof, list[Dof]]]] = key(
        "of a law in a plane: the tangent of each pair, given as `pairs`, which are then its normals (> 0 closes)",
        example='["m2_x"] or [["m1_x", "m2_x"]]',
        default=None,
        min_length=1,
    )


class StepSection(Section):
    """Step control of the continuation."""

    initial: Positive = key("length of the first arclength step", "-", "0.05", default=0.05)
    minimum: Positive = key("shortest step, but over a corner", "-", "1e-9", default=1e-9)
    maximum: Positive = key("longest step", "-", "0.3", default=0.3)
    max_angle: Positive = key("largest turn of the branch in one step", "rad", "0.6", default=0.6, le=3.2)
    max_error: Positive = key(
        "largest distance of the branch from the curve through its points", "-", "5e-4", default=5e-4
    )
    max_points: Whole = key("largest number of points of the branch", example="5000", default=5000, ge=2)


class Damper(Section):
    """A viscous damper from one dof to ground, added in one analysis."""

    dof: Dof = key("dof the damper acts on", example='"m1"')
    c: float = key("damper constant, negative to destabilise", "N s/m", "-1.0", allow_inf_nan=False)


class MistuningSection(Section):
    """Relative deviations of a stiffness from sector to sector: drawn, or given one by one."""

    of: str = key(
        "part of the stiffness that varies: one of the builder's, or `sector`, all of it",
        example='"blade"',
        default="sector",
    )
    standard_deviation: Optional[Positive] = key(
        "of normally distributed deviations, less their mean", "-", "0.02", default=None, lt=0.3
    )
    seed: Whole = key("of the deviations that are drawn", example="1", default=1, ge=0)
    deviations: Optional[list[Annotated[float, Field(gt=-1, allow_inf_nan=False)]]] = key(
        "instead, one for each sector", "-", "[0.01, -0.02, 0.005]", default=None, min_length=2
    )


class AnalysisSection(Section):
    """What every ``[[analysis]]`` has."""

    name: Name = key("unique name; results go to <name>.csv", example='"mode"', pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")
    type: str = key("kind of analysis", example='"mode"')
    dampers: list[Damper] = key(
        "viscous dampers to ground added in this analysis",
        example='[{ dof = "m1", c = -1.0 }]',
        default_factory=list,
    )
    petsc: str = key("PETSc options of this analysis", example='"-snes_rtol 1e-9"', default="")


class HarmonicSection(AnalysisSection):
    """Keys of the analyses in the frequency domain."""

    harmonics: Whole = key("highest harmonic", example="21", ge=1)
    retain: Literal["auto", "odd", "all"] = key(
        "which harmonics up to the highest are kept", example='"auto"', default="auto"
    )
    samples: Optional[Whole] = key("time samples of a period in the contact law", example="1024", default=None, ge=4)
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
    step: StepSection = key("step control", example="{ initial = 0.05, maximum = 0.3 }", default_factory=StepSection)
    preload: Optional[PreloadSection] = key("in place of [preload]", example="{ pair_loads = true }", default=None)


class ModeAnalysis(HarmonicSection):
    """``type = "mode"``: a nonlinear mode over its amplitude."""

    type: Literal["mode"]
    method: Literal["CNM", "EPMC"] = key(
        "complex nonlinear mode (decaying) or extended periodic motion", example='"CNM"', default="CNM"
    )
    wave: Literal["travelling", "standing"] = key(
        "of a tuned wheel: a wave that runs around, or one that stands with its crest at `sector`",
        example='"standing"',
        default="travelling",
    )
    normalise: Dof = key("dof whose fundamental harmonic is the modal amplitude", example='"m1"')
    amplitude: list[Positive] = key("first and last modal amplitude", "m", "[0.02, 3.0]", min_length=2, max_length=2)
    report_at: list[Positive] = key(
        "amplitudes at which the motion of a period is kept", "m", "[0.1, 0.5]", default_factory=list
    )


class FlutterAnalysis(HarmonicSection):
    """``type = "flutter"``: modes of several nodal diameters with [aerodynamics], and their limit cycles."""

    type: Literal["flutter"]
    method: Literal["CNM", "EPMC"] = key(
        "complex nonlinear mode (decaying) or extended periodic motion", example='"CNM"', default="CNM"
    )
    normalise: Dof = key("dof whose fundamental harmonic is the modal amplitude", example='"m1"')
    amplitude: list[Positive] = key("first and last modal amplitude", "m", "[1e-5, 1e-2]", min_length=2, max_length=2)
    nodal_diameters: Optional[list[Whole]] = key(
        "waves looked at, negative for backward ones; all unless told", example="[-4, 3, 4]", default=None, min_length=1
    )
    report_at: list[Positive] = key(
        "amplitudes at which the motion of a period is kept", "m", "[1e-4]", default_factory=list
    )


class StaticAnalysis(AnalysisSection):
    """``type = "static"``: the static state under the preload, pair by pair."""

    type: Literal["static"]
    factors: list[Positive] = key("factors on the loads of the preload", "-", "[0.5, 1.0]", default=[1.0], min_length=1)
    preload: Optional[PreloadSection] = key(
        "in place of [preload]", example='{ loads = ["centrifugal"] }', default=None
    )


class ForcedAnalysis(HarmonicSection):
    """``type = "forced"``: frequency responses at several excitation levels."""

    type: Literal["forced"]
    backbone: Union[str, list[str]] = key(
        "mode analyses whose backbones the peaks are compared with",
        example='["mode"]',
        default_factory=list,
    )
    force: dict[Dof, float] = key(
        "force amplitude of each excited dof, cosine at harmonic 1, delayed from sector to sector of a wheel",
        "N",
        "{ m1 = 1.0 }",
        min_length=1,
    )
    engine_order: Optional[Whole] = key(
        "order of the excitation of a wheel, in place of nodal_diameter; negative where the rotor turns with the "
        "sectors' numbers",
        example="4",
        default=None,
    )
    levels: list[Positive] = key("factors on the force", "-", "[1.0, 2.0]", min_length=1)
    frequency: list[Positive] = key(
        "first and last excitation frequency", "Hz", "[3.0, 5.0]", min_length=2, max_length=2
    )
    observe: Dof = key("dof whose fundamental harmonic is reported", example='"m1"')
    report_at: list[Positive] = key(
        "frequencies at which the motion of a period is kept", "Hz", "[3.9]", default_factory=list
    )
    time_points: Whole = key(
        "points of each response that are checked by time integration", example="4", default=0, ge=0
    )


class WearAnalysis(AnalysisSection):
    """``type = "wear"``: fretting wear of a mode at fixed amplitudes over wear cycles."""

    type: Literal["wear"]
    mode: str = key("mode analysis whose settings and branch this one takes", example='"mode"')
    amplitude: list[Positive] = key("fixed modal amplitudes, one or a grid", "m", "[1.2e-3]", min_length=1)
    cycles: Positive = key("normalised wear cycles to march", "-", "40.0")
    coefficient: float = key("wear coefficient k_w", "1/Pa", "1e-14", ge=0, allow_inf_nan=False)
    cycle_unit: Optional[Positive] = key(
        "vibration cycles in a normalised one (by default: in which sliding 4 mu N0/kt a cycle leaves 1/e of the load)",
        "-",
        "1e6",
        default=None,
    )
    stepper: Literal["heun", "bogacki_shampine", "trapezoidal", "tr_bdf2"] = key(
        "step over wear cycles: explicit of order 2 or 3, implicit of order 2 (two)",
        example='"tr_bdf2"',
        default="bogacki_shampine",
    )
    tolerance: Positive = key(
        "estimated error of a step, as normal load lost relative to the mean", "-", "1e-4", default=1e-3, lt=1
    )
    pressure_change: Positive = key(
        "largest change of a pair's contact pressure in a step, relative to the mean", "-", "0.1", default=0.2
    )
    report_at: list[Positive] = key(
        "normalised cycles at which the motion of a period is kept", "-", "[10.0, 40.0]", default_factory=list
    )
    harmonics: Optional[Whole] = key("highest harmonic, in place of the mode's", example="5", default=None, ge=1)
    samples: Optional[Whole] = key(
        "time samples of a period, in place of the mode's", example="256", default=None, ge=4
    )


class TransientSection(AnalysisSection):
    """Keys of the analyses by direct time integration."""

    mode: str = key("mode analysis to start from and compare with", example='"mode"')
    amplitude: list[Positive] = key("start amplitudes", "m", "[0.05, 0.3, 2.5]", min_length=1)
    periods: Whole = key("vibration periods to integrate", example="30", ge=1)
    samples_per_period: Whole = key("output samples of a period", example="64", default=64, ge=8)
    tolerance: Positive = key("relative tolerance of the time integration", "-", "1e-10", default=1e-10, lt=1)


class FreeDecayAnalysis(TransientSection):
    """``type = "free_decay"``: decay and frequency of each cycle against the mode."""

    type: Literal["free_decay"]


class LimitCycleAnalysis(TransientSection):
    """``type = "limit_cycle"``: where starts at several amplitudes end up."""

    type: Literal["limit_cycle"]


class SweepAnalysis(AnalysisSection):
    """``type = "sweep"``: another analysis for every value of some keys of the case."""

    type: Literal["sweep"]
    of: str = key("analysis to run for every value", example='"mode"')
    over: dict[str, Any] = key(
        "values of keys, addressed as --set does; of several keys all combinations",
        example='{ "model.options.friction" = [0.1, 0.2, 0.5] }',
        min_length=1,
    )
    overrides: dict[str, Any] = key(
        "other values of keys for these runs", example="{ mode.amplitude = [1e-6, 1e-2] }", default_factory=dict
    )
    groups: Optional[Whole] = key(
        "most groups of ranks, each with a value at a time (as many as there are ranks and values unless told)",
        example="2",
        default=None,
        ge=1,
    )


ANALYSES: dict[str, type[AnalysisSection]] = {
    "static": StaticAnalysis,
    "mode": ModeAnalysis,
    "forced": ForcedAnalysis,
    "flutter": FlutterAnalysis,
    "free_decay": FreeDecayAnalysis,
    "limit_cycle": LimitCycleAnalysis,
    "sweep": SweepAnalysis,
    "wear": WearAnalysis,
}


class StudySection(Section):
    """``[study]``: sweeps of ``fretwave study``, each with the others at their finest (of wear: as in the analysis)."""

    harmonics: Optional[list[Whole]] = key("highest harmonics", example="[1, 3, 7, 21, 41]", default=None, min_length=2)
    samples: Optional[list[Whole]] = key(
        "time samples of a period", example="[128, 512, 2048]", default=None, min_length=2
    )
    component_modes: Optional[list[Whole]] = key(
        "numbers of component modes, for a reduced model", example="[2, 5, 10, 20]", default=None, min_length=2
    )
    tolerance: Optional[list[Positive]] = key(
        "residual norms at which Newton stops", "-", "[1e-4, 1e-7, 1e-10]", default=None, min_length=2
    )
    wear_tolerance: Optional[list[Positive]] = key(
        "tolerances of a step over wear cycles", "-", "[1e-1, 1e-2, 1e-3]", default=None, min_length=2
    )
    pressure_change: Optional[list[Positive]] = key(
        "largest changes of pressure in a step over wear cycles", "-", "[0.4, 0.2, 0.1]", default=None, min_length=2
    )


#: Top-level keys; analyses cannot bear these names, or ``--set`` could not tell them apart.
TOP_LEVEL = {
    "title": "one line that says what the case is",
    "model": "matrices and names of the degrees of freedom, or what makes them",
    "reduction": "Craig-Bampton reduction",
    "preload": "the static state that the dynamics move about",
    "aerodynamics": "forces of the flow on the blades",
    "contact": "contact pairs that share a law ([[contact]], any number)",
    "analysis": "what to compute ([[analysis]], at least one)",
    "quick": "overrides used by --quick, addressed as --set does",
    "study": "what fretwave study sweeps",
}
