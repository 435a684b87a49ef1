"""The data of a case file together with where each value came from."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import FretwaveError, InputError
from ...texts import display, nearest, shortened
from ...units import SI, SYSTEMS, UnitSystem
from .locate import Locator
from .locate import Path as KeyPath
from .plain import check_plain

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: What `tomllib` raises besides its own error: numbers of more than 4300 digits, and arrays nested without end.
TomlError = (tomllib.TOMLDecodeError, ValueError, RecursionError)
#: Top-level keys that an address may begin with; other addresses begin with a name.
TABLES = ("title", "plugins", "model", "reduction", "preload", "damping", "aerodynamics", "material", "uncertainty")
_PLAIN_TEXT = re.compile(r"[A-Za-z_./-][^\[\]{}\"'\n]*")


class Source:
    """A case file's data, overrides applied, with the origin of every value.

    Parameters
    ----------
    path : Path
        The TOML file.
    text : str, optional
        Its text, when it is not to be read from `path` (resume from the kept copy).

    Attributes
    ----------
    data : dict
        What ``tomllib`` gives, overrides applied.
    problems : list of FretwaveError
        Overrides that could not be applied.
    units_of_model : UnitSystem
        As the builder or the model file says, once it is read.
    dof_fix : callable
        What to do about a dof that is not among some names, once the model is read also by node and direction.
    factors : dict
        Of contacts' parameters, and where they were given.

    Raises
    ------
    InputError
        The file is missing or is not TOML.
    """

    def __init__(self, path: Path, text: str | None = None) -> None:
        self.path = path
        self.label = display(path)
        self.text = _read(path) if text is None else text
        self.data: dict[str, Any] = _parse(self.text, self.label)
        check_plain(self.data, self.label)
        self.problems: list[FretwaveError] = []
        self.units_of_model = SI
        self.dof_fix: Callable[[str, Sequence[str]], str | None] = nearest
        self._locator = Locator(self.text)
        self._origin: dict[KeyPath, str] = {}
        self.factors: dict[KeyPath, tuple[float, str]] = {}

    @property
    def units(self) -> UnitSystem:
        """The system that messages write units in: that of the case, or of its model, or SI."""
        given = self.data.get("model", {})
        declared = given.get("units") if isinstance(given, dict) else None
        return SYSTEMS.get(str(declared), self.units_of_model)

    def where(self, path: KeyPath) -> str:
        """``file:line (key)`` of a value, or the ``--set`` that gave it."""
        for length in range(len(path), 0, -1):
            if path[:length] in self._origin:
                return self._origin[path[:length]]
        return f"{self.label}:{self._locator.line(path)} ({self.name(path)})"

    def name(self, path: KeyPath) -> str:
        """A path as ``--set`` addresses it: ``mode.harmonics``, ``model.M[0][1]``."""
        parts: list[str | int] = list(path)
        if len(parts) > 1 and parts[0] in ("analysis", "contact", "gauge") and isinstance(parts[1], int):
            entry_name = self.entry_name(str(parts[0]), parts[1])
            if entry_name is None:
                head = f"{parts[0]}[{parts[1]}]"
            else:
                head = entry_name if parts[0] == "analysis" else f"{parts[0]}.{entry_name}"
            parts = [head, *parts[2:]]
        text = str(parts[0]) if parts else "case"
        for part in parts[1:]:
            text += f"[{part}]" if isinstance(part, int) else f".{part}"
        return text

    def entries(self, kind: str) -> list[dict[str, Any]]:
        """Tables of ``[[analysis]]``, ``[[contact]]`` or ``[[gauge]]`` (empty when the case has it wrong)."""
        entries = self.data.get(kind, [])
        good = isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)
        return entries if good else []

    def entry_name(self, kind: str, number: int) -> str | None:
        """Name of the entry `number` of an array of tables, None when it has none."""
        entries = self.entries(kind)
        name = entries[number].get("name") if number < len(entries) else None
        if name is None and kind == "contact":
            return "contact"
        return name if isinstance(name, str) else None

    def apply_quick(self) -> None:
        """Apply the overrides of the ``[quick]`` table."""
        quick = self.data.get("quick")
        if not isinstance(quick, dict):
            self.problems.append(
                InputError(
                    "this case has no short form",
                    where=self.label,
                    expected="a table [quick] of overrides, for example `mode.harmonics = 7`",
                    fix="run without --quick, or add the table",
                )
            )
            return
        for path, value in nested_leaves(quick):
            line = f"{self.label}:{self._locator.line(('quick', *path))} ([quick])"
            self.override(".".join(str(part) for part in path), value, line)

    def apply_set(self, assignment: str) -> None:
        """Apply one ``key=value`` of ``--set``."""
        origin = f"--set {shortened(assignment)}"
        address, equals, text = assignment.partition("=")
        if not equals or not address.strip():
            self.problems.append(
                InputError(
                    "an override is not key=value",
                    where=origin,
                    fix="write for example `--set mode.harmonics=7`",
                )
            )
            return
        try:
            value = parse_value(text)
            check_plain([address, value], origin)
        except InputError as error:
            self.problems.append(error)
            return
        except TomlError as error:
            self.problems.append(
                InputError(
                    "the value of an override is not TOML",
                    where=origin,
                    measured=f"{shortened(text)} ({error})",
                    expected='a TOML value: 7, 0.5, "text", [1.0, 2.0]',
                    fix="quote it for the shell: --set 'mode.amplitude=[0.02, 3.0]'",
                )
            )
            return
        self.override(address.strip(), value, origin)

    def override(self, address: str, value: object, origin: str) -> None:
        """Put a value at an address; `origin` is its place in messages."""
        path = self.path_of(address.split("."), origin)
        if path is None:
            return
        holder: Any = self.data
        for part, following in zip(path, path[1:]):
            holder = _step_into(holder, part, following)
        try:
            holder[path[-1]] = value
        except (TypeError, IndexError):
            self.problems.append(
                InputError(
                    f"'{address}' is not a place in this case",
                    where=origin,
                    fix=f"`fretwave check {self.label}` shows the case",
                )
            )
            return
        self._origin[path] = origin

    def path_of(self, parts: Sequence[str], origin: str) -> KeyPath | None:
        """Where an address points; analyses and contacts are addressed by name."""
        kind, rest = ("analysis", parts)
        if parts[0] in TABLES:
            return tuple(parts)
        if parts[0] in ("contact", "analysis", "gauge") and len(parts) > 1:
            kind, rest = parts[0], parts[1:]
        names = [self.entry_name(kind, number) for number in range(len(self.entries(kind)))]
        if rest[0] in names and len(rest) > 1:
            return (kind, names.index(rest[0]), *map(_part, rest[1:]))
        known = [name for name in names if name]
        address, key = ".".join(parts), ".".join(rest[1:]) or "<key>"
        head = "<analysis>" if kind == "analysis" else f"{kind}.<name>"
        problem = InputError(
            f"an override addresses nothing: '{address}'",
            where=origin,
            measured=f"'{rest[0]}'" if rest[0] not in names else f"'{address}' without a key",
            expected=f"{head}.<key> with one of the names {', '.join(known) or '(none)'}; or model.<key>",
            fix=self._meant(kind, rest[0], key) or "`fretwave check --keys` lists what may be set",
        )
        self.problems.append(problem)
        return None

    def _meant(self, kind: str, name: str, key: str) -> str | None:
        """The address of a near name: of a contact or a gauge with what it is, of an analysis without."""
        addresses = {
            own: f"{one}.{own}".removeprefix("analysis.")
            for one in ([kind] if kind != "analysis" else ["gauge", "contact", "analysis"])
            for number in range(len(self.entries(one)))
            if (own := self.entry_name(one, number)) is not None
        }
        return nearest(name, list(addresses), lambda near: f"did you mean `{addresses[near]}.{key}`?")


def _part(text: str) -> str | int:
    """Number of an array's entry, or a key."""
    return int(text) if re.fullmatch("[0-9]{1,9}", text) else text


