"""What may stand in a case file: every key with its one-line doc, unit (of a quantity) and default.

The models below are the only place where keys, defaults and plain bounds are written, but for those of an analysis,
which stand in its own file (:mod:`fretwave.analyses`) and in :mod:`fretwave.case.analysis_tables`. Checks that need
matrices or other entries are in :mod:`fretwave.case.checks`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Optional, Union

from pydantic import BaseModel, ConfigDict, Field

from ..hb.states import ZETA_FLOOR
from ..model.sizes import COMPARED_MODES, COMPONENT_MODES, INTERFACE_TOLERANCE, INTERFACE_WAVES
from ..units import MM_T_S, SI, SYSTEMS
from .fields import (
    ByMode,
    Counted,
    Dof,
    Finite,
    Frequency,
    LoadVector,
    Matrix,
    Name,
    Positive,
    QByMode,
    Section,
    Speed,
    SpeedOrRest,
    UnitName,
    Whole,
    key,
)


class ModelSection(Section):
    """``[model]``: matrices and names of the degrees of freedom, or what makes them."""

    dofs: Optional[list[Dof]] = key(
        "names of the dofs, in the order of the matrices", example='["m1", "m2"]', default=None
    )
    M: Optional[Matrix] = key(
        "mass matrix, rows or a .npz/.mtx file", "mass", "[[1.0, 0.0], [0.0, 0.02]]", default=None
    )
    K: Optional[Matrix] = key(
        "stiffness matrix, rows or a .npz/.mtx file", "force/length", "[[2.0, -1.0], [-1.0, 1.0]]", default=None
    )
    C: Optional[Matrix] = key(
        "damping matrix, rows or a .npz/.mtx file", "force s/length", "[[0.1, 0.0], [0.0, 0.1]]", default=None
    )
    at_speed: Optional[dict[str, Matrix]] = key(
        "stiffness at one or two speeds [rev/min], K being that at rest: rows, or a .npz, .mtx or model file; "
        "K + Omega^2 K2 is put through them, K2 the part `spin`",
        "force/length",
        '{ 3000 = "K3000.mtx" }',
        default=None,
        min_length=1,
        max_length=2,
    )
    loads_at_speed: Optional[dict[str, Annotated[dict[str, LoadVector], Field(min_length=1, max_length=3)]]] = key(
        "static loads that grow with the square of the speed, each by what it is at one to three speeds [rev/min]: "
        "numbers, a .csv file with the columns `dof` and `force`, or a load that the model brings; Omega^2 f is put "
        "through them",
        "force",
        '{ centrifugal = { 3000 = "f3000.csv" } }',
        default=None,
        min_length=1,
    )
    speed_rpm: Optional[SpeedOrRest] = key(
        "speed at which the model turns: stiffness K + Omega^2 K2, and loads as they are then",
        "rev/min",
        "4500.0",
        default=None,
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
    axis: Optional[Literal["x", "y", "z"]] = key(
        "the wheel's axis, about which dofs of the faces along x, y and z turn from sector to sector",
        example='"z"',
        default=None,
    )
    units: Optional[UnitName] = key(
        f"unit system of all numbers of the case and its model: one of {', '.join(SYSTEMS)} (by default that of the "
        f"model, else {SI.name})",
        example=f'"{MM_T_S.name}"',
        default=None,
    )
    stiffness_damping: float = key("C grows by this times K", "s", "2e-6", default=0.0, ge=0, allow_inf_nan=False)
    mass_damping: float = key("C grows by this times M", "1/s", "0.1", default=0.0, ge=0, allow_inf_nan=False)


class ReductionSection(Section):
    """``[reduction]``: Craig-Bampton; kept are the dofs of contacts and those that the case or its builder names."""

    modes: Optional[Whole] = key(
        f"number of component modes ({COMPONENT_MODES} unless told)", example="10", default=None, ge=0
    )
    up_to_hz: Optional[Frequency] = key(
        "instead of modes: all component modes up to here", "Hz", "5000.0", default=None
    )
    accuracy: Optional[Annotated[float, Field(gt=0, lt=1)]] = key(
        "instead of modes: as many as keep the frequencies that are compared this accurate, relative; unless told, "
        f"that of an analysis with `accuracy` to {ZETA_FLOOR:g} of it",
        "-",
        "1e-6",
        default=None,
    )
    compare: Whole = key(
        "linear modes compared with the unreduced model, contact stuck and sliding, 0 for none",
        example="5",
        default=COMPARED_MODES,
        ge=0,
    )
    interface: Literal["whole", "modes"] = key(
        "faces of a sector: kept whole, or moving in modes that waves of the unreduced sector give",
        example='"modes"',
        default="whole",
    )
    interface_diameters: Optional[list[Annotated[Whole, Field(ge=0)]]] = key(
        "nodal diameters of the waves that give interface modes", example="[4, 12]", default=None, min_length=1
    )
    interface_waves: Whole = key(
        "lowest waves of each, stuck and as many sliding", example="10", default=INTERFACE_WAVES, ge=1
    )
    interface_tolerance: Positive = key(
        "singular values of interface modes that are kept, over the largest",
        "-",
        "1e-5",
        default=INTERFACE_TOLERANCE,
        lt=1,
    )
    compare_diameters: Optional[list[Annotated[Whole, Field(ge=0)]]] = key(
        "nodal diameters compared (those of the analyses, of many the least and the most, and of the interface modes)",
        example="[4, 8]",
        default=None,
    )
    error_at: Optional[Positive] = key(
        "amplitude at which each mode's error against the unreduced model is estimated", "length", "1e-3", default=None
    )


class PreloadSection(Section):
    """``[preload]``: the static state that the dynamics move about."""

    pair_loads: bool = key(
        "normal loads given pair by pair act; false sets them to zero",
        example="true",
        default=True,
    )
    balanced: bool = key(
        "they are in balance as they are; false lets them move the structure until it is",
        example="false",
        default=True,
    )
    loads: list[str] = key("static loads of the model that act", example='["centrifugal"]', default_factory=list)


class DampingSection(Section):
    """``[damping]``: structural loss mode by mode, in one of three forms, beside whatever else is in C."""

    zeta: Optional[ByMode] = key(
        "modal damping ratio: of all modes, a list of the lowest ones' or by the number of the mode; of a sector those "
        "of each wave",
        "-",
        "0.002",
        default=None,
    )
    Q: Optional[QByMode] = key("instead, quality factor 1 / (2 zeta)", "-", "250.0", default=None)
    loss_factor: Optional[ByMode] = key(
        "instead, structural loss factor 2 zeta, which a viscous damper equals at resonance", "-", "0.004", default=None
    )
    contact: Literal["sliding", "stuck", "free"] = key(
        "linear limit of the contact whose modes these are: every pair closed and sliding without friction, closed and "
        "stuck (all stuck modes together damp slip too), or no contact",
        example='"stuck"',
        default="sliding",
    )


class AerodynamicsSection(Section):
    """``[aerodynamics]``: forces of the flow on the vibrating blades, where `aerodynamics = true` and in flutter."""

    frequency: Frequency = key("vibration frequency at which they hold", "Hz", "194.3")
    influence: Optional[dict[str, list[Finite]]] = key(
        "complex force on a blade by the unit motion of the blade k places ahead: k = [real, imaginary]",
        "force/length at a dof, 1/s^2 modal",
        "{ 0 = [0.0, -20.0], 1 = [-8.0, 3.0], -1 = [8.0, 3.0] }",
        default=None,
        min_length=1,
    )
    dof: Optional[Dof] = key(
        "dof of `influence`; without it modal: the force on a mode of unit modal mass", example='"tip"', default=None
    )
    damping: Optional[dict[str, Finite]] = key(
        "in place of influence: modal damping ratio by nodal diameter, negative for backward waves",
        example="{ 4 = -0.002, -4 = 0.003 }",
        default=None,
        min_length=1,
    )


class ContactSection(BaseModel):
    """``[[contact]]``: pairs that share a contact law; the law's parameters are further keys.

    Each is a number, an array with one for each pair, or a CSV file with the columns `pair` (from 0) and its own name.
    """

    model_config = ConfigDict(extra="allow", strict=True)

    name: Name = key("name of the contact", example='"damper"', default="contact", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    law: str = key("contact law", example='"regularised_coulomb"')
    pairs: Optional[list[Union[Dof, list[Dof]]]] = key(
        "contact pairs: a dof against ground, or [first, second] for second minus first; a builder brings its own",
        example='["m2"] or [["m1", "m2"]]',
        default=None,
        min_length=1,
    )
    load_rpm: Optional[Speed] = key(
        "speed at which its normal loads, or friction limits, are as given: they grow with the square of "
        "[model] speed_rpm",
        "rev/min",
        "3000.0",
        default=None,
    )
    tangents: Optional[list[Union[Dof, list[Dof]]]] = key(
        "of a law in a plane: the tangent of each pair, given as `pairs`, which are then its normals (> 0 closes)",
        example='["m2_x"] or [["m1_x", "m2_x"]]',
        default=None,
        min_length=1,
    )


class MaterialSection(Section):
    """``[material]``: what stress and its limit follow from in `fretwave stress`; nothing of it is solved with."""

    youngs_modulus: Optional[Positive] = key(
        "of all solid cells; `fretwave stress` says where the stiffness has another", "pressure", "210e9", default=None
    )
    poisson_ratio: Optional[float] = key("of all solid cells", "-", "0.3", default=None, gt=-1, lt=0.5)
    endurance_limit: Optional[Positive] = key(
        "stress amplitude that is borne for ever without mean stress", "pressure", "250e6", default=None
    )
    ultimate_strength: Optional[Positive] = key(
        "tensile strength: the mean stress that bears no amplitude", "pressure", "600e6", default=None
    )


class GaugeSection(Section):
    """``[[gauge]]``: a strain gauge on a solid, read by `fretwave stress`."""

    name: Name = key("name of the gauge", example='"root"', pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    node: Optional[Whole] = key(
        "node it lies on, in the mesh's own numbers, else counted from 0", example="690", default=None, ge=0
    )
    point: Optional[list[float]] = key(
        "instead, a point of the surface", "length", "[0.01, 0.0, 0.002]", default=None, min_length=3, max_length=3
    )
    direction: list[float] = key(
        "it measures along, of any length; in a sector further on it turns with the sector",
        example="[1.0, 0.0, 0.0]",
        min_length=3,
        max_length=3,
    )
    sector: Whole = key("of a wheel of which all sectors are solved", example="0", default=0, ge=0)


class UncertaintySection(Section):
    """``[uncertainty]``: values of the case that are drawn from distributions, each in a stream of its own."""

    seed: Optional[Whole] = key(
        "of all draws; without it nothing is drawn, and the case is as it is written (`--over uncertainty.seed=1:200`)",
        example="1",
        default=None,
        ge=0,
    )
    values: dict[str, Any] = key(
        "distributions of keys' values, addressed as --set does",
        example='{ contact.damper.friction_limit = { distribution = "lognormal", mean = 5, standard_deviation = 1 } }',
        default_factory=dict,
    )
    factors: dict[str, Any] = key(
        "distributions of factors on numbers of the case, and on parameters of contacts wherever they come from",
        example='{ contact.damper.normal_load = { distribution = "uniform", low = 0.8, high = 1.2 } }',
        default_factory=dict,
    )


class DistributionSection(Section):
    """The distribution of a value, or of a factor, in ``[uncertainty]``."""

    distribution: Literal["normal", "lognormal", "uniform"] = key("its kind", example='"lognormal"')
    mean: Optional[float] = key(
        "of a normal or lognormal value (of the value, not of its logarithm)",
        example="0.3",
        default=None,
        allow_inf_nan=False,
    )
    standard_deviation: Optional[Positive] = key("of the same", example="0.05", default=None)
    low: Optional[float] = key("least uniform value", example="0.2", default=None, allow_inf_nan=False)
    high: Optional[float] = key("largest uniform value", example="0.4", default=None, allow_inf_nan=False)


class StudySection(Section):
    """``[study]``: sweeps of ``fretwave study``, each with the others at their finest (of wear: as in the analysis)."""

    harmonics: Optional[list[Counted]] = key(
        "highest harmonics", example="[1, 3, 7, 21, 41]", default=None, min_length=2
    )
    samples: Optional[list[Counted]] = key(
        "time samples of a period", example="[128, 512, 2048]", default=None, min_length=2
    )
    component_modes: Optional[list[Annotated[Whole, Field(ge=0)]]] = key(
        "numbers of component modes, for a reduced model", example="[2, 5, 10, 20]", default=None, min_length=2
    )
    tolerance: Optional[list[Positive]] = key(
        "residual norms at which Newton stops", "-", "[1e-4, 1e-7, 1e-10]", default=None, min_length=2
    )
    accuracy: Optional[list[Annotated[Positive, Field(lt=1)]]] = key(
        "accuracies that runs are asked for, in place of harmonics and samples", "-", "[1e-2, 1e-3]", default=None
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
    "plugins": "Python files beside the case that add contact laws and analyses",
    "model": "matrices and names of the degrees of freedom, or what makes them",
    "reduction": "Craig-Bampton reduction",
    "preload": "the static state that the dynamics move about",
    "damping": "structural loss mode by mode",
    "aerodynamics": "forces of the flow on the blades",
    "contact": "contact pairs that share a law ([[contact]], any number)",
    "material": "elastic constants and limits of stress, for `fretwave stress`",
    "gauge": "strain gauges, for `fretwave stress` ([[gauge]], any number)",
    "analysis": "what to compute ([[analysis]], at least one)",
    "uncertainty": "distributions of values that are drawn with a seed",
    "quick": "overrides used by --quick, addressed as --set does",
    "study": "what fretwave study sweeps",
}
