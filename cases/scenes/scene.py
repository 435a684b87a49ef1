"""What a scene is, how it becomes a case file, and how `fretwave run` is called on it."""

from __future__ import annotations

import json
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from .equations import Contact

WAIT = 10  #: times its processor time that a run may last
INLINE = 30  #: dofs up to which the matrices stand in the case file
BUILDER = '''"""The model beside this file."""

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from fretwave import Pairs, Structure

HERE = Path(__file__).parent


def build():
    load = lambda name: sp.load_npz(HERE / f"{name}.npz")
    arrays = np.load(HERE / "contacts.npz")
    contacts, dofs = {}, {f"x{i}": i for i in range(load("M").shape[0])}
    for name in sorted({key.split("/")[0] for key in arrays}):
        values = {key.split("/")[1]: arrays[key] for key in arrays if key.startswith(name + "/")}
        components = int(values.pop("components"))
        contacts[name] = Pairs(load("B_" + name), components, {k: np.array(v) for k, v in values.items()})
    C = load("C") if (HERE / "C.npz").exists() else None
    return Structure(load("M"), load("K"), C, dofs=dofs, pairs=contacts)
'''


@dataclass
class Scene:
    """A case with one analysis, and what its answer must be.

    Attributes
    ----------
    axis, name : where it stands in the table
    M, K, C : (n, n); dofs are named x0, x1, ...
    analysis : keys of [[analysis]]
    answer : "branch" to the asked end; "unbounded": there is none, and exit 3 names the level; "none": no mode at all
    closed : functions of a `judge.Run`, each giving what is wrong against a closed form
    folds, reports : numbers of folds, and of solutions at reported values, where known
    preload : the pairs' own normal loads are balanced; None: there are none
    twin : the same scene in other units, and the factors (length, time) from this scene's units to the twin's
    quick : part of the short list of the tests
    """

    axis: str
    name: str
    M: Any
    K: Any
    contacts: list[Contact]
    analysis: dict[str, Any]
    C: Any = None
    answer: str = "branch"
    closed: Sequence[Callable[[Any], list[str]]] = ()
    folds: int | None = None
    reports: dict[float, int] = field(default_factory=dict)
    preload: bool | None = None
    twin: tuple[Scene, float, float] | None = None
    quick: bool = False
    timeout: float = 30.0
    note: str = ""


@dataclass
class Finished:
    """A run of the command line."""

    code: int | None
    seconds: float
    text: str
    folder: Path
    last: str = field(default="")


#: Runs a scene in a folder.
Runner = Callable[[Scene, Path], Finished]


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if isinstance(value, (bool, str)):
        return json.dumps(value)
    return repr(int(value)) if isinstance(value, (int, np.integer)) else repr(float(value))


def write(scene: Scene, folder: Path) -> Path:
    """Write the case of a scene; returns the case file."""
    folder.mkdir(parents=True, exist_ok=True)
    n = np.shape(scene.M)[0]
    inline = n <= INLINE and all(contact.components == 1 for contact in scene.contacts)
    lines = [f"title = {_toml(scene.name)}", "", "[model]"]
    if inline:
        lines.append(f"dofs = {_toml([f'x{i}' for i in range(n)])}")
        for letter, A in (("M", scene.M), ("K", scene.K), ("C", scene.C)):
            if A is not None:
                lines.append(f"{letter} = {_toml(np.asarray(A if not sp.issparse(A) else A.toarray(), float))}")
    else:
        lines.append('builder = "model.py"')
        _write_builder(scene, folder)
    if scene.preload is not None:
        lines += ["", "[preload]", *([] if scene.preload else ["balanced = false"])]
    for contact in scene.contacts:
        lines += ["", "[[contact]]", f"name = {_toml(contact.name)}", f"law = {_toml(contact.law)}"]
        if inline:
            lines.append(f"pairs = {_toml(_pairs(contact))}")
            lines += [f"{key} = {_toml(value)}" for key, value in contact.parameters.items()]
    lines += ["", "[[analysis]]", 'name = "scene"', *(f"{k} = {_toml(v)}" for k, v in scene.analysis.items())]
    (folder / "case.toml").write_text("\n".join(lines) + "\n")
    return folder / "case.toml"


def _pairs(contact: Contact) -> list[Any]:
    """Rows of +1 (against ground) or -1, +1 as names of dofs."""
    pairs = []
    for row in sp.csr_matrix(contact.B).toarray():
        second, first = np.flatnonzero(row == 1), np.flatnonzero(row == -1)
        assert len(second) == 1 and len(first) <= 1 and np.count_nonzero(row) == len(first) + 1
        pairs.append([f"x{first[0]}", f"x{second[0]}"] if len(first) else f"x{second[0]}")
    return pairs


def _write_builder(scene: Scene, folder: Path) -> None:
    (folder / "model.py").write_text(BUILDER)
    for letter, A in (("M", scene.M), ("K", scene.K), ("C", scene.C)):
        if A is not None:
            sp.save_npz(folder / f"{letter}.npz", sp.csr_matrix(A))
    arrays: dict[str, Any] = {}
    for contact in scene.contacts:
        sp.save_npz(folder / f"B_{contact.name}.npz", sp.csr_matrix(contact.B))
        arrays[f"{contact.name}/components"] = contact.components
        arrays.update({f"{contact.name}/{key}": value for key, value in contact.parameters.items()})
    np.savez(folder / "contacts.npz", **arrays)


def run(scene: Scene, folder: Path) -> Finished:
    """`fretwave run` on a scene in its own process."""
    shutil.rmtree(folder, ignore_errors=True)
    case = write(scene, folder)
    command = [sys.executable, "-m", "fretwave", "run", str(case), "--no-plots", "--out", str(folder / "out")]
    begin = time.perf_counter()
    with (folder / "output.txt").open("w") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, preexec_fn=limit(scene.timeout))
        try:
            code: int | None = process.wait(WAIT * scene.timeout)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            code = None
    text = (folder / "output.txt").read_text()
    code = None if code in (-signal.SIGXCPU, -signal.SIGKILL) or "interrupted by SIGXCPU" in text else code
    return Finished(code, time.perf_counter() - begin, text, folder / "out")


def limit(seconds: float) -> Callable[[], None]:
    """Processor time a run may take: a busy machine makes nothing hang."""
    return lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
