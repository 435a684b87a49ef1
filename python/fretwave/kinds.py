"""Objects and paths as scripts give them, refused in one sentence where they are of another kind."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, TypeVar

import numpy as np

from .errors import InputError
from .texts import shortened

Work = TypeVar("Work", bound=Callable[..., Any])
#: How to make one, by the last word of its annotation.
MADE = {
    "Model": "fw.Model(M, K, contacts=[...])",
    "Harmonics": "fw.choose_harmonics(model, 7)",
    "Rest": "what fw.static_preload(model, load) returns",
    "StepControl": "fw.StepControl(maximum=0.1)",
    "WearControl": "fw.WearControl(tolerance=1e-3)",
    "LinearMode": "one of fw.linear_modes(model)",
    "HarmonicProblem": "fw.NonlinearMode(model, harmonics)",
    "NonlinearMode": "fw.NonlinearMode(model, harmonics)",
    "Reduction": "fw.reduce(M, K, keep=[...], modes=10)",
    "Structure": "fw.Structure(M, K)",
    "Branch": "what fw.follow(problem, start, stop) returns",
    "WornMode": "fw.WornMode(problem, coefficient, areas)",
    "UnitSystem": 'for example "mm-t-s"',
    "Comm": "a communicator of mpi4py",
    "Intracomm": "a communicator of mpi4py",
    "Vec": "a vector of petsc4py, such as problem.initial(0.1)",
    "Pairs": "fw.Pairs(B)",
    "PythonLaw": "a name of fw.laws(), or a law made from fw.PythonLaw",
    "Path": "the name of a file or folder",
    "bool": "True or False",
    "Callable": "a function",
}


def of_their_kinds(work: Work) -> Work:
    """Arguments that are annotated as objects of `MADE`, with None or str beside them, are such; else InputError."""
    parameters = signature(work)
    kinds = {name: _kinds(str(one.annotation)) for name, one in parameters.parameters.items()}
    known = {name: options for name, options in kinds.items() if _told(options)}
    place = work.__qualname__.removesuffix(".__init__")

    @wraps(work)
    def checked(*args: object, **given: object) -> Any:
        try:
            bound = parameters.bind_partial(*args, **given).arguments
        except TypeError:
            return work(*args, **given)  # Python's own words, with the name
        for name, value in bound.items():
            if name in known and not _fits(value, known[name]):
                expected = " or ".join(sorted(known[name]))
                measured, where = f"{shortened(repr(value), 60)}, a {type(value).__name__}", f"{place}({name}=...)"
                fix = f"give {next(MADE[one] for one in sorted(known[name]) if one in MADE)}"
                raise InputError("an argument is of another kind", where, measured, expected, fix)
        return work(*args, **given)

    return checked  # type: ignore[return-value]


def _kinds(annotation: str) -> frozenset[str]:
    """``PETSc.Vec | None``: Vec, None."""
    return frozenset(word.strip().rpartition(".")[2] for word in re.sub(r"\[.*\]", "", annotation).split("|"))


def _told(options: frozenset[str]) -> bool:
    return bool(options & {*MADE}) and options <= {*MADE, "None", "str"}


def _fits(value: object, options: frozenset[str]) -> bool:
    if value is None:
        return "None" in options
    if "Path" in options and isinstance(value, os.PathLike):
        return True
    if "Callable" in options:
        return callable(value)
    if "bool" in options and isinstance(value, (bool, np.bool_, int, np.integer)):
        return value in (0, 1)
    classes = {one.__name__ for one in type(value).__mro__ if one.__module__.partition(".")[0] == _home(one.__name__)}
    return bool(classes & options) and (bool(value) or not classes & {"Comm"})  # MPI.COMM_NULL is no communicator


def _home(name: str) -> str:
    """The package that a class of this name is of."""
    return {"Comm": "mpi4py", "Intracomm": "mpi4py", "Vec": "petsc4py", "str": "builtins"}.get(name, "fretwave")
