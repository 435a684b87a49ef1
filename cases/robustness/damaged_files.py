"""Damage the files that fretwave reads, at random places, and see how each command takes it.

    .venv/bin/python cases/robustness/damaged_files.py [--count 400] [--seed 1] [--out FOLDER]

Right is: exit 0 with unchanged output (the damage was where nothing is read), or exit 2 (1 for a missing right) with
the file named, no traceback, no crash, no hang, and every other file of the folder as it was.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import scipy.io
import scipy.sparse as sp
import small_runs
from small_runs import call, clean


@dataclass(frozen=True)
class Target:
    """A file to damage and a command that reads it; `{folder}` is where both are."""

    name: str
    file: str
    command: list[str]


RESULTS = [["show", "{folder}/run"], ["resume", "{folder}/run", "--no-plots"], ["plot", "{folder}/run"]]
RESULTS += [["report", "{folder}/run", "--out", "{folder}/page.html"], ["probe", "{folder}/run", "--pairs"]]


#: Of the imported chain.
CASE = """
[model]
file = "model.h5"

[[analysis]]
name = "linear"
type = "linear"
"""


def targets() -> list[Target]:
    """Every kind of file that fretwave reads."""
    found = [Target(f"results.h5, {c[0]}", "run/results.h5", c) for c in RESULTS]
    found += [Target(f"run.json, {c[0]}", "run/run.json", c) for c in RESULTS[:2]]
    found += [Target(f"journal, {c[0]}", "cut/.mode.rows", [w.replace("/run", "/cut") for w in c]) for c in RESULTS[:2]]
    found += [Target("case.toml of a run, resume", "cut/case.toml", ["resume", "{folder}/cut", "--no-plots"])]
    found += [Target("model.h5, check", "model.h5", ["check", "{folder}/case.toml"])]
    for suffix in ("mtx", "npz", "mat", "v73.mat", "petsc", "sti"):
        command = ["import", "{folder}/made.h5", "--mass", f"{{folder}}/M.{suffix}", "--stiffness"]
        found.append(Target(f"{suffix}, import", f"K.{suffix}", [*command, f"{{folder}}/K.{suffix}", "--modes", "2"]))
    return found


def matrices() -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Mass and stiffness of a chain of 40."""
    n = 40
    K = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1], format="csr")
    return sp.identity(n, format="csr") * 0.5, K * 1e3


def write_files(folder: Path) -> None:
    """A finished run, one that was cut off, a model file with its case, and matrices in every format."""
    folder.mkdir(parents=True)
    plain = [str(small_runs.TWO_DOF), *small_runs.overrides(small_runs.SHORT), "--only", "mode", "--no-plots"]
    assert call(["run", *plain, "--out", str(folder / "run")], folder).code == 0
    calls = 200
    from kills import Counting

    gone = folder / "two_dof.toml"  # resumed from the copy in the run's folder
    shutil.copyfile(small_runs.TWO_DOF, gone)
    cut = ["run", str(gone), *plain[1:], "--out", str(folder / "cut")]
    assert call(cut, folder, Counting(calls, False).install).code == -9
    gone.unlink()
    for letter, matrix in zip("MK", matrices()):
        lower = sp.tril(matrix).tocoo()
        scipy.io.mmwrite(str(folder / f"{letter}.mtx"), matrix)
        sp.save_npz(folder / f"{letter}.npz", matrix)
        scipy.io.savemat(str(folder / f"{letter}.mat"), {letter: matrix.tocsc()}, do_compression=letter == "M")
        _write_v73(folder / f"{letter}.v73.mat", letter, matrix.tocsc())
        write_petsc(folder / f"{letter}.petsc", matrix)
        lines = [f"{c + 1} {r + 1} {v:.14e}" for r, c, v in zip(lower.row, lower.col, lower.data)]
        (folder / f"{letter}.sti").write_text("\n".join(lines) + "\n")
    made = ["import", str(folder / "model.h5"), "--mass", str(folder / "M.npz"), "--stiffness", str(folder / "K.npz")]
    assert call([*made, "--name", "tip=d1", "--modes", "2"], folder).code in (0, 2)
    if not (folder / "model.h5").exists():
        ended = call([*made, "--modes", "2"], folder)
        assert ended.code == 0, ended.err
    (folder / "case.toml").write_text(CASE)
    assert call(["check", str(folder / "case.toml")], folder).code == 0


