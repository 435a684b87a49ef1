"""A number that is taken where nothing is said is the same in a script, in a case file and in the core."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

import fretwave as fw
from fretwave import _core
from fretwave.analyses.free_decay import FreeDecayAnalysis
from fretwave.analyses.mode import ModeAnalysis
from fretwave.analyses.wear import WearAnalysis
from fretwave.case.analysis_tables import MistuningSection, StepSection
from fretwave.case.fields import Section
from fretwave.case.harmonic import HarmonicSection
from fretwave.case.schema import ReductionSection
from fretwave.errors import InputError
from fretwave.model.sizes import COMPONENT_MODES

pytestmark = pytest.mark.ranks(1)

STEPS = list(StepSection.model_fields)


def signature(function: Callable[..., Any], name: str) -> Any:
    return inspect.signature(function).parameters[name].default


def case(section: type[Section], name: str) -> Any:
    return section.model_fields[name].default


@pytest.mark.parametrize("name", STEPS)
def test_steps(name: str) -> None:
    assert case(StepSection, name) == signature(fw.StepControl, name) == getattr(_core.StepControl(), name)


def test_every_step_has_its_key() -> None:
    assert list(inspect.signature(fw.StepControl).parameters) == STEPS


@pytest.mark.parametrize("name", ["stepper", "tolerance", "pressure_change"])
def test_wear(name: str) -> None:
    assert case(WearAnalysis, name) == signature(fw.WearControl, name)


@pytest.mark.parametrize(
    "section, key, function, name",
    [
        (FreeDecayAnalysis, "tolerance", fw.Transient.run, "rtol"),
        (ReductionSection, "compare", fw.Reduction.error, "count"),
        (ReductionSection, "compare", fw.SectorReduction.error, "count"),
        (ReductionSection, "interface_waves", fw.reduce_sector, "interface_waves"),
        (ReductionSection, "interface_tolerance", fw.reduce_sector, "interface_tolerance"),
        (ReductionSection, "modes", fw.reduce, "modes"),
        (ModeAnalysis, "method", fw.NonlinearMode, "method"),
        (HarmonicSection, "retain", fw.choose_harmonics, "retain"),
        (HarmonicSection, "samples", fw.choose_harmonics, "samples"),
        (MistuningSection, "seed", fw.deviations, "seed"),
    ],
)
def test_one_number(section: type[Section], key: str, function: Callable[..., Any], name: str) -> None:
    assert case(section, key) == signature(function, name)


def test_component_modes_are_told_in_words() -> None:
    assert f"({COMPONENT_MODES} unless told)" in (ReductionSection.model_fields["modes"].description or "")


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("name", STEPS)
def test_what_a_case_refuses_a_script_refuses(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        StepSection(**{name: value})
    with pytest.raises(InputError, match=f"step.{name}"):
        fw.StepControl(**{name: value})
