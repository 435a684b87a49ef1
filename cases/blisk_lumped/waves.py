"""A travelling wave of the lumped blisk over its amplitude, for several friction coefficients, on one sector.

    .venv/bin/python cases/blisk_lumped/waves.py --nodal-diameter 4 --out runs/blisk_lumped

Writes wave.csv, wave.png and wheel.png into --out. With mpirun, every rank count gives the same table.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np

import fretwave as fw
import model as case

#: Friction coefficients of the sweep, over a factor 25.
FRICTION = (0.06, 0.13, 0.3, 0.67, 1.5)
#: Time samples of a period: a multiple of the sectors, so that all see the slider's kinks between the same samples.
SAMPLES = 20 * case.SECTORS
#: Lines of curves that lie on each other.
LINES = ("-", "--", "-.", ":", (0, (4, 1, 1, 1, 1, 1)))
COLUMNS = (
    "friction",
    "amplitude",
    "omega",
    "omega0",
    "frequency_hz",
    "beta",
    "zeta",
    "stick",
    "slip",
    "force_outside",
)


def branch(model: fw.Model, options: case.Options, arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Points from stick to full slip; amplitudes are those of the disk [m]. `q` is the fundamental of all dofs."""
    stuck = fw.linear_modes(model, arguments.family)[-1]
    harmonics = fw.choose_harmonics(model, arguments.harmonics, SAMPLES)
    mode = fw.NonlinearMode(model, harmonics, arguments.method, case.DOFS.index("disk"), stuck)
    first = 0.1 * case.slip_threshold(options, stuck.omega, arguments.nodal_diameter)
    points = fw.Continuation(mode, mode.initial(first), (first, 500 * first), fw.StepControl(maximum=0.15))
    table = []
    for point in points:
        row = {"friction": options.friction, **mode.state(point.y), **mode.diagnostics(point.y)}
        Q = model.comm.bcast(mode.coefficients(point.y))
        table.append({**{key: row[key] for key in COLUMNS}, "q": Q[:, 0] - 1j * Q[:, 1]})
    if not points.converged:
        raise fw.NotConverged(f"the branch of mu = {options.friction} stopped early", measured=points.reason)
    return table


def summary(table: list[dict[str, Any]]) -> str:
    """Threshold, lowest frequency and largest damping of one branch."""
    peak = max(table, key=lambda row: row["zeta"])
    lowest = min(table, key=lambda row: row["frequency_hz"])
    onset = next(row for row in table if row["slip"] > 0)
    return (
        f"mu {peak['friction']:.2f}: slip from a = {onset['amplitude']:.3e} m; "
        f"lowest {lowest['frequency_hz']:.2f} Hz at {lowest['amplitude']:.3e} m; "
        f"largest zeta {100 * peak['zeta']:.4f} % at {peak['amplitude']:.3e} m; last {table[-1]['frequency_hz']:.2f} Hz"
    )


def draw(tables: list[list[dict[str, Any]]], stuck: fw.LinearMode, free_hz: float, path: Path) -> None:
    """Frequency and damping over amplitude, and over amplitude per friction coefficient where all curves are one."""
    from fretwave.plots import labels, marks, style

    with style.rules():
        figure, axes = style.new_figure(6.0, rows=2, columns=2, sharex="col", sharey="row")
        for table, colour, line in zip(tables, style.shades(len(tables)), LINES):
            amplitude, mu = np.array([row["amplitude"] for row in table]), table[0]["friction"]
            for (upper, lower), x, dash in zip(axes.T, (1e3 * amplitude, 1e3 * amplitude / mu), ("-", line)):
                look = {"color": colour, "linestyle": dash, "label": f"µ = {mu:g}"}
                for axis, name, factor in ((upper, "frequency_hz", 1.0), (lower, "zeta", 100.0)):
                    values = factor * np.array([row[name] for row in table])
                    axis.plot(x, values, **look)
                    marks.points(axis, x, values, colour, many=True)
        marks.point_entry(axes[0, 0], many=True)
        for upper, lower, text in zip(*axes, ("Amplitude of the disk", "Amplitude of the disk / µ")):
            for frequency, dash in ((stuck.frequency_hz, "--"), (free_hz, "-.")):
                upper.axhline(frequency, color=style.GREY, linewidth=1.0, linestyle=dash, zorder=1)
            lower.set_xscale("log")
            style.plain_numbers(lower.xaxis, np.concatenate([line.get_xdata() for line in lower.get_lines()]))
            lower.set_xlabel(style.label(text, "mm"))
        axes[0, 0].set_ylabel(style.label("Frequency", "Hz"))
        axes[1, 0].set_ylabel(style.label("Damping ratio ζ", "%"))
        style.legend_outside(figure, axes[0, 0], columns=6)
        labels.along(axes[0, 0], [("stuck", stuck.frequency_hz), ("free", free_hz)], fontsize=10)
        figure.savefig(path, dpi=style.DPI)