def _write_v73(path: Path, name: str, matrix: sp.csc_matrix) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group(name)
        group.attrs["MATLAB_sparse"] = np.uint64(matrix.shape[0])
        for key, values in (("data", matrix.data), ("ir", matrix.indices), ("jc", matrix.indptr)):
            group[key] = values.astype("u8") if key != "data" else values
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def write_petsc(path: Path, matrix: sp.csr_matrix) -> None:
    head = np.array([1211216, *matrix.shape, matrix.nnz], ">i4")
    rows = np.diff(matrix.indptr).astype(">i4")
    path.write_bytes(
        head.tobytes() + rows.tobytes() + matrix.indices.astype(">i4").tobytes() + matrix.data.astype(">f8").tobytes()
    )


def damaged(content: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """One of the ways in which files break."""
    data, size = bytearray(content), len(content)
    way = int(random.integers(6))
    if way == 0:
        return "cut", content[: int(random.integers(size))]
    if way == 1:
        at = int(random.integers(size))
        data[at : at + 4096] = bytes(len(data[at : at + 4096]))
        return "zeros", bytes(data)
    if way == 2:
        return "bytes", _overwritten(data, random, int(random.integers(1, 9)), size)
    if way == 3:
        return "head", _overwritten(data, random, int(random.integers(1, 5)), min(size, 600))
    if way == 4:
        at, other = (int(n) for n in random.integers(size, size=2))
        data[at : at + 512] = data[other : other + 512]
        return "block", bytes(data)
    return "text", content[: int(random.integers(size))] + b"<html>504</html>" * 4


def _overwritten(data: bytearray, random: np.random.Generator, count: int, within: int) -> bytes:
    for at in random.integers(within, size=count):
        data[int(at)] = int(random.integers(256))
    return bytes(data)


def state_of(folder: Path, but: Path) -> dict[str, bytes]:
    """Every file of a folder but one (and pictures, the lock and files of the harness)."""
    skipped = (".png", ".txt", ".lock", ".vtkhdf")
    files = [p for p in sorted(folder.rglob("*")) if p.is_file() and p != but and not p.name.endswith(skipped)]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def trial(target: Target, source: Path, folder: Path, random: np.random.Generator) -> tuple[str, str]:
    """How a command took a damaged file, and what was wrong with that ("" for nothing)."""
    shutil.copytree(source, clean(folder))
    path = folder / target.file
    way, content = damaged(path.read_bytes(), random)
    path.write_bytes(content)
    before = state_of(folder, path)
    ended = call([word.format(folder=folder) for word in target.command], folder, patience=120)
    outcome = f"exit {ended.code}"
    wrong = ""
    if ended.hung:
        wrong = "hangs"
    elif ended.code < 0 or ended.code not in (0, 2, 3):
        wrong = f"exit {ended.code}"
    elif "Traceback" in ended.err:
        wrong = "traceback"
    elif ended.code == 2 and (path.read_bytes() != content or state_of(folder, path) != before):
        wrong = "files were changed"
    elif ended.code == 2 and not any(part in ended.err for part in (path.name, "mode")):
        wrong = "the file is not named"
    detail = f"{target.name}, {way}: {wrong}: {' '.join(ended.err.split())[-400:]}" if wrong else ""
    return outcome, detail


def main() -> int:
    """Print a table; exit code 1 when a file was not taken as it should."""
    options = small_runs.begin(__doc__, count=400, seed=1)
    folder = options.out
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    write_files(clean(folder / "whole"))
    random, began = np.random.default_rng(options.seed), time.monotonic()
    outcomes: Counter[tuple[str, str]] = Counter()
    bad: Counter[str] = Counter()
    every = targets()
    for number in range(options.count):
        target = every[number % len(every)]
        outcome, wrong = trial(target, folder / "whole", folder / "damaged", random)
        outcomes[target.name, outcome] += 1
        bad[target.name] += bool(wrong)
        if wrong:
            print(f"{number}: {wrong}", flush=True)
    print("| file, command | damaged | exit 0 | exit 2 | not as it should be |\n|---|---|---|---|---|")
    for target in every:
        counts = {code: outcomes[target.name, f"exit {code}"] for code in (0, 2)}
        total = sum(count for (name, _), count in outcomes.items() if name == target.name)
        print(f"| {target.name} | {total} | {counts[0]} | {counts[2]} | {bad[target.name]} |")
    print(f"{options.count} files, {sum(bad.values())} not as it should be, {time.monotonic() - began:.0f} s")
    return int(sum(bad.values()) > 0)


if __name__ == "__main__":
    sys.exit(main())
