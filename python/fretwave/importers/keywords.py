"""Keywords of an Abaqus or CalculiX input deck with their options and data lines.

Layout (SIMULIA, Abaqus Keywords Reference, "Input syntax rules"; G. Dhondt, CalculiX CrunchiX User's Manual): a keyword
line that ends in a comma goes on; ``**`` is a comment; the lines of an ``*INCLUDE`` stand in its place, within a set or
table too, and those of the file that ``*NODE, INPUT=`` and the like name; a blank field is zero; exponents are E or D.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError
from ..texts import display, number_in

#: Keywords whose data lines may stand in a file of their own, which the option INPUT names (Abaqus).
ELSEWHERE = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "BOUNDARY")
#: Data lines: file and line, text.
Lines = list[tuple[str, str]]


def blocks(path: Path) -> Iterator[tuple[str, dict[str, str], Lines]]:
    """Keyword, options and data lines of each block; ``*INCLUDE`` is followed.

    Raises
    ------
    InputError
        An included file does not exist, or includes itself.
    """
    keyword, options, data = "", dict[str, str](), Lines()
    for place, text in _lines(path, ()):
        if not text.startswith("*"):
            data.append((place, text))
            continue
        yield keyword, options, data
        keyword, options, data = *_keyword(text), []
    yield keyword, options, data


def number(word: str) -> float:
    """Of a field, which may be blank, with the exponent E or D.

    Raises
    ------
    ValueError
        It is no number.
    """
    return number_in(word.upper().replace("D", "E") or "0")


def _lines(path: Path, above: tuple[Path, ...]) -> Iterator[tuple[str, str]]:
    """File and line, and text of each line that is no comment, keywords in one line."""
    lines = iter(enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1))
    for count, line in lines:
        text, place = line.strip(), f"{display(path)}:{count}"
        if not text or text.startswith("**"):
            continue
        while text.startswith("*") and text.endswith(","):  # a keyword line goes on
            text += next(lines, (0, ""))[1].strip() or " "
        keyword, options = _keyword(text) if text.startswith("*") else ("", {})
        if keyword == "INCLUDE":
            yield from _included(path.parent / options.get("INPUT", ""), (*above, path.resolve()), place, text)
        else:
            yield place, text
        if keyword in ELSEWHERE and "INPUT" in options:
            yield from _included(path.parent / options["INPUT"], (*above, path.resolve()), place, text)


def _included(path: Path, above: tuple[Path, ...], place: str, text: str) -> Iterator[tuple[str, str]]:
    if not path.is_file():
        raise InputError("an included file does not exist", place, text, None, "put the file beside the deck")
    if path.resolve() in above:
        raise InputError("a file includes itself", place, text, "another file", "remove the line")
    yield from _lines(path, above)


def _keyword(text: str) -> tuple[str, dict[str, str]]:
    words = [word.strip() for word in text[1:].split(",")]
    pairs = [word.partition("=") for word in words[1:] if word]
    return words[0].upper(), {name.strip().upper(): value.strip().strip('"') for name, _, value in pairs}


def turns_nothing(data: Lines) -> bool:
    """A ``*SYSTEM`` that ends, or whose origin is (0, 0, 0), b on axis x and c in the plane x, y: the global one."""
    try:
        given = [[number(word.strip()) for word in text.split(",")] for _, text in data]
    except ValueError:
        return False
    (ax, ay, az, bx, by, bz), (cx, cy, cz) = (
        ((given[k] if k < len(given) else []) + width * [0.0])[:width] for k, width in ((0, 6), (1, 3))
    )
    along = bx > 0 or not (bx or cx or cy)  # without b it is moved alone
    return along and not (ax or ay or az or by or bz or cz) and (cy > 0 or not (cx or cy))
