"""Python files that a case names under `plugins`: each adds contact laws, kinds of analysis, formats of matrices.

A file is executed once for its text, on every rank: what is sent between ranks brings the files it needs. Their hashes
are among the values that decide the results, and run.json keeps their texts, so that a finished run can be drawn where
the files are not.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from .. import registry
from ..errors import FretwaveError, InputError
from ..model.laws import forget_law
from ..mpi.guard import PLUGIN
from ..texts import display, is_there, shortened, toml
from .python_file import check_there, line_of
from .toml.source import Source


def _forget_format(reader: Callable[..., Any]) -> None:
    from ..importers.formats import forget_format

    forget_format(reader)


FORGET: dict[str, Callable[..., None]] = {
    registry.ANALYSIS: registry.forget,
    registry.LAW: forget_law,
    registry.FORMAT: _forget_format,
}
#: What each file that is loaded has added, by its place.
_loaded: dict[str, tuple[Plugin, list[registry.Added]]] = {}


@dataclass(frozen=True)
class Plugin:
    """A file that adds laws, analyses or formats.

    Attributes
    ----------
    name : str
        As the case names it.
    path : str
    text : str
    """

    name: str
    path: str
    text: str

    @property
    def digest(self) -> str:
        """Hash of its text: a changed plug-in is a changed case."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]

    @property
    def module(self) -> str:
        """Name under which Python knows it."""
        return f"{PLUGIN}{Path(self.path).stem}_{self.digest}"

    def plain(self) -> dict[str, str]:
        """For run.json."""
        return {"name": self.name, "text": self.text}

    def __reduce__(self) -> tuple[Any, ...]:
        return load, (self.name, self.path, self.text)


def load(name: str, path: str, text: str) -> Plugin:
    """Execute a plug-in, unless its text was executed before; one of another text at this place is forgotten.

    Raises
    ------
    InputError
        It fails, with its own line, or adds nothing.
    """
    plugin = Plugin(name, path, text)
    if plugin.module in sys.modules:
        return plugin
    forget(path)
    module = ModuleType(plugin.module)
    module.__file__ = path
    sys.modules[plugin.module] = module
    with registry.noted() as added:
        _loaded[path] = (plugin, added)
        try:
            exec(compile(text, path, "exec"), module.__dict__)
            if not added:
                raise InputError(
                    "the plug-in adds nothing",
                    display(Path(path)),
                    expected="a contact law, an analysis or a format of matrices",
                    fix="put `@fw.register_law`, `@fw.register_analysis` or `@fw.register_format(...)` before it",
                )
        except (Exception, SystemExit) as error:  # whatever a user's file may do, it is not a defect of ours
            forget(path)
            raise _blame(error, Path(path)) from None
    return plugin


def load_file(path: Path) -> Plugin:
    """Load a plug-in that no case names.

    Raises
    ------
    InputError
    """
    try:
        return load(path.name, str(path.resolve()), path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("the plug-in cannot be read", display(path), str(error), "a Python file in UTF-8") from None


def loaded() -> list[Plugin]:
    """All that are loaded in this process."""
    return [plugin for plugin, _ in _loaded.values()]


def forget(path: str) -> None:
    """Take back what a plug-in has added, if it is loaded."""
    plugin, added = _loaded.pop(path, (None, []))
    for what, kind in added:
        FORGET[what](kind)
    if plugin is not None:
        sys.modules.pop(plugin.module, None)


def _blame(error: BaseException, path: Path) -> InputError:
    """What went wrong as bad input, with the line of the plug-in that raised it or led to it."""
    line = line_of(error, path)
    where = display(path) + (f":{line}" if line else "")
    if isinstance(error, FretwaveError):
        return InputError(error.what, where, error.measured, error.expected, error.fix)
    text = f"{type(error).__name__}: {shortened(str(error))}"
    return InputError(f"the plug-in failed: {text}", where, None, "a file that runs by itself", "correct the plug-in")


def read_plugins(
    source: Source, found: list[FretwaveError], kept: Sequence[Mapping[str, str]] = ()
) -> tuple[Plugin, ...]:
    """Load the plug-ins of a case; what is wrong is appended to `found`.

    Parameters
    ----------
    kept : texts of a run's record, for files that are gone
    """
    given = source.data.get("plugins", [])
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        where, fix = source.where(("plugins",)), 'write for example `plugins = ["my_law.py"]`'
        found.append(InputError("plugins is no list of files", where, toml(given), "Python files", fix))
        return ()
    texts = {entry["name"]: entry["text"] for entry in kept}
    plugins = []
    for number, name in enumerate(given):
        path = source.path.resolve().parent / name
        try:
            text = texts[name] if name in texts and not is_there(path) else _read(path, source, number)
            plugins.append(load(name, str(path), text))
        except InputError as error:
            found.append(error)
    return tuple(plugins)


def _read(path: Path, source: Source, number: int) -> str:
    where = source.where(("plugins", number))
    check_there(path, "there is no such plug-in", where, "a Python file, by its place from the case")
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        measured = f"{display(path)}: {error}"
        raise InputError("the plug-in cannot be read", where, measured, "a Python file in UTF-8") from None


def load_recorded(record: Mapping[str, Any]) -> list[str]:
    """Load the plug-ins of a finished run for its pictures: the files, where they are gone the texts kept.

    Returns
    -------
    A line for each that cannot be loaded here.
    """
    lines = []
    given = record["case"]
    for entry in given.get("plugins", []):
        path = Path(given["path"]).parent / entry["name"]
        try:
            text = path.read_text(encoding="utf-8") if is_there(path) and path.is_file() else entry["text"]
            load(entry["name"], str(path), text)
        except (InputError, OSError, UnicodeDecodeError) as error:
            lines.append(f"nothing of the plug-in '{entry['name']}' is drawn: {error}")
    return lines
