"""Wrong and suspicious inputs of an engineer's first morning: each with what the command line says of it.

    .venv/bin/python cases/robustness/suspects.py [--table SUSPECTS.md]

The files are those of the cases lap_joint and shrouded_sector, which CalculiX wrote (`cases/run NAME` makes them).
Wrong ones are refused with exit code 2 and nothing is written; suspicious ones are warned of by `fretwave check`. Exit
code 1 if one is not found, or has no fix.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

CASES = Path(__file__).resolve().parents[1]
JOINT, SECTOR = (CASES / "lap_joint" / "model", CASES / "shrouded_sector" / "model")
LAP_JOINT = CASES / "lap_joint" / "case.toml"
LUMPED = CASES / "blisk_lumped" / "case.toml"
MATRICES = ["--mass", f"{JOINT}/joint.mas", "--stiffness", f"{JOINT}/joint.sti"]
OTHERS = ["--mass", f"{SECTOR}/sector.mas", "--stiffness", f"{JOINT}/joint.sti"]
DECK = ["--coordinates", f"{JOINT}/joint.inp"]
UNITS, AXIS = ["--units", "mm-t-s"], ["--axis", "z"]
FACES = ["--low", "LOW", "--high", "HIGH"]
WHEEL = ["--units", "mm-t-s", "--axis", "z", "--sectors", "24"]


#: A pad that its contact alone holds, and that its load pushes off.
FREE = """
[model]
dofs = ["x", "y"]
M = [[1.0, 0.0], [0.0, 1.0]]
K = [[3.0, 0.0], [0.0, 0.0]]

[[contact]]
name = "pad"
law = "coulomb_2d"
pairs = ["y"]
tangents = ["x"]
tangential_stiffness = 3.0
normal_stiffness = 2.0
friction_coefficient = 0.5
normal_load = 2.0

[preload]
balanced = false

[[analysis]]
name = "mode"
type = "mode"
harmonics = 1
normalise = "x"
amplitude = [0.1, 3.0]
"""


@dataclass(frozen=True)
class Input:
    """A command, the exit code it should have, and words of what it should say."""

    what: str
    command: list[str]
    says: str
    code: int = 2
    files: dict[str, str] = field(default_factory=dict)


def imported(*words: str) -> list[str]:
    return ["import", "OUT.h5", *words]


def checked(case: Path, *overrides: str) -> list[str]:
    """Of one analysis: what is said of a model is said once."""
    return ["check", str(case), *(word for text in overrides for word in ("--set", text))]


def sector(*words: str) -> list[str]:
    return ["import", "sector.inp", *words]


def moved_deck() -> str:
    """The joint's, its second plate 1 m away."""
    text = (JOINT / "joint.inp").read_text(encoding="utf-8")
    second = set(numbers(text, "*NSET, NSET=B"))
    lines, nodes = [], False
    for line in text.splitlines():
        if line.startswith("*"):
            nodes = line.startswith("*NODE")
        elif nodes and int(line.split(",")[0]) in second:
            number, x, y, z = line.split(",")
            line = f"{number}, {x}, {y}, {float(z) + 1000.0}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def numbers(text: str, card: str) -> list[int]:
    """Of the lines below a card."""
    after = text.split(card + "\n", 1)[1].split("*", 1)[0]
    return [int(word) for word in after.replace("\n", ",").split(",") if word.strip()]


