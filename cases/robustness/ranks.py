"""Every table of every case on 1, 2, 3 and 4 ranks: the same rows, and every number to 1e-8 of its column's maximum.

    .venv/bin/python cases/robustness/ranks.py [--cases two_dof ...] [--ranks 1 2 3 4] [--full] [--keep FOLDER]

Runs each case in its short form and writes one line a table: rows on each number of ranks, and the largest difference
of any entry from one rank with its column. Columns that say how a point was solved (iterations, residual, wall time)
are left out. Estimates of errors are solved to 1e-12 instead of 1e-3 (EXACT). Exit 1 if a table differs.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).resolve().parents[2]
#: How a point was solved, not what it is; quantities at rounding level.
WORK = {
    "wall_s",
    "cpu_s",
    "newton",
    "linear",
    "residual",
    "rounding",
    "accepted",
    "unfolding",
    "energy_error",
    "unclosed",
}
SAME = 1e-8
#: Four digits are enough of an estimate, and where it is solved by iteration they are other ones on other ranks.
EXACT, ITERATIONS = "-fw_error_tolerance 1e-12", "petsc=-error_tangent_ksp_max_it 2000"
ITERATED = {
    "blade_root": ["mode", "mode_epmc"],
    "blade_root_retained": ["mode"],
    "blisk_lumped": ["forced_mistuned", "mode_mistuned", "mode_wheel"],
    "blisk_ring": ["flutter", "forced", "mode", "mode_wheel"],
    "lap_joint": ["forced", "mode"],
    "shrouded_sector": ["forced"],
}
#: Columns that are shares already, not of their own largest: an error of wear of the mean normal load, distances of a
#: peak from the mode of its frequency and amplitude.
SHARE = {"step_error": 1.0, "distance_mode": 1.0, "quadrature_distance_mode": 1.0}
#: Of what a column is the error, by how it begins: held against that. What the solver left, which is part of it, is
#: rounding, and another on other ranks.
ERROR_OF = {"omega_error": "omega", "zeta_error": "zeta", "lambda_error": "omega", "amplitude_error": "amplitude"}
Table = dict[str, list[str]]
Array = npt.NDArray[np.float64]


def read(path: Path) -> Table:
    """Columns by name, without the units that a case not in SI writes beside."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name.partition(" [")[0]: [row[name] for row in rows] for name in (rows[0] if rows else {})}


def run(case: str, ranks: int, out: Path, full: bool) -> int:
    """By cases/run, which makes the model of a case that begins with a deck."""
    command = [str(ROOT / "cases/run"), case, "-n", str(ranks), "--out", str(out)]
    for name in ITERATED.get(case, []):
        command += ["--set", f"{name}.{ITERATIONS}"]
    command += ["--petsc", EXACT] if case in ITERATED else []
    done = subprocess.run([*command, "--no-plots", *([] if full else ["--quick"])], capture_output=True, text=True)
    if done.returncode:
        print(done.stderr[-2000:])
    return done.returncode


def difference(one: Table, other: Table) -> tuple[float, str]:
    """Largest difference of two tables with as many rows, relative to the column's maximum, and its column."""
    if set(one) != set(other):
        return np.inf, f"{', '.join(sorted(set(one) ^ set(other)))} in one alone"
    worst, where = 0.0, "-"
    for name in set(one) - WORK:
        try:
            a, b = (np.array([float(v) for v in table[name]]) for table in (one, other))
        except ValueError:
            apart = 0.0 if one[name] == other[name] else np.inf
        else:
            apart = apart_by(a, b, size_of(one, name))
        if apart > worst:
            worst, where = apart, name
    return worst, where


def size_of(table: Table, name: str) -> float:
    """Largest number of a column, of an error that of what it is one of."""
    if name in SHARE:
        return SHARE[name]
    whole = next((of for error, of in ERROR_OF.items() if name.startswith(error) and of in table), name)
    numbers = np.abs([float(v) for v in table[whole]])
    return float(np.max(numbers, where=np.isfinite(numbers), initial=0.0)) or 1.0


def apart_by(a: Array, b: Array, size: float) -> float:
    """Of two columns; inf where one has a number and the other none."""
    number = np.isfinite(a) & np.isfinite(b)
    if not np.array_equal(a[~number], b[~number], equal_nan=True):
        return np.inf
    return float(np.abs(a[number] - b[number]).max(initial=0.0) / size)


def compare(case: str, ranks: list[int], folder: Path, full: bool) -> bool:
    """Run a case on each number of ranks and print a line a table."""
    outs = {n: folder / f"{case}-{n}" for n in ranks}
    codes = {n: run(case, n, out, full) for n, out in outs.items()}
    good = not any(codes.values())
    for table in sorted({path.name for out in outs.values() for path in out.glob("*.csv")}):
        tables = {n: read(out / table) if (out / table).exists() else {} for n, out in outs.items()}
        rows = {n: len(next(iter(columns.values()), [])) for n, columns in tables.items()}
        same = len(set(rows.values())) == 1
        apart = [difference(tables[ranks[0]], tables[n]) for n in ranks[1:]] if same else [(np.inf, "rows")]
        worst, where = max(apart, default=(0.0, "-"))
        counts = ", ".join(str(count) for count in rows.values())
        print(f"| {case} | {table} | {counts} | {worst:.1e} | {where} |", flush=True)
        good &= worst <= SAME
    return good


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    cases = sorted(path.parent.name for path in (ROOT / "cases").glob("*/case.toml"))
    parser.add_argument("--cases", nargs="+", default=cases)
    parser.add_argument("--ranks", nargs="+", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--full", action="store_true", help="not the short form")
    parser.add_argument("--keep", type=Path, help="where the runs stay")
    told = parser.parse_args()
    print(f"| case | table | rows on {told.ranks} ranks | largest difference | column |\n|---|---|---|---:|---|")
    with tempfile.TemporaryDirectory() as folder:
        kept = told.keep or Path(folder)
        return 0 if all([compare(case, told.ranks, kept, told.full) for case in told.cases]) else 1


if __name__ == "__main__":
    sys.exit(main())