def draw_wheel(table: list[dict[str, Any]], nodal_diameter: int, path: Path) -> None:
    """Disk and ring around the wheel at one instant: stuck, at the largest damping, and sliding."""
    from fretwave.plots import style

    peak = int(np.argmax([row["zeta"] for row in table]))
    angle = 2 * np.pi * np.arange(case.SECTORS + 1) / case.SECTORS
    with style.rules():
        figure, axes = style.new_figure(4.4, columns=3, subplot_kw={"projection": "polar"})
        for axis, number, title in zip(axes, (0, peak, -1), ("Stuck", "Largest damping", "Sliding")):
            row = table[number]
            around = case.sector().wave(row["q"], nodal_diameter).real / row["amplitude"]
            for name, look, colour in (("disk", "-o", style.BLUE), ("ring", "--s", style.ORANGE)):
                motion = np.append(around[:, case.DOFS.index(name)], around[0, case.DOFS.index(name)])
                axis.plot(angle, 3 + motion, look, ms=3.0, lw=1.2, color=colour, label=name)
            axis.plot(np.linspace(0, 2 * np.pi, 200), np.full(200, 3.0), color=style.GREY, lw=0.8, label="at rest")
            axis.set(ylim=(0, 4.4), yticks=[], xticks=angle[:-1:6])
            axis.set_title(f"{title},\n{row['frequency_hz']:.2f} Hz", loc="center")
            axis.set_xticklabels([f"{j}" for j in range(0, case.SECTORS, 6)], fontsize=9)
            axis.tick_params(pad=1)
            axis.grid(False)
        style.legend_outside(figure, axes[0], title="Displacement around the wheel, by sector")
        figure.savefig(path, dpi=style.DPI)


def main() -> None:
    """Follow the branches, write the table, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodal-diameter", type=int, default=4, help="negative: backward wave")
    parser.add_argument("--family", type=int, default=3, help="which stuck mode of that nodal diameter, 1 the lowest")
    parser.add_argument("--method", choices=("CNM", "EPMC"), default="CNM")
    parser.add_argument("--harmonics", type=int, default=9)
    parser.add_argument("--out", type=Path, default=Path("runs/blisk_lumped"))
    arguments = parser.parse_args()
    tables = []
    for friction in FRICTION:
        options = case.Options(friction=friction)
        with case.sector(friction=friction).model(arguments.nodal_diameter) as model:
            tables.append(branch(model, options, arguments))
            stuck, free = (fw.linear_modes(model, 4, state) for state in ("stuck", "free"))
            first = model.comm.rank == 0
        if first:
            print(summary(tables[-1]), flush=True)
    elastic = [mode for mode in free if abs(mode.shape[3]) < 0.5 * max(abs(mode.shape))]  # without the ring's own wave
    if first:
        arguments.out.mkdir(parents=True, exist_ok=True)
        with (arguments.out / "wave.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(row for table in tables for row in table)
        number = arguments.family - 1
        draw(tables, stuck[number], elastic[number].frequency_hz, arguments.out / "wave.png")
        draw_wheel(tables[-1], arguments.nodal_diameter, arguments.out / "wheel.png")


if __name__ == "__main__":
    main()
