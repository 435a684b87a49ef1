"""What runs, and in which order: options of a run, analyses after those whose results they need."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..case.analysis import AnalysisSection
from ..case.load import Case
from ..console import Shown

if TYPE_CHECKING:
    import argparse


@dataclass
class RunOptions:
    """What the command line says besides the case.

    Attributes
    ----------
    only : list of str
        Analyses to run; empty for all.
    petsc : str
        PETSc options for every analysis.
    shown : Shown
        How much is printed.
    force : bool
        Replace results of another case in the folder.
    """

    out: Path | None = None
    overrides: list[str] = field(default_factory=list)
    only: list[str] = field(default_factory=list)
    quick: bool = False
    plots: bool = True
    petsc: str = ""
    shown: Shown = Shown.SHORT
    force: bool = False

    @classmethod
    def of(cls, told: argparse.Namespace) -> RunOptions:
        """From the command line."""
        return cls(
            told.out, told.overrides, told.only, told.quick, not told.no_plots, told.petsc, told.shown, told.force
        )

    @classmethod
    def of_record(cls, folder: Path, record: Mapping[str, Any], plots: bool, shown: Shown = Shown.SHORT) -> RunOptions:
        """From run.json, to go on with a run."""
        given = record["case"]
        return cls(folder, given["overrides"], given["only"], given["quick"], plots, given["petsc"], shown)

    def changing(self, name: str, analyses: Collection[str]) -> str:
        """What was said on the command line that changes one analysis of these, as it is typed; for `show`."""
        of_others = [override for override in self.overrides if _addressed(override) in {*analyses} - {name}]
        words = ["--quick"] if self.quick else []
        words += [f"--set {shlex.quote(override)}" for override in self.overrides if override not in of_others]
        return " ".join([*words, *([f"--petsc {shlex.quote(self.petsc)}"] if self.petsc else [])])

    def given(self, path: Path, case: Case) -> dict[str, Any]:
        """How the case was given, for run.json."""
        told = {key: getattr(self, key) for key in ("overrides", "quick", "only", "petsc")}
        brought = {"plugins": [plugin.plain() for plugin in case.analyses.plugins]} if case.analyses.plugins else {}
        return {"path": str(path.resolve()), **told, "digest": case.digest, "resolved": case.resolved, **brought}


def _addressed(override: str) -> str:
    """Name of an analysis, if an override is of one's key."""
    parts = override.partition("=")[0].strip().split(".")
    return parts[1] if parts[0] == "analysis" and len(parts) > 1 else parts[0]


def in_order(case: Case, names: Sequence[str]) -> list[str]:
    """Analyses in the order of the file, but after those whose results they need."""
    ordered: list[str] = []

    def place(name: str) -> None:
        if name in ordered or name not in names:
            return
        for needed in [*reads(case.analyses[name]), *case.analyses[name].beside(case)]:
            place(needed)
        ordered.append(name)

    for name in names:
        place(name)
    return ordered


def reads(analysis: AnalysisSection) -> list[str]:
    """Names of the analyses whose results this one reads, where there are any."""
    return [*analysis.needs(), *analysis.compares_with()]
