"""Frequency and damping against amplitude: the backbone (paper's figure 3), and under negative damping (figure 5)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from ..arrays import AnyArray
from ..post.mode_curve import NO_DAMPING, most_damped, varies, without_rounding
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from ..results.stamp import of_one_model
from ..solve.table import Table as Reading
from . import labels, marks, scales, style
from .scales import Scale

#: analyses belong in one picture when their stuck asymptotes agree to this relative difference
SAME_MODE = 1e-6
#: an asymptote is drawn up to this many heights of the axis below it
FAR = 1.0
#: half width of the close-up of the folds, in widths of the interval between them
CLOSE_UP = 2.5
#: Of a close-up, in shares of the axes: room for its numbers and its title, its other places, and how much smaller.
BESIDE, BELOW, ABOVE, LEFT, LOW, SMALLER = 0.07, 0.10, 0.09, 0.09, 0.16, 0.75
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)))
#: Lines of damping that was added afterwards: over the mode's own, and unlike each other.
SHIFTED = (("--", style.ORANGE), ((0, (1, 1.5)), style.RED))


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per linear mode with all methods in it, and one per analysis whose damping changes sign."""
    modes = run.of_kind("mode")
    flutter = [mode for mode in modes if _unstable(mode)]
    for group in _same_mode([mode for mode in modes if mode not in flutter]):
        yield f"{group[0].name}_backbone", draw(group)
    for mode in flutter:
        yield f"{mode.name}_backbone", draw([mode], _shifted(run, mode))


def draw(modes: Sequence[Analysis], shifted: Mapping[str, Table] | None = None) -> Figure:
    """Frequency above damping, over a common logarithmic amplitude axis."""
    figure, (upper, lower) = style.new_figure(6.6, rows=2, sharex=True)
    scale = scales.amplitudes(*modes)
    _curves(upper, modes, "frequency_hz", scale)
    _curves(lower, modes, "zeta", scale)
    named, above = _asymptotes(upper, modes[0])
    for (method, table), (line, colour) in zip((shifted or {}).items(), SHIFTED):
        look = {"linestyle": line, "color": colour, "linewidth": 2.0, "zorder": 3.2}
        name = f"{method} without dampers, damping added afterwards"
        lower.plot(scale(table["amplitude"]), 100.0 * table["zeta_shifted"], label=name, **look)
    if any(_unstable(mode) for mode in modes):
        _limit_cycles(upper, lower, modes[0], scale)
    for mode, colour in zip(modes, style.PALETTE):
        _peak(lower, mode, colour, scale)
        _stop(upper, lower, mode, scale, str(mode.name) if len(modes) > 1 else "")
    _finish(figure, upper, lower, modes, scale)
    _close_up(upper, modes, "frequency_hz", (0.60, 0.26, 0.34, _clear_of(upper, above) - 0.26), scale)
    _close_up(lower, modes, "zeta", (0.72, 0.44, 0.26, 0.50), scale)
    labels.along(upper, named, fontsize=10)
    return figure


def _curves(axes: Axes, modes: Sequence[Analysis], column: str, scale: Scale, errors: bool = True) -> None:
    """Every mode's curve with its points and error, and the folds of the first."""
    factor = 100.0 if column == "zeta" else 1.0
    for mode, colour, line in zip(modes, style.PALETTE, LINES):
        curve = mode.curve()
        x = scale(curve["amplitude"])
        axes.plot(x, factor * curve[column], color=colour, linestyle=line, label=_name(mode, scale))
        error = error_of(curve, column) if errors else None
        if error is not None:
            style.error_band(axes, x, factor * curve[column], factor * error, colour)
    for mode, colour in zip(modes, style.PALETTE):
        marks.points(axes, scale(mode.columns["amplitude"]), factor * mode.columns[column], colour)
    points = modes[0].met("fold")
    if points:
        amplitude, values = scale(modes[0].columns["amplitude"][points]), factor * modes[0].columns[column][points]
        axes.plot(amplitude, values, "D", color=style.INK, markersize=4.5, label="fold in amplitude", zorder=5)


def _stop(upper: Axes, lower: Axes, mode: Analysis, scale: Scale, name: str) -> None:
    """Where a branch stopped short, and why."""
    last = {column: float(values[-1]) for column, values in mode.columns.items()}
    reason = marks.why_stopped(mode).get("")
    for axes, value in ((upper, last["frequency_hz"]), (lower, 100.0 * last["zeta"])):
        marks.stops(axes, {name: (scale(last["amplitude"]), value)}, {} if reason is None else {name: reason})


