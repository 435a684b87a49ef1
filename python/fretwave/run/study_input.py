"""What a study is asked for: the sweeps of the command line, of the case or by default, refused where none can be."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from ..case.load import Case
from ..errors import InputError
from .study_plan import Plan

#: Settings that a study of a mode or of a response sweeps, and what else it alone is asked for.
OF_BRANCHES = ("harmonics", "samples", "tolerance", "component_modes", "accuracy")
#: The same of wear.
OF_WEAR = ("harmonics", "tolerance", "pressure_change")
#: What the command line says of one kind of study alone.
_ALONE = {"wear": ("pressure_change",), "a mode or a forced response": ("samples", "component_modes", "accuracy")}


def check_options(options: argparse.Namespace, worn: bool) -> None:
    """Refuse sweeps that a study of this kind has not: they would be left out without a word.

    Raises
    ------
    InputError
        One of them is asked for.
    """
    kind = "a mode or a forced response" if worn else "wear"
    given = [name for name in _ALONE[kind] if getattr(options, name)]
    if given:
        flag, swept = _flag(given[0]), OF_WEAR if worn else OF_BRANCHES
        raise InputError(
            f"this is a sweep of {kind}",
            flag,
            f"a study of {'wear' if worn else 'a mode or a forced response'}",
            ", ".join(map(_flag, swept)),
            "leave it out, or choose another --analysis",
        )


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def plan_of(case: Case, options: argparse.Namespace) -> Plan:
    """Sweeps of the command line, else of the case's table [study], else the defaults.

    Raises
    ------
    InputError
        The finest settings of all cannot be run, a number of samples is odd, or there are no component modes to sweep.
    """
    plan = Plan()
    for name in OF_BRANCHES:
        values = getattr(options, name) or getattr(case.study, name)
        plan = replace(plan, **{name: tuple(dict.fromkeys(values))}) if values else plan
    if plan.component_modes and case.reduction is None:
        raise InputError(
            "the case is not reduced: there are no component modes to sweep",
            "study.component_modes",
            expected="a table [reduction]",
            fix="add [reduction], or leave component_modes out",
        )
    _check_samples(plan.samples, max(plan.harmonics))
    return plan


def _check_samples(samples: Sequence[int], highest: int) -> None:
    """All are even, and the most are enough for the highest harmonic."""
    odd = [count for count in samples if count % 2]
    if odd:
        what, fix = "a number of samples is odd", f"write {odd[0] + 1} in its place"
        raise InputError(what, "study.samples", odd[0], "even numbers", fix)
    if max(samples) <= 2 * highest:
        least = 2 * highest + 2
        raise InputError(
            "the finest run of the study has fewer than two samples per period of its highest harmonic",
            "study.samples",
            f"H = {highest}, N_t = {max(samples)}",
            f"N_t >= {least}",
            f"--samples {1 << (4 * highest - 1).bit_length()}, or leave H = {highest} out",
        )