def _step_into(holder: object, part: str | int, following: str | int) -> Any:
    """The table or array at `part`, made when it is not there."""
    if isinstance(holder, dict):
        return holder.setdefault(part, [] if isinstance(following, int) else {})
    if isinstance(holder, list) and isinstance(part, int) and part < len(holder):
        return holder[part]
    return None


def nested_leaves(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterable[tuple[tuple[str, ...], Any]]:
    """Path and value of everything in a table and its tables that is no table itself."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from nested_leaves(value, (*path, name))
        else:
            yield (*path, name), value


def parse_value(text: str) -> Any:
    """A TOML value; plain text is taken as a string, so that ``mode.method=EPMC`` needs no quotes."""
    try:
        parsed = tomllib.loads(f"value = {text}")
        if len(parsed) > 1:
            raise ValueError("more than one value")
        if _ends_in_comment(text):
            raise ValueError("what follows # is a comment")
        return parsed["value"]
    except TomlError:
        if _PLAIN_TEXT.fullmatch(text.strip()):
            return text.strip()
        raise


def _ends_in_comment(text: str) -> bool:
    """Whether TOML leaves out the end of a value: a bracket behind it closes nothing then."""
    try:
        tomllib.loads(f"value = [{text.strip()}]")
    except TomlError:
        return True
    return False


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError("the case file does not exist", display(path), fix=_similar_file(path)) from None
    except IsADirectoryError:
        raise InputError(
            "the case is a folder, not a file", display(path), fix=f"give {display(path / 'case.toml')}"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("the case file cannot be read", display(path), measured=error, expected="UTF-8 text") from None


def _similar_file(path: Path) -> str:
    folder = path.parent
    if not folder.is_dir():
        return f"there is no folder {display(folder)} either; check the path"
    near = nearest(path.name, sorted(entry.name for entry in folder.iterdir()), str)
    if near:
        return f"did you mean {display(folder / near)}?"
    cases = sorted(folder.glob("*.toml"))
    return f"did you mean {display(cases[0])}?" if cases else "check the path"


def _parse(text: str, label: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except TomlError as error:
        found = re.search(r"line (\d+)", str(error))
        line = int(found.group(1)) if found else text.count("\n") + 1
        lines = text.splitlines()
        shown = lines[line - 1].strip() if line <= len(lines) else "(end of file)"
        raise InputError(
            "the case file is not TOML",
            where=f"{label}:{line}",
            measured=f"{shortened(shown)}   ({shortened(str(error))})",
            expected="key = value, [table] or [[array of tables]]",
            fix="strings need quotes, arrays [ ], and a key may stand once in its table",
        ) from None