def error_of(table: Reading | Table, column: str) -> AnyArray | None:
    """The estimated error of frequency or damping in their own unit; results of before have none."""
    if column == "zeta":
        return table["zeta_error"] if "zeta_error" in table else None
    return table["omega_error"] / (2 * np.pi) if "omega_error" in table else None


def error_entry(axes: Axes, tables: Sequence[Reading | Table]) -> None:
    """What the legend says of the errors of frequency and damping."""
    of_zeta = [error_of(table, "zeta") for table in tables]
    percent = [None if error is None else 100.0 * error for error in of_zeta]
    marks.error_entry(axes, {"Hz": [error_of(table, "frequency_hz") for table in tables], "%": percent})


def _close_up(axes: Axes, modes: Sequence[Analysis], column: str, place: tuple[float, ...], scale: Scale) -> None:
    """Inset around the folds, which are too narrow to be seen on the whole axis."""
    folds = modes[0].columns["amplitude"][modes[0].met("fold")]
    if len(folds) < 2:
        return
    low, high = scale(folds.min()), scale(folds.max())
    width = CLOSE_UP * (high - low)
    inset = axes.inset_axes(_where_free(axes, place))
    _curves(inset, modes, column, scale, errors=False)  # upright bands lie over each other where a curve folds
    curve = modes[0].curve()
    near = (scale(curve["amplitude"]) > low - width) & (scale(curve["amplitude"]) < high + width)
    values = curve[column][near] * (100.0 if column == "zeta" else 1.0)
    inset.set_xlim(low - width, high + width)
    inset.set_ylim(values.min() - 0.1 * np.ptp(values), values.max() + 0.15 * np.ptp(values))
    inset.tick_params(labelsize=8.5)
    inset.locator_params("x", nbins=2)  # amplitudes that differ little have long numbers
    inset.locator_params("y", nbins=4)
    inset.set_title("around the folds", fontsize=9.5)


def _where_free(axes: Axes, place: tuple[float, ...]) -> tuple[float, ...]:
    """Place of a close-up as preferred, or another below its top that covers fewer points and less of the lines."""
    x, y, width, height = place
    sizes = [(height, y), (SMALLER * height, y + (1 - SMALLER) * height)]
    lefts = (x, 0.5 - width / 2, LEFT)
    places = [(left, low, width, tall) for tall, high in sizes for left in lefts for low in (high, LOW)]
    boxes = [Bbox.from_bounds(*one) for one in places]
    around = [Bbox.from_extents(box.x0 - BESIDE, box.y0 - BELOW, box.x1, box.y1 + ABOVE) for box in boxes]
    return places[labels.Cover(axes).cheapest([box.transformed(axes.transAxes) for box in around])]


def _clear_of(axes: Axes, above: Sequence[float]) -> float:
    """Height, as a share of the axis, up to which a close-up is clear of the lines above the curve and their names."""
    low, high = axes.get_ylim()
    shares = [(frequency - low) / (high - low) for frequency in above]
    return float(min([0.80, *(share - 0.18 for share in shares if share > 0.66)]))


def _asymptotes(axes: Axes, mode: Analysis) -> tuple[list[tuple[str, float]], list[float]]:
    """Linear frequencies with the contact stuck (dashed), and free or sliding (dash-dotted).

    Returns
    -------
    Name and frequency of each line, and the frequencies of those above the curve.
    """
    kinds = (("stuck", "stuck", "--"), ("free", "free", "-."), ("sliding", "closed and sliding", "-."))
    known = {key: omega / (2.0 * np.pi) for key, *_ in kinds if (omega := mode.asymptote(key)) is not None}
    text = style.apart(list(known.values()))
    drawn: dict[str, float] = {}
    for key, name, line in kinds:
        if key not in known:
            continue
        frequency = known[key]
        low, high = axes.get_ylim()
        if frequency < low - FAR * (high - low):
            _below(axes, f"{name} {text(frequency)} Hz")
            continue
        axes.axhline(frequency, color=style.GREY, linestyle=line, linewidth=1.2, zorder=1)
        drawn[f"{name} {text(frequency)} Hz"] = frequency
    middle = np.mean(mode.columns["frequency_hz"])
    return list(drawn.items()), [frequency for frequency in drawn.values() if frequency >= middle]


def _below(axes: Axes, text: str) -> None:
    """A value too far below the axis for a line."""
    box = {"xycoords": "axes fraction", "textcoords": "offset points", "color": style.GREY, "fontsize": 10}
    arrow = {"arrowstyle": "->", "color": style.GREY}
    axes.annotate("", (0.025, 0.02), (0, 32), arrowprops=arrow, **box)
    axes.annotate(f"to {text}", (0.04, 0.06), (0, 0), **box)