def inputs() -> list[Input]:
    joint = [*MATRICES, *DECK, *UNITS]
    mode = "[0.1, 4.0]"
    return [
        Input("millimetres declared as metres", imported(*MATRICES, *DECK, "--units", "m-kg-s"), "units"),
        Input("25 sectors for 24", sector(*WHEEL[:-1], "25", *FACES), "give 24 sectors"),
        Input("low and high face exchanged", sector(*WHEEL, "--low", "HIGH", "--high", "LOW"), "swap low and high"),
        Input("another axis", sector(*WHEEL[:3], "x", *WHEEL[4:], *FACES), "give the axis z"),
        Input(
            "a normal that points into its body",
            imported(*joint, "--pairs", "joint=A", "B", "--normal=0,0,-1"),
            "points into the first body",
        ),
        Input(
            "a normal along the face",
            imported(*joint, "--pairs", "joint=A", "B", "--normal=1,0,0"),
            "lies along the face",
        ),
        Input(
            "contact sets exchanged",
            imported(*joint, "--pairs", "joint=B", "A", "--normal=0,0,1"),
            "in the other order",
        ),
        Input(
            "mass and stiffness exchanged",
            imported("--mass", MATRICES[3], "--stiffness", MATRICES[1], *DECK, *UNITS),
            "seem exchanged",
        ),
        Input("mass and stiffness of two models", imported(*OTHERS, *DECK, *UNITS), "are of two models"),
        Input(
            "pairs 1000 mm apart",
            imported(*MATRICES, "--coordinates", "moved.inp", *UNITS, "--pairs", "joint=A", "B"),
            "far apart",
            files={"moved.inp": moved_deck()},
        ),
        Input(
            "a normal stiffness of 1e10 N/mm",
            checked(LAP_JOINT, "contact.joint.normal_stiffness=1e10", f"mode.amplitude={mode}"),
            "far stiffer",
            code=0,
        ),
        Input(
            "an amplitude of the model's size", checked(LAP_JOINT, "mode.amplitude=[0.1, 400.0]"), "own size", code=0
        ),
        Input(
            "a coefficient of friction of 30",
            checked(LAP_JOINT, "contact.joint.friction_coefficient=30.0"),
            "coefficient of friction",
            code=0,
        ),
        Input(
            "centrifugal loads at speed 0",
            [*checked(LUMPED, "model.options.speed_rpm=0.0"), "--no-solve"],
            "give a speed above 0",
            code=0,
        ),
        Input(
            "amplitudes that never slip",
            checked(LAP_JOINT, "mode.amplitude=[1e-3, 1e-2]", "mode.report_at=[]"),
            "is expected to make a pair slip",
            code=0,
        ),
        Input("a body that nothing holds", ["check", "case.toml"], "dof y most", code=3, files={"case.toml": FREE}),
    ]


def said_of(case: Input, folder: Path) -> tuple[int, str, bool]:
    """Exit code, what was printed, whether a model was written."""
    for name, text in case.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    for path in SECTOR.glob("sector.*"):
        if path.suffix in (".inp", ".mas", ".sti", ".dof"):
            shutil.copy(path, folder)
    done = subprocess.run(
        [sys.executable, "-m", "fretwave", *case.command], cwd=folder, capture_output=True, text=True, timeout=300
    )
    text = (done.stdout + done.stderr).replace(f"{CASES}/", "cases/")
    return done.returncode, text, any(folder.glob("*.h5"))


def message(text: str) -> list[str]:
    """The lines of the error, or of the warnings."""
    lines = text.splitlines()
    start = next((k for k, line in enumerate(lines) if line.startswith(("error:", "warning:"))), len(lines))
    end = next((k for k in range(start + 1, len(lines)) if not lines[k].startswith("  ")), len(lines))
    return lines[start:end]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--table", type=Path, help="Markdown to write")
    arguments = parser.parse_args()
    rows, wrong = ["# Wrong and suspicious inputs", "", "Made by `cases/robustness/suspects.py`.", ""], 0
    for case in inputs():
        with tempfile.TemporaryDirectory() as folder:
            code, text, written = said_of(case, Path(folder))
        found = message(text)
        good = (
            code == case.code
            and case.says in "\n".join(found)
            and any(("fix:" in line or "try:" in line) for line in found)
        )
        good = good and not (written and code)
        wrong += not good
        print(f"{'ok' if good else 'NOT FOUND':10s} {case.what} (exit {code})")
        if not good:
            print(text)
        rows += [f"**{case.what}**, exit {code}", "", "```text", *(line.rstrip() for line in found), "```", ""]
    if arguments.table:
        arguments.table.write_text("\n".join(rows), encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
