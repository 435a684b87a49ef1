"""Judge numbered examples one after the other: what ended badly is printed, outcomes are counted in a table."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path

from commands import BAD, Ended

#: Seconds after which an example is printed though it ended well.
SLOW = 20.0


def options(text: str, count: int) -> argparse.Namespace:
    """Which examples, and where their table goes; `text` is the script's docstring."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="+", help="these numbers, with all they print")
    parser.add_argument("--table", type=Path, help="Markdown to write")
    return parser.parse_args()


def campaign(
    told: argparse.Namespace, what: str, judge: Callable[[int], tuple[str, str, Ended]], bad: Collection[str] = BAD
) -> int:
    """Judge all examples; the exit code is 1 when any ended badly.

    Parameters
    ----------
    what : what is counted
    judge : of a number the row of the table, what was given, and how it ended
    bad : outcomes
    """
    counts: Counter[tuple[str, str]] = Counter()
    began = time.monotonic()
    for number in told.only or range(told.first, told.first + told.count):
        row, given, ended = judge(number)
        counts[row, ended.outcome] += 1
        if told.only or ended.bad or ended.seconds > SLOW:
            print(f"--- {number}: {given}: {ended.outcome}, {ended.seconds:.1f} s\n{ended.text[-3000:]}", flush=True)
        if told.table and sum(counts.values()) % 50 == 0:  # a run that is cut off keeps its table
            told.table.write_text(_table(counts, f"seed {told.seed}", what, began), encoding="utf-8")
    result = _table(counts, f"seed {told.seed}", what, began)
    print(result, end="")
    if told.table:
        told.table.write_text(result, encoding="utf-8")
    return int(any(outcome in bad for _, outcome in counts))


def _table(counts: Counter[tuple[str, str]], seed: str, what: str, began: float) -> str:
    """Outcomes by row, as Markdown."""
    outcomes = sorted({outcome for _, outcome in counts} | set(BAD))
    rows = [f"| | {' | '.join(outcomes)} | all |", "|---" * (len(outcomes) + 2) + "|"]
    for name in sorted({name for name, _ in counts}):
        found = [counts[name, outcome] for outcome in outcomes]
        rows.append(f"| {name} | {' | '.join(map(str, found))} | {sum(found)} |")
    head = f"{seed}, {sum(counts.values())} {what}, {time.monotonic() - began:.0f} s"
    return "\n".join([head, "", *rows, ""])