def _peak(axes: Axes, mode: Analysis, colour: str, scale: Scale) -> None:
    point = peak_point(mode)
    if not is_peak(mode, point):
        return
    peak = [scale(mode.columns["amplitude"][point])], [100.0 * mode.columns["zeta"][point]]
    axes.plot(*peak, **{**style.PEAK, "color": colour})


def peak_point(mode: Analysis) -> int:
    """Point of largest damping: the located one when there is one."""
    zeta = mode.columns["zeta"]
    points = np.array(mode.met("peak_damping") or range(len(zeta)))
    return int(points[most_damped(zeta[points])])


def is_peak(mode: Analysis, point: int) -> bool:
    """Not where the branch ends with damping still growing, or where damping does not change."""
    return varies(mode.columns) and 0 < point < len(mode) - 1


def _name(mode: Analysis, scale: Scale) -> str:
    """Method, harmonics and the peak's numbers."""
    point = peak_point(mode)
    zeta, amplitude = mode.columns["zeta"][point], mode.columns["amplitude"][point]
    zeta = 100.0 * without_rounding(zeta)
    name = f"{mode.method()}, {_harmonics(mode)}:"
    if not varies(mode.columns):
        return f"{name} ζ {zeta:.3g} % throughout"
    return f"{name} {'peak' if is_peak(mode, point) else 'up to'} ζ {zeta:.3g} % at {scale.text(amplitude)}"


def _limit_cycles(upper: Axes, lower: Axes, mode: Analysis, scale: Scale) -> None:
    """Zeros of the damping: green where damping grows with amplitude (stable in it), open where it falls."""
    lower.axhline(0.0, color=style.INK, linewidth=1.0, zorder=2)
    low, high = lower.get_ylim()
    lower.axhspan(low, 0.0, color=style.RED, alpha=0.07, zorder=0)
    lower.set_ylim(low, high)
    for crossing in mode.mode_curve().crossings():
        kind, face, _ = marks.CYCLES[crossing.stable]
        look = {"marker": "o", "markersize": 8, "markerfacecolor": face, "markeredgecolor": style.INK, "zorder": 6}
        a = scale(crossing.amplitude)
        upper.plot([a], [crossing.omega / (2.0 * np.pi)], linestyle="", label=kind, **look)
        lower.plot([a], [0.0], linestyle="", label=kind, **look)
        # beside a falling curve there is room above the zero line, beside a rising one below it
        place = (9, -14) if crossing.stable else (9, 7)
        text = f"a = {scale.text(crossing.amplitude)}"
        lower.annotate(text, (a, 0.0), place, textcoords="offset points", fontsize=10)


def _finish(figure: Figure, upper: Axes, lower: Axes, modes: Sequence[Analysis], scale: Scale) -> None:
    mode = modes[0]
    amplitude = np.concatenate([m.columns["amplitude"] for m in modes])
    dof = mode.observed()
    style.log_amplitude(lower, scale(amplitude))
    upper.set_ylabel(style.label("Frequency ω/2π", "Hz"))
    lower.set_ylabel(style.label("Damping ratio ζ", "%"))
    lower.set_xlabel(scale.label(f"Modal amplitude of {dof}".rstrip(" of")))
    marks.point_entry(lower)
    error_entry(lower, [m.columns for m in modes])
    style.legend_outside(figure, lower, columns=2)


def _harmonics(mode: Analysis) -> str:
    orders = [int(label.rstrip("cs")) for label in mode.labels]
    return f"H = {max(orders)}" if orders else ""


def _shifted(run: Run, mode: Analysis) -> dict[str, Table]:
    """Modes with the linear damping added afterwards, by method, as kept by the analysis of the limit cycles."""
    tables = {}
    for motions, of in run.compared("limit_cycle"):
        for twin in run.of_kind("mode") if of is mode else ():
            if not of_one_model(motions, twin):
                continue
            table = run.table(f"{motions.name}_shifted_{twin.name}")
            if table is not None:
                tables[twin.method()] = table
    return tables


def _unstable(mode: Analysis) -> bool:
    return bool((mode.columns["zeta"] < -NO_DAMPING).any())


def _same_mode(modes: Sequence[Analysis]) -> list[list[Analysis]]:
    groups: list[list[Analysis]] = []
    for mode in modes:
        match = [group for group in groups if _alike(group[0], mode)]
        if match:
            match[0].append(mode)
        else:
            groups.append([mode])
    return groups


def _alike(one: Analysis, other: Analysis) -> bool:
    """The same linear mode of the same model over the same amplitude, of a wheel in any sector."""
    over = [mode.observed().partition("@")[0] for mode in (one, other)]
    same = over[0] == over[1] and _close(one.asymptote("stuck"), other.asymptote("stuck"))
    return same and of_one_model(one, other)


def _close(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= SAME_MODE * abs(one)
