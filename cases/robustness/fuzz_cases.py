"""Thousands of wrong case files: each must be refused in words, or run; none may end in a traceback, crash or hang.

    OMP_NUM_THREADS=1 .venv/bin/python cases/robustness/fuzz_cases.py --count 5000 --seed 1 --table FUZZED.md
    OMP_NUM_THREADS=1 .venv/bin/python cases/robustness/fuzz_cases.py --only 1234        # one again, with all it prints

Case `number` of a `seed` is always the same: one of the right cases of `bases.py`, mutated by `mutations.py`; every
tenth is run for a few points, the others are checked.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parent))
from bases import SHORT, prepare  # noqa: E402
from campaign import campaign, options  # noqa: E402
from commands import Ended, Worker  # noqa: E402
from mutations import as_toml, garbled, mutated  # noqa: E402

#: Processor time that a command may use [s].
LIMITS = {"check": 30.0, "run": 120.0}
#: The quickest ones more often.
BASES = ("two_dof", "two_dof", "blisk", "chain", "speed", "speed", "sector", "sector", "solid", "filed", "spinning")
#: Wrong ends of --set.
SETS = (
    *(
        "mode.harmonics",
        "=",
        "=3",
        "mode.harmonics=",
        "mode.harmonics=[",
        "mode.harmonics=3 4",
        "mode.\u00b2=1",
        "a.b.c.d=1",
    ),
    *(
        "model.M=[[",
        "model=3",
        "contact=[]",
        "analysis=[]",
        "analysis.0=3",
        "mode=3",
        "mode.step.minimum.x=1",
        "quick=1",
    ),
    *(
        "model.M.0.0=-1",
        "model.M.9.9=1",
        "model.M.\u00b2=1",
        "contact.damper=1",
        "title=1",
        "mode.dampers.0.c=1",
        "\x00=1",
    ),
    *(
        "mode.name=forced",
        "mode.harmonics=1e400",
        f"mode.harmonics={10**399}",
        "mode.harmonics=1\n2",
        "...=1",
        "mode..x=1",
    ),
)


@dataclass(frozen=True)
class Example:
    base: str
    action: str
    arguments: list[str]
    text: str


def example(seed: int, number: int) -> Example:
    """The case of a number, and what is done with it."""
    random = Random(f"{seed}/{number}")
    base = random.choice(BASES)
    case = SHORT[base]()
    text = as_toml(mutated(random, case))
    if random.random() < 0.1:
        text = garbled(random, as_toml(case))
    action = "run" if number % 10 == 0 else "check"
    arguments = []
    if random.random() < 0.1:
        arguments += ["--set", random.choice(SETS)]
    if random.random() < 0.1:
        arguments += ["--quick"]
    names = [analysis["name"] for analysis in case["analysis"]]
    if action == "run":
        chosen = random.choice(case["analysis"])
        needed = [chosen[key] for key in ("mode", "of") if isinstance(chosen.get(key), str)]
        arguments += ["--only", ",".join([*needed, chosen["name"]])]
    elif random.random() < 0.05:
        arguments += ["--only", random.choice((*names, "x", "", ",", "mode,mode"))]
    return Example(base, action, arguments, text)


def judge(worker: Worker, folder: Path, given: Example) -> Ended:
    """What becomes of an example, in a worker."""
    place = folder / given.base
    (place / "case.toml").write_text(given.text, encoding="utf-8")
    tail = ["--out", str(folder / "out")] + ([] if Random(given.text).random() < 0.2 else ["--no-plots"])
    arguments = [given.action, *given.arguments, *(tail if given.action == "run" else []), "case.toml"]
    return worker.run(arguments, place, LIMITS[given.action])


def main() -> int:
    """Judge all examples; the exit code is 1 when any ended badly."""
    told = options(__doc__, 5000)
    with tempfile.TemporaryDirectory() as name, Worker() as worker:
        prepare(Path(name))

        def one(number: int) -> tuple[str, str, Ended]:
            given = example(told.seed, number)
            text = f"{given.action} {given.arguments}" + (f"\n{given.text}" if told.only else "")
            return given.action, text, judge(worker, Path(name), given)

        return campaign(told, "cases", one)


if __name__ == "__main__":
    sys.exit(main())
