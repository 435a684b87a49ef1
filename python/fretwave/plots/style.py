"""Look of all pictures: readable at the width of a README, colour-blind-safe, units in every label."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Union

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ..arrays import AnyArray
from ..columns import PURE
from ..files.whole import replaced

Colour = Union[str, tuple[float, ...]]
#: Okabe and Ito's palette: distinguishable under every common colour-vision deficiency
BLUE, ORANGE, GREEN, RED, SKY, PURPLE = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7"
PALETTE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY)
GREY = "#666666"
INK = "#222222"

#: Marker of a largest damping.
PEAK: dict[str, Any] = {
    "marker": "*",
    "linestyle": "",
    "color": ORANGE,
    "markeredgecolor": INK,
    "markersize": 12,
    "zorder": 6,
}

#: Formats of pictures, and what they are not to say: when they were drawn.
FORMATS: dict[str, dict[str, None]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
#: Where they say what has drawn them, and as what that stands in the file.
MAKER = {"png": ("Software", "Software\0{}"), "svg": ("Creator", "<dc:title>{}<"), "pdf": ("Creator", "/Creator ({})")}
PLOT, VIEW = "fretwave plot", "fretwave view"
WIDTH = 8.0  # [inch]; with DPI 130 about 1040 pixels, a README shows 800 to 900
DPI = 130

RULES: dict[str, Any] = {
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.labelsize": 11.0,
    "legend.fontsize": 9.5,
    "xtick.labelsize": 10.0,
    "ytick.labelsize": 10.0,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.8,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "axes.formatter.useoffset": False,
    "svg.hashsalt": "fretwave",
    "pdf.fonttype": 42,
}


def rules() -> AbstractContextManager[None]:
    """Matplotlib settings of all pictures, for a `with` block."""
    context: AbstractContextManager[None] = matplotlib.rc_context(RULES)
    return context


def new_figure(height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure of README width and its axes, as from `subplots`; no window and no global state."""
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **options)


def save(figure: Figure, path: Path, maker: str = PLOT) -> Path:
    """Write it in the format of the file's ending, one of `FORMATS`; the same figure gives the same file."""
    ending = path.suffix[1:]
    with replaced(path, own=True, keep_suffix=True) as fresh:
        figure.savefig(fresh, dpi=DPI, metadata={**FORMATS[ending], MAKER[ending][0]: maker})
    return path


def is_from(path: Path, maker: str = PLOT) -> bool:
    """A picture that it has written, of whatever results."""
    if path.suffix[1:] not in MAKER or not path.is_file():
        return False
    return MAKER[path.suffix[1:]][1].format(maker).encode() in path.read_bytes()


def label(text: str, unit: str = "") -> str:
    """Axis label with its unit: "Amplitude of m1 [length]"; no bracket for a pure number."""
    return f"{text} [{symbol(unit)}]" if unit not in PURE else text


def symbol(unit: str) -> str:
    """A unit with raised powers: "mm³"."""
    return unit.replace("^2", "²").replace("^3", "³")


def shades(count: int) -> list[Any]:
    """Colours of an ordered family (amplitudes, levels): dark to light, equal steps in lightness."""
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, max(count, 1)))
    return [tuple(colour) for colour in colours]


def with_unit(text: str, unit: str) -> str:
    """A number and its unit: "3 mm"; no unit for a pure number."""
    return f"{text} {symbol(unit)}" if unit not in PURE else text


def number(value: float, digits: int = 3) -> str:
    """Short plain number: 0.134, 25.3, 4200, 1.2e-05."""
    text = f"{value:.{digits}g}"
    return f"{float(text):g}" if 1.0 <= abs(value) < 1e5 else text


def apart(values: Sequence[float]) -> Callable[[float], str]:
    """Writes numbers with four digits, or as many more as tell these values apart."""
    enough = (d for d in range(4, 12) if len({number(value, d) for value in values}) == len(set(values)))
    digits = next(enough, 12)
    return lambda value: number(value, digits)


#: An axis over more than this factor has no room for numbers between its decades.
MANY_DECADES = 1e4
#: values that differ by more than this factor stand on a logarithmic axis
LINEAR_UP_TO = 8.0


def log_amplitude(axes: Axes, values: AnyArray | Sequence[float]) -> None:
    """Logarithmic amplitude axis with plain numbers at 1, 2, 5 of each decade, fitted to the values."""
    low, high = float(np.min(values)), float(np.max(values))
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    plain_numbers(axes.xaxis)


def fit_values(axes: Axes, x: AnyArray, y: AnyArray, shown: Sequence[float], others: AnyArray) -> None:
    """Fit the value axis to what of a curve lies between two abscissas, and to all other values."""
    inside = np.concatenate([y[(x >= shown[0]) & (x <= shown[1])], others])
    inside = inside[np.isfinite(inside)]
    room = 0.08 * float(np.ptp(inside)) if len(inside) else 0.0
    if room > 1e-6 * float(np.abs(inside).max(initial=0.0)):
        axes.set_ylim(inside.min() - room, inside.max() + room)


#: of the values' range, beyond which a band of errors is not drawn: the axis is the curve's
BEYOND = 0.3


def error_band(axes: Axes, x: AnyArray, y: AnyArray, error: AnyArray, colour: Colour) -> None:
    """The estimated error about a curve; nothing where it is not known."""
    known = np.isfinite(error)
    if not known.any():
        return
    room = BEYOND * float(np.ptp(y))
    around = [np.clip(y + sign * np.where(known, error, 0.0), y.min() - room, y.max() + room) for sign in (-1, 1)]
    axes.fill_between(x, *around, where=known.tolist(), color=colour, alpha=0.22, lw=0, zorder=1)


def plain_numbers(axis: Axis, values: AnyArray | Sequence[float] = (1.0, 10.0)) -> None:
    """Ticks of a logarithmic axis at 1, 2, 5 of each decade (closer within one, at 1 of many), as 0.05 and no power."""
    ratio = np.max(values) / np.min(values)
    subs = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0) if ratio < 8.0 else (1.0, 2.0, 5.0) if ratio < MANY_DECADES else (1.0,)
    axis.set_major_locator(LogLocator(base=10.0, subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def legend(axes: Axes, loc: str, ncols: int = 1) -> None:
    """A legend inside the axes, every name once."""
    entries = _entries(axes)
    if entries:
        axes.legend(list(entries.values()), list(entries), loc=loc, ncols=ncols)


def _entries(axes: Axes) -> dict[str, Any]:
    """First handle of each name, in order."""
    handles, names = axes.get_legend_handles_labels()
    first = dict(zip(reversed(names), reversed(handles)))
    return {name: first[name] for name in names}


def legend_outside(figure: Figure, axes: Axes, columns: int = 4, title: str | None = None) -> None:
    """One legend above the axes, where it cannot cover a curve; every name once, in at most so many columns."""
    entries = _entries(axes)
    for number in range(columns, 0, -1):
        look = {"loc": "upper center", "ncols": number, "title": title}
        names = [name for k in range(number) for name in list(entries)[k::number]]  # filled by column, read by row
        drawn = figure.legend([entries[name] for name in names], names, **look)
        size = drawn.get_window_extent(figure.canvas.get_renderer())
        if size.width <= figure.bbox.width or number == 1:
            break
        drawn.remove()
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 0.99 - size.height / figure.bbox.height))
