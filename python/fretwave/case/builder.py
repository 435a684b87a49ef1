"""Models built by Python: what a builder gives back, and how it is called."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import typing
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from ..errors import FretwaveError, InputError
from ..model.structure import Structure
from ..texts import display, nearest, shortened, toml
from .python_file import check_there, line_of
from .toml.source import Source
from .toml.validation import at


def run_builder(given: str, options: Mapping[str, Any], source: Source, found: list[FretwaveError]) -> Structure | None:
    """Call a builder; what is wrong is appended to `found`, with the builder's own file and line where it is there."""
    path = source.path.parent / given
    before = len(found)
    try:
        module = _import(path, source)
        function = getattr(module, "build", None)
        if not callable(function):
            raise InputError(
                "the builder has no function build",
                display(path),
                fix="define `def build(**options)` returning fretwave.Structure",
            )
        chosen = _checked(module, function, options, source, found)
        built = function(**chosen) if len(found) == before else None
    except (Exception, SystemExit) as error:  # whatever a builder may do, it is not a defect of ours
        found.append(_blame(error, path, source))
        return None
    return _consistent(built, path, found) if len(found) == before else None


def builder_digest(given: str, source: Source) -> str:
    """Hash of the builder's text: a changed builder is a changed case."""
    return hashlib.sha256((source.path.parent / given).read_bytes()).hexdigest()[:16]


def _import(path: Path, source: Source) -> ModuleType:
    where = source.where(("model", "builder"))
    check_there(path, "there is no such builder", where, "a Python file beside the case")
    spec = importlib.util.spec_from_file_location(f"fretwave_builder_{path.stem}", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def known_options(module: ModuleType, function: Callable[..., object]) -> dict[str, Any] | None:
    """Options of a builder with their types: arguments of build; for ``**options`` the fields of `Options`.

    None when any option is taken.
    """
    parameters = inspect.signature(function).parameters.values()
    hints = typing.get_type_hints(function)
    known = {p.name: hints.get(p.name, Any) for p in parameters if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)}
    if not any(p.kind == p.VAR_KEYWORD for p in parameters):
        return known
    table = getattr(module, "Options", None)
    if table is None or not is_dataclass(table):
        return None
    hints = typing.get_type_hints(table)
    return {f.name: hints[f.name] for f in fields(table)}


def _checked(
    module: ModuleType,
    function: Callable[..., object],
    options: Mapping[str, Any],
    source: Source,
    found: list[FretwaveError],
) -> dict[str, Any]:
    """Options of known names, converted to the types that the builder says."""
    known = known_options(module, function)
    if known is None:
        return dict(options)
    values = {}
    for name, value in options.items():
        path = ("model", "options", name)
        if name not in known:
            problem = f"unknown option '{name}' of the builder"
            fix = nearest(name, list(known)) or "remove the option"
            found.append(
                InputError(problem, source.where(path), f"{name} = {toml(value)}", f"one of {', '.join(known)}", fix)
            )
            continue
        try:
            values[name] = value if known[name] is Any else _read(TypeAdapter(known[name]), value)
        except ValidationError as error:
            rule = "; ".join(sorted({item["msg"] for item in error.errors(include_url=False)}))
            what, measured = f"the option '{name}' has a wrong value", toml(at(source.data, path))
            fix = f"write what the builder's {function.__name__}() takes for it"
            found.append(InputError(what, source.where(path), measured, rule, fix))
    return values


def _read(kind: TypeAdapter[object], value: object) -> object:
    """As of JSON: a list may be a tuple, a text a path, and no text or truth value a number."""
    return kind.validate_json(to_json(value, inf_nan_mode="constants"), strict=True)


def _blame(error: BaseException, path: Path, source: Source) -> InputError:
    """An exception of the builder as bad input, with the builder's line that raised it or led to it."""
    line = line_of(error, path)
    where = f"{display(path)}:{line}" if line else source.where(("model", "builder"))
    if isinstance(error, FretwaveError):
        place = error.where if error.where and not line else where
        return InputError(error.what, place, error.measured, error.expected, error.fix)
    what = f"the builder failed: {type(error).__name__}: {shortened(str(error))}"
    return InputError(what, where, fix="correct the builder, or the options in [model.options]")


def _consistent(built: object, path: Path, found: list[FretwaveError]) -> Structure | None:
    problem: str | None = f"it returned {type(built).__name__}"
    if isinstance(built, Structure):
        try:
            built = built.sparse()
            problem = built.complaint()
        except Exception as error:  # entries of any type may stand in it
            problem = f"{type(error).__name__}: {shortened(str(error))}"
        if problem is None:
            return built
    expected = "fretwave.Structure with matrices, pairs and loads that fit each other"
    found.append(
        InputError("the builder gave no usable model", display(path), problem, expected, "correct the builder")
    )
    return None
