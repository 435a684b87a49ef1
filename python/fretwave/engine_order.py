"""Excitation by engine orders: which wave a distortion of the flow drives.

A distortion that stands still with r maxima around the wheel, cos(r phi), is met by sector j at
phi = j alpha - Omega t, alpha = 2 pi / N, where the rotor turns against the sectors' numbers. The force on sector j is
then cos(r Omega t - r j alpha): of frequency r Omega and, in the convention of `fretwave.cyclic`, of spatial index r.
It cannot be told from that of r - N, r - 2 N, ... nodal diameters: r up to N/2 drives the forward wave of r nodal
diameters, r from N/2 to N the backward wave of N - r, and so on. Where the rotor turns with the numbers,
phi = j alpha + Omega t, all waves are mirrored: the engine order is given as negative.
"""

from __future__ import annotations

import math

from .reporter import Found, Reporter
from .schema import AnalysisSection, ForcedAnalysis
from .source import Source


def folded(index: int, sectors: int) -> int:
    """Nodal diameters -N/2 < ND <= N/2 of the wave with this spatial index, negative for a backward wave."""
    index %= sectors
    return index - sectors if 2 * index > sectors else index


def speed_rpm(omega: float, order: int) -> float:
    """Speed [rev/min] at which the engine order excites the angular frequency [rad/s]."""
    return 30 * omega / (math.pi * abs(order))


def fold_engine_orders(source: Source, analyses: dict[int, AnalysisSection], sectors: int | None, found: Found) -> None:
    """Give every analysis with an engine order its nodal diameter."""
    for number, analysis in analyses.items():
        if not isinstance(analysis, ForcedAnalysis):
            continue
        report = Reporter(source, ("analysis", number), found)
        order, given = analysis.engine_order, analysis.nodal_diameter
        if order is None:
            _check_wave(report, analysis, sectors)
        elif sectors is None:
            report.wrong(("engine_order",), "is of no sector of a wheel", "a model with sectors", "remove the key")
        elif order == 0:
            report.wrong(("engine_order",), "is steady", "1 or more, or -1 or less", "take a mean load to [preload]")
        elif given is not None and given % sectors != order % sectors:
            expected = f"{folded(order, sectors)}, which engine order {order} drives on {sectors} sectors"
            report.wrong(("nodal_diameter",), "is not that of the engine order", expected, "remove nodal_diameter")
        else:
            analyses[number] = analysis.model_copy(update={"nodal_diameter": folded(order, sectors)})


def _check_wave(report: Reporter, analysis: ForcedAnalysis, sectors: int | None) -> None:
    """A mistuned wheel has no wave of its own, but its excitation has."""
    if sectors is not None and analysis.mistuning is not None and analysis.nodal_diameter is None:
        fix = "add for example `engine_order = 4`"
        report.wrong(("engine_order",), "is missing", "the order of the excitation, or nodal_diameter", fix)
