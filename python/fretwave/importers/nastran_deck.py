"""Cards of a Nastran bulk data deck, whatever their fields, as lines of free fields that pyyeti reads.

Rules (MSC Nastran, Quick Reference Guide, "Format of Bulk Data Entries"): a card has fields of 8 or, with ``*`` behind
its name, of 16 columns up to column 72, or fields parted by commas; a line goes on with the card before where its first
field is blank or begins with ``+`` or ``*``, and has a width of its own; comments and blank lines may stand between.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from ..errors import InputError
from ..texts import display, shortened

#: Data fields of a line by their width.
FIELDS = {8: 8, 16: 4}
#: Lines over which the quoted name of a file may go.
QUOTED = 8
_INCLUDE = re.compile(r"\s*INCLUDE[\s,]*([\"']?)(.*)", re.IGNORECASE | re.DOTALL)


def flat(path: Path, wanted: re.Pattern[str]) -> str:
    """The cards of some names, eight fields a line, and ENDDATA where the deck has it.

    Raises
    ------
    InputError
        A card is a copy of another or has a wrong name, a line goes on elsewhere, there are several models, or an
        included file is not there.
    """
    deck = _Deck(wanted)
    for place, line in _lines(path, path.parent, ()):
        if not deck.add(place, line):
            break
    deck.check()
    return _text(deck.cards)


class _Deck:
    """The cards of some names of a deck, taken up line by line.

    Attributes
    ----------
    cards : list
        Name and fields of each.
    """

    def __init__(self, wanted: re.Pattern[str]) -> None:
        self._wanted = wanted
        self._begin()

    def _begin(self) -> None:
        """What stands before the bulk data counts no more."""
        self.cards: list[list[str]] = []
        #: Place and line of copies and of wrong names.
        self._odd: list[tuple[str, str]] = []
        #: Place, line and mark of lines that go on with no line before them.
        self._astray: list[tuple[str, str, str]] = []
        #: Marks at the ends of the cards so far that are read.
        self._ends = {""}
        #: Whether the last card is read; None where there is none yet.
        self._reading: bool | None = None
        #: Mark at the end of the last line.
        self._marked = ""

    def add(self, place: str, line: str) -> bool:
        """Take up a line; False where the deck ends with it."""
        name, fields, mark = _fields(line)
        if name == "ENDDATA":
            self.cards.append([name])
            return False
        if name.startswith("BEGIN"):
            _check_one_model(place, line)
            self._begin()
        elif name[:1] in ("", "+", "*"):
            self._go_on(place, line, name, fields)
        else:
            self._card(place, line, name, fields)
        self._marked = mark
        return True

    def _card(self, place: str, line: str, name: str, fields: list[str]) -> None:
        self._ends = self._all_ends()
        known = self._wanted.match(name)
        self._reading = known is not None and name[known.end() :].strip() in ("", "*")
        if known and self._reading:
            self.cards.append([known[0], *fields])
        elif name.startswith("=") or (known and "=" not in line):
            self._odd.append((place, line))

    def _go_on(self, place: str, line: str, name: str, fields: list[str]) -> None:
        if self._reading is None or _bare(name) not in ("", _bare(self._marked)):
            self._astray.append((place, line, "" if self._reading is None else _bare(name)))
        if self._reading:
            _check_mark(place, line, self._marked, name)
            self.cards[-1] += fields

    def _all_ends(self) -> set[str]:
        """With that of the last card, if it is read."""
        return self._ends | ({_bare(self._marked)} if self._reading else set())

    def check(self) -> None:
        """At its end.

        Raises
        ------
        InputError
            A line goes on with a card that is not before it, or a card is a copy or has a wrong name.
        """
        _check_astray(self._astray, self._all_ends())
        for place, line in self._odd[:1]:
            expected, fix = "a name and fields of 8 or 16 columns, or with commas", "write each card out"
            raise InputError("a card is a copy of another, or has a wrong name", place, line.strip(), expected, fix)


def _lines(path: Path, root: Path, above: tuple[Path, ...]) -> Iterator[tuple[str, str]]:
    """File and line, and text of each line that is no comment, with those of included files."""
    lines = iter(enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1))
    for count, given in lines:
        line, place = given.partition("$")[0].expandtabs(), f"{display(path)}:{count}"
        found = _INCLUDE.match(given)
        if found is None:
            if line.strip():
                yield place, line
            continue
        name = _quoted(found[2], found[1], lines, place) if found[1] else found[2].partition("$")[0].strip()
        yield from _lines(_included(name, path, root, (*above, path.resolve()), place), root, (*above, path.resolve()))


def _quoted(text: str, quote: str, lines: Iterator[tuple[int, str]], place: str) -> str:
    """Up to the closing quote, on the next lines too; a dollar in it begins no comment."""
    for _, more in islice(lines, QUOTED - 1) if quote not in text else ():
        text = text.rstrip() + more.strip()
        if quote in text:
            break
    if quote not in text:
        what, expected = "the quote of an included file is not closed", f"a {quote} within {QUOTED} lines"
        raise InputError(what, place, shortened(text), expected, "close the quote behind the name")
    return text.partition(quote)[0]


def _included(name: str, path: Path, root: Path, above: tuple[Path, ...], place: str) -> Path:
    """Beside the file that names it, or from the folder of the first one."""
    found = next((folder / name for folder in (path.parent, root) if (folder / name).is_file()), None)
    if found is None:
        raise InputError("an included file does not exist", place, name, None, "put the file beside the deck")
    if found.resolve() in above:
        raise InputError("a file includes itself", place, name, "another file", "remove the line")
    return found


def _width(line: str) -> int:
    """Columns of a field, told by a star in the first one."""
    return 16 if "*" in (line.partition(",")[0] if "," in line else line[:8]) else 8


def _fields(line: str) -> tuple[str, list[str], str]:
    """First field, in capitals, data fields, and the mark at the end by which the next line goes on."""
    width = _width(line)
    most = FIELDS[width]
    if "," in line:
        name, *fields = [word.strip() for word in line.split(",")]
    else:
        name, fields = line[:8].strip(), [line[k : k + width].strip() for k in range(8, len(line[:72].rstrip()), width)]
        fields += [""] * (most - len(fields)) + [line[72:80].strip()]
    fields += [""] * (most - len(fields))
    return name.upper(), fields[:most], "".join(fields[most : most + 1])


def _check_one_model(place: str, line: str) -> None:
    if "=" in line:
        what, fix = "the deck has several models", "give a deck of the model alone"
        raise InputError(what, place, line.strip(), "BEGIN BULK once", fix)


def _check_mark(place: str, line: str, marked: str, name: str) -> None:
    """Lines that go on somewhere else are not looked for."""
    before, now = _bare(marked), _bare(name)
    if before and now and before != now:
        what, fix = "a line does not go on with the card before", "put it behind its card"
        raise InputError(what, place, line.strip(), f"a line that begins with {marked}", fix)


def _check_astray(astray: list[tuple[str, str, str]], ends: set[str]) -> None:
    """Lines that go on with no line before them, but with a card that is read by the mark at its end, or with none."""
    for place, line, mark in astray:
        if mark in ends:
            what, expected = "a line does not stand behind the card that it goes on with", "its card on the line before"
            raise InputError(what, place, line.strip(), expected, "put it behind its card")


def _bare(mark: str) -> str:
    return mark.lstrip("+*").strip().upper()


def _text(cards: list[list[str]]) -> str:
    """Without the blank fields at their ends."""
    lines = []
    for name, *fields in cards:
        while fields and not fields[-1]:
            fields.pop()
        lines += [",".join(["+" if k else name, *fields[k : k + 8]]) for k in range(0, max(1, len(fields)), 8)]
    return "\n".join([*lines, ""])
