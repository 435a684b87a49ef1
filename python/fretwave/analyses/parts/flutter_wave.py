"""One wave of a flutter analysis: its model under the flow, and what is said of a wave in which nothing can begin."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ...errors import InputError
from ...texts import counted
from .context import AnalysisContext

if TYPE_CHECKING:
    from ..flutter import FlutterAnalysis


@contextmanager
def in_wave_of(context: AnalysisContext[FlutterAnalysis], diameter: int) -> Iterator[AnalysisContext[FlutterAnalysis]]:
    """The context of one nodal diameter, with its model under the flow. Collective."""
    from ...case.build import build_model

    case, wave = context.case, {"nodal_diameter": diameter, "aerodynamics": True}
    analysis = context.analysis.model_copy(update=wave)
    preload = case.preload_of(analysis)
    with build_model(case, analysis.dampers, context.comm, preload, diameter, aerodynamics=True) as model:
        yield context.of(analysis, model=model)


def raise_if_all(errors: Mapping[int, InputError], diameters: Sequence[int]) -> None:
    """The first error where no wave can begin."""
    if errors and len(errors) == len(diameters):
        raise next(iter(errors.values()))


def why_not(diameter: int, error: InputError) -> str:
    """Why a wave cannot begin, in a line."""
    return f"nodal diameter {diameter}: {error.what} ({error.measured})"


def without_those(name: str, errors: Mapping[int, InputError], diameters: Sequence[int]) -> list[InputError]:
    """The same beforehand, as a warning."""
    if not errors:
        return []
    reasons = "; ".join(why_not(diameter, error) for diameter, error in errors.items())
    what = f"'{name}' will have no points in {counted(len(errors), 'wave')}"
    expected = "a motion in every wave that is looked at"
    return [InputError(what, f"{name}.nodal_diameters", reasons, expected, what_to_do(name, errors, diameters))]


def what_to_do(name: str, errors: Mapping[int, InputError], diameters: Sequence[int]) -> str:
    """Advice where some waves cannot begin; empty where all can."""
    others = [diameter for diameter in diameters if diameter not in errors]
    first = next(iter(errors.values()), None)
    return f"{first.fix}; or without them: --set '{name}.nodal_diameters={others}'" if first else ""
