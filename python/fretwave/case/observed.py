"""What an amplitude is of, normalised or observed: a dof, weighted dofs, or the coordinate of a linear mode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Optional, Union

from pydantic import Discriminator, Field, Tag

from ..columns import MODAL_UNIT
from .fields import Dof, Section, Whole, key

if TYPE_CHECKING:
    from .facts import Facts
    from .harmonic import HarmonicSection
    from .reporter import Reporter

#: Entries of a row that its label shows.
SHOWN = 4


class ObservedTable(Section):
    """``{ dofs = [...], weights = [...] }`` or ``{ mode = 1 }``, where a dof could stand."""

    dofs: Optional[list[Dof]] = key(
        "dofs whose weighted sum is looked at", example='["tip_x", "root_x"]', default=None, min_length=1
    )
    weights: Optional[list[Annotated[float, Field(allow_inf_nan=False)]]] = key(
        "factor on each of them", "-", "[1.0, -1.0]", default=None, min_length=1
    )
    mode: Optional[Whole] = key(
        "in place of dofs: linear mode whose coordinate phi^T M x is looked at, of unit modal mass, 1 is the lowest",
        example="1",
        default=None,
        ge=1,
    )


def _kind(given: object) -> str:
    """A table, or else what must be the name of a dof: errors are those of the one that was meant."""
    return "a table" if isinstance(given, (dict, ObservedTable)) else "a dof"


Observed = Annotated[
    Union[Annotated[Dof, Tag("a dof")], Annotated[ObservedTable, Tag("a table")]], Discriminator(_kind)
]


def dofs_of(observed: Union[str, ObservedTable]) -> list[str]:
    """Names of the dofs that it takes."""
    return [observed] if isinstance(observed, str) else list(observed.dofs or ())


def dof_of(observed: Union[str, ObservedTable]) -> str:
    """Of what is seen in every sector of a wheel, which must be one dof."""
    assert isinstance(observed, str)
    return observed


def label_of(observed: Union[str, ObservedTable]) -> str:
    """What it is called: ``tip_x``, ``tip_x - 0.5 root_x``, ``mode 1``."""
    if isinstance(observed, str):
        return observed
    if observed.mode is not None:
        return f"mode {observed.mode}"
    terms = [_term(w, dof) for w, dof in zip(observed.weights or (), observed.dofs or ())]
    text = " ".join(f"{sign} {size}" for sign, size in terms[:SHOWN]).removeprefix("+ ")
    text = text.replace("- ", "-", 1) if text.startswith("- ") else text
    return text if len(terms) <= SHOWN else f"{text} + ... ({len(terms)} dofs)"


def _term(weight: float, dof: str) -> tuple[str, str]:
    return "-" if weight < 0 else "+", dof if abs(weight) == 1 else f"{abs(weight):g} {dof}"


def unit_of(observed: Union[str, ObservedTable]) -> str:
    """Of its amplitude, as a quantity."""
    return "length" if isinstance(observed, str) or observed.mode is None else MODAL_UNIT


def given_to(facts: Facts, name: str, key: str) -> Any:
    """The same of another analysis as it stands in the case, right or wrong; None where it has none."""
    given = next((entry.get(key) for entry in facts.source.entries("analysis") if entry.get("name") == name), None)
    return str(given) if type(given) is int else given


def check_displaced(report: Reporter, key: str, name: str, facts: Facts) -> None:
    """The mode analysis that a key names is over a displacement [length]."""
    given = given_to(facts, name, "normalise")
    if isinstance(given, dict) and "mode" in given:
        expected = "a mode over a displacement: a dof, or a row of dofs"
        report.wrong((key,), "is followed over a modal coordinate", expected, f"change `normalise` of '{name}'")


def check_observed(
    report: Reporter, key: str, observed: Union[str, ObservedTable], analysis: HarmonicSection, facts: Facts
) -> None:
    """Dofs that exist with a weight each, or a mode with one real coordinate."""
    if isinstance(observed, str):
        report.dof((key,), observed, facts.named)
    elif analysis.wheel:
        expected = "one dof, seen in every sector"
        report.wrong((key,), "is not seen in every sector of a wheel", expected, f'write for example `{key} = "tip"`')
    elif observed.mode is not None:
        _check_mode(report, key, observed, analysis, facts)
    else:
        _check_row(report, key, observed, facts.named)


def _check_mode(report: Reporter, key: str, observed: ObservedTable, analysis: HarmonicSection, facts: Facts) -> None:
    if observed.dofs is not None or observed.weights is not None:
        report.wrong((key,), "names a mode and dofs", "one of them", f"write `{key} = {{ mode = {observed.mode} }}`")
    elif facts.dofs is not None and observed.mode is not None and observed.mode > len(facts.dofs):
        expected = f"1 to {len(facts.dofs)}, the number of dofs"
        report.wrong((key, "mode"), "does not exist", expected, f"write `{key} = {{ mode = 1 }}`")
    sectors, diameters = facts.sectors, analysis.nodal_diameter
    if sectors and (analysis.follows_waves() or (diameters is not None and 2 * diameters % sectors)):
        fix = "normalise by a dof or a row of dofs" if key == "normalise" else "observe a dof or a row of dofs"
        expected = f"a real mode: nodal diameter 0{f' or {sectors // 2}' if sectors % 2 == 0 else ''} alone has one"
        report.wrong((key,), "is a complex coordinate in a wave that runs", expected, fix)


def _check_row(report: Reporter, key: str, row: ObservedTable, named: Optional[Sequence[str]]) -> None:
    example = f'`{key} = {{ dofs = ["tip_x", "root_x"], weights = [1.0, -1.0] }}`'
    if row.dofs is None or row.weights is None:
        missing = "dofs" if row.dofs is None else "weights"
        report.wrong((key,), f"has no {missing}", "dofs and weights, or mode", f"write for example {example}")
        return
    for index, dof in enumerate(row.dofs):
        report.dof((key, "dofs", index), dof, named)
        if dof in row.dofs[:index]:
            report.wrong((key, "dofs", index), "is named twice", "each dof once", "add its weights")
    if len(row.weights) != len(row.dofs):
        expected = f"{len(row.dofs)} numbers, one for each dof"
        report.wrong((key, "weights"), f"has {len(row.weights)} numbers", expected, f"write for example {example}")
    elif not any(row.weights):
        report.wrong((key, "weights"), "is zero", "a weight other than 0", f"write for example {example}")
