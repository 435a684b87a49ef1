"""Find the line of a key or value in TOML text, by its path.

``tomllib`` gives values without positions. This scanner walks text that has already been parsed without
error, so it need not validate anything: it only follows tables, keys and brackets.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from typing import Union

Path = tuple[Union[str, int], ...]

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE = re.compile(r"[^\s,\]\}#=]+")
_KEY = re.compile(r"[A-Za-z0-9_-]+|\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'")
_STRING = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL)


class Locator:
    """Lines of all keys and array entries of a TOML text.

    Parameters
    ----------
    text : str
        TOML that ``tomllib`` accepts.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._newlines = [found.start() for found in re.finditer("\n", text)]
        self._lines: dict[Path, int] = {}
        self._array_tables: dict[Path, int] = {}
        self._scan()

    def line(self, path: Path) -> int:
        """Line of the deepest part of `path` that is in the text (1 when none is)."""
        for length in range(len(path), 0, -1):
            if path[:length] in self._lines:
                return self._lines[path[:length]]
        return 1

    def __contains__(self, path: Path) -> bool:
        return path in self._lines

    def _mark(self, path: Path) -> None:
        self._lines.setdefault(path, bisect_left(self._newlines, self._at) + 1)

    def _scan(self) -> None:
        table: Path = ()
        for _ in self._items():
            if self._text[self._at] == "[":
                table = self._header()
            else:
                self._pair(table)

    def _items(self) -> Iterator[None]:
        """Stop before each header or key until the text ends."""
        while self._skip_blank() < len(self._text):
            yield

    def _skip_blank(self) -> int:
        found = _BLANK.match(self._text, self._at)
        self._at = found.end() if found else self._at
        return self._at

    def _header(self) -> Path:
        """``[a.b]`` or ``[[a.b]]``; returns the path of the table it opens."""
        is_array = self._text.startswith("[[", self._at)
        start = self._at
        self._at += 2 if is_array else 1
        path = self._resolve(self._keys())
        end, self._at = self._at, start
        if is_array:
            self._mark(path)
            count = self._array_tables[path] = self._array_tables.get(path, -1) + 1
            path = (*path, count)
        self._mark(path)
        self._at = end + (2 if is_array else 1)
        return path

    def _resolve(self, keys: Path) -> Path:
        """Insert the number of the newest entry behind each array table in `keys`."""
        path: Path = ()
        for position, key in enumerate(keys):
            path = (*path, key)
            if path in self._array_tables and position < len(keys) - 1:
                path = (*path, self._array_tables[path])
        return path

    def _keys(self) -> Path:
        """A dotted key; leaves the position behind it."""
        keys: list[str | int] = []
        while True:
            self._skip_blank()
            found = _KEY.match(self._text, self._at)
            if found is None:
                return tuple(keys)
            keys.append(found.group().strip("\"'"))
            self._at = found.end()
            self._skip_blank()
            if not self._text.startswith(".", self._at):
                return tuple(keys)
            self._at += 1

    def _pair(self, table: Path) -> None:
        start = self._at
        path = (*table, *self._keys())
        end, self._at = self._at, start
        for length in range(len(table) + 1, len(path) + 1):
            self._mark(path[:length])
        self._at = end + 1
        self._value(path)

    def _value(self, path: Path) -> None:
        self._skip_blank()
        opening = self._text[self._at : self._at + 1]
        if opening == "[":
            self._array(path)
        elif opening == "{":
            self._inline_table(path)
        else:
            found = (_STRING if opening in "\"'" else _BARE).match(self._text, self._at)
            self._at = found.end() if found else self._at + 1

    def _array(self, path: Path) -> None:
        self._at += 1
        number = 0
        while not self._closed("]"):
            self._mark((*path, number))
            self._value((*path, number))
            number += 1

    def _inline_table(self, path: Path) -> None:
        self._at += 1
        while not self._closed("}"):
            self._pair(path)

    def _closed(self, bracket: str) -> bool:
        """Step over a comma; True (and behind the bracket) at the end of the array or table."""
        self._skip_blank()
        if self._text.startswith(",", self._at):
            self._at += 1
            self._skip_blank()
        if self._at >= len(self._text):
            return True
        if self._text[self._at] == bracket:
            self._at += 1
            return True
        return False
