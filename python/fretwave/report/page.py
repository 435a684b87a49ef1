"""Pieces of a page: text is escaped here and nowhere else, and every tag that opens closes."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from string import Template

STYLE = """
:root { --ink: #222; --soft: #666; --line: #ccc; --blue: #0072B2; --bad: #b23c00; }
* { box-sizing: border-box; }
body { margin: 2rem auto; padding: 0 1.2rem; max-width: 72rem; color: var(--ink); background: #fff;
  font: 15px/1.45 "Helvetica Neue", Arial, "Liberation Sans", sans-serif; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; padding-bottom: .2rem; border-bottom: 2px solid var(--blue); }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
p { margin: .4rem 0; }
nav { margin: .8rem 0; }
nav a { margin-right: 1.1rem; color: var(--blue); text-decoration: none; }
.soft { color: var(--soft); }
.status { display: inline-block; padding: .1rem .6rem; border-radius: .2rem; color: #fff; background: #00785a; }
.status.bad { background: var(--bad); }
.box { border-left: 4px solid var(--bad); padding: .3rem .8rem; background: #fdf4ef; margin: .6rem 0; }
table { border-collapse: collapse; margin: .5rem 0; max-width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .18rem .9rem .18rem 0; border-bottom: 1px solid var(--line); }
th { font-weight: 600; border-bottom: 1.5px solid var(--soft); }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
td.n, td.s, nav a { white-space: nowrap; }
.wide td:first-child { min-width: 10rem; }
table.facts td { overflow-wrap: anywhere; }
table.facts td:first-child { color: var(--soft); white-space: nowrap; padding-right: 1.6rem; }
.wide { overflow-x: auto; font-size: .92rem; }
.wide th, .wide td { padding-right: .7rem; }
pre { font: 12.5px/1.4 "DejaVu Sans Mono", Menlo, Consolas, monospace; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; margin: .4rem 0; }
figure { margin: 1rem 0; }
figure img { max-width: 100%; height: auto; max-height: 46rem; }
figcaption { color: var(--soft); font-size: .87rem; }
@page { size: A4; margin: 15mm; }
@media print {
  body { margin: 0; padding: 0; max-width: none; font-size: 10pt; }
  nav { display: none; }
  h2, h3 { break-after: avoid; }
  figure, tr, .box { break-inside: avoid; }
  figure img { max-height: 180mm; }
  .wide { overflow: visible; }
  .wide table { font-size: 7.5pt; }
  .wide th, .wide td { padding-right: .35rem; white-space: normal; }
  pre { font-size: 8pt; }
}
"""
#: Longest text of a cell that is not broken.
SHORT = 24
PAGE = Template(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="$generator">
<title>$title</title>
<style>$style</style>
</head>
<body>
$body
</body>
</html>
"""
)


@dataclass(frozen=True)
class Number:
    """A number of a table of the run; the page says of which file, column and row, so that it can be checked.

    Attributes
    ----------
    source : ``<table>/<column>/<row>``, row from 0
    value : as it is in the table
    scale : factor with which it is shown (100 for a share in percent)
    digits : that are shown
    error : of it, shown behind it
    """

    source: str
    value: float
    scale: float = 1.0
    digits: int = 6
    error: Number | None = None

    def html(self) -> str:
        more = "" if self.scale == 1 else f' data-scale="{self.scale:g}"'
        more += "" if self.digits == 6 else f' data-digits="{self.digits}"'
        own = f'<span data-from="{escape(self.source)}"{more}>{shown(self.scale * self.value, self.digits)}</span>'
        return own if self.error is None or math.isnan(self.error.value) else f"{own} ± {self.error.html()}"


def shown(value: float, digits: int = 6) -> str:
    """A number as the page has it; a dash for none."""
    return "–" if math.isnan(value) else f"{value:.{digits}g}"


def text(value: object) -> str:
    """As HTML: escaped, a `Number` with where it is from."""
    return value.html() if isinstance(value, Number) else escape(str(value))


def tag(name: str, inside: str, kind: str = "") -> str:
    """An element; `inside` is HTML."""
    return f'<{name} class="{kind}">{inside}</{name}>' if kind else f"<{name}>{inside}</{name}>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table with a heading; columns of numbers to the right."""
    rows = [list(row) for row in rows]
    numeric = [bool(rows) and any(isinstance(row[k], Number) for row in rows) for k in range(len(head))]
    kinds = ["n" if one else "" for one in numeric]
    top = tag("tr", "".join(tag("th", escape(name), kind) for name, kind in zip(head, kinds)))
    body = [
        tag("tr", "".join(tag("td", text(one), kind or _short(one)) for one, kind in zip(row, kinds))) for row in rows
    ]
    return tag("div", tag("table", "\n".join([top, *body])), "wide")


def _short(value: object) -> str:
    """A few words stay in one line."""
    return "s" if len(str(value)) <= SHORT else ""


def facts(rows: Iterable[tuple[str, object]]) -> str:
    """What is said of one thing: name and value in each row; rows without a value are left out."""
    there = [(name, value) for name, value in rows if str(value) != ""]
    inside = [tag("tr", tag("td", escape(name)) + tag("td", text(value))) for name, value in there]
    return tag("table", "\n".join(inside), "facts") if inside else ""


def section(title: str, anchor: str, *parts: str) -> str:
    """A chapter of the page."""
    heading = f'<h2 id="{escape(anchor)}">{escape(title)}</h2>'
    return "\n".join([heading, *(part for part in parts if part)])


def titled(title: str, part: str) -> str:
    """A part under a heading of its own; nothing for an empty one."""
    return f"<h3>{escape(title)}</h3>\n{part}" if part else ""


def lines(found: Sequence[str]) -> str:
    """Lines as a terminal shows them."""
    return tag("pre", escape("\n".join(found))) if found else ""


def box(found: Sequence[str]) -> str:
    """What a reader must not miss."""
    return tag("div", "".join(tag("p", escape(line)) for line in found), "box") if found else ""


def picture(mime: str, content: bytes, caption: str) -> str:
    """An image inside the page."""
    data = base64.b64encode(content).decode("ascii")
    image = f'<img alt="{escape(caption)}" src="data:{mime};base64,{data}">'
    return tag("figure", image + tag("figcaption", escape(caption)))


def page(title: str, generator: str, parts: Sequence[str]) -> str:
    """The whole of it."""
    body = "\n".join(part for part in parts if part)
    return PAGE.substitute(title=escape(title), generator=escape(generator), style=STYLE, body=body)
