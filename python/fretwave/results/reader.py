"""A run folder as pictures read it: the analyses in results.h5, and the tables beside it; nothing else."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..columns import name_of
from ..kinds import of_their_kinds
from .analysis import Analysis, Table, read_analysis
from .file import has_results, no_results, open_results
from .stamp import of_one_model

if TYPE_CHECKING:
    import h5py


@of_their_kinds
def open_run(folder: str | Path) -> Run:
    """Read a run that is done, still going on, or was killed; neither MPI nor PETSc is needed.

    Returns
    -------
    Run
        Analyses by name: ``run["mode"]["zeta"]`` is a column, ``run["mode"].coefficients([3])`` the harmonics of a
        point. ``run.table(name)`` reads any CSV of the folder.

    Raises
    ------
    InputError
        There are no results, or they are damaged.
    """
    if not has_results(Path(folder)):
        raise no_results(Path(folder))
    return Run(folder)


def write_curve(group: h5py.Group, folder: Path) -> None:
    """``<name>_curve.csv``: the branches of an analysis for readers without the cubic; one rank only."""
    analysis = read_analysis(group, folder / "results.h5")
    if analysis.slopes is not None and len(analysis):
        analysis.straight().to_csv(folder / f"{analysis.name}_curve.csv")


class Run:
    """The analyses and tables of a run folder."""

    @of_their_kinds
    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.analyses: dict[str, Analysis] = {}
        path = self.folder / "results.h5"
        if has_results(self.folder):
            with open_results(path) as file:
                groups = {name: group for name, group in file.items() if "type" in group.attrs}
                self.analyses = {name: read_analysis(group, path) for name, group in groups.items()}
        self.title = str(self._attribute("title") or self.folder.name)

    def __getitem__(self, name: str) -> Analysis:
        if name not in self.analyses:
            raise KeyError(f"no analysis '{name}' in {self.folder}; there are {', '.join(self.analyses)}")
        return self.analyses[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.analyses)

    def __len__(self) -> int:
        return len(self.analyses)

    def __contains__(self, name: object) -> bool:
        return name in self.analyses

    def __repr__(self) -> str:
        return "\n".join([f"Run of '{self.title}' in {self.folder}", *(f"  {a}" for a in self.analyses.values())])

    def of_kind(self, kind: str) -> list[Analysis]:
        """Analyses of a type that have at least one point."""
        return [a for a in self.analyses.values() if a.kind == kind and len(a)]

    def table(self, name: str) -> Table | None:
        """Columns of `<name>.csv` by name, without units; numbers where they are numbers. None when there is none."""
        path = self.folder / f"{name}.csv"
        if not path.exists():
            return None
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        if not rows:
            return None
        return {name_of(key): _numbers([row[key] for row in rows]) for key in rows[0]}

    def table_since(self, name: str) -> Table | None:
        """As `table`, of what is made from the results afterwards; None where it is older than they are."""
        path, results = self.folder / f"{name}.csv", self.folder / "results.h5"
        if path.exists() and results.exists() and path.stat().st_mtime < results.stat().st_mtime:
            return None
        return self.table(name)

    def tables(self) -> list[str]:
        """Names of the tables in the folder."""
        return sorted(path.stem for path in self.folder.glob("*.csv"))

    def compared(self, kind: str) -> Iterator[tuple[Analysis, Analysis]]:
        """Analyses of a type in the time domain, each with the mode it is compared with, of the same model."""
        for analysis in self.of_kind(kind):
            mode = self.analyses.get(str(analysis.attributes.get("mode")))
            if mode is not None and len(mode) and of_one_model(analysis, mode):
                yield analysis, mode

    def _attribute(self, name: str) -> Any:
        if not has_results(self.folder):
            return None
        with open_results(self.folder / "results.h5") as file:
            return file.attrs.get(name)


def _numbers(values: list[str]) -> Any:
    try:
        return np.array([float(value) if value else np.nan for value in values])
    except ValueError:
        return np.array(values)
