#!/usr/bin/env python3
"""Error of omega and zeta against time, and error estimates against errors, of every case: makes cases/ACCURACY.md.

    OMP_NUM_THREADS=1 .venv/bin/python cases/accuracy/page.py [NAME ...] [--out FOLDER]

from the top folder runs `fretwave study` on every scene below (or on those named) into FOLDER (runs/accuracy), one
process each; what is there already is taken as it is. The page and its pictures are written from all of them.
"""

from __future__ import annotations

import argparse
import json
import platform
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
TOP = HERE.parents[1]
PAGE, PICTURES = HERE.parent / "ACCURACY.md", HERE / "pictures"


@dataclass(frozen=True)
class Scene:
    """A study: case, analysis, and what it sweeps."""

    title: str
    case: str
    analysis: str
    options: tuple[str, ...] = ()
    says: str = ""
    places: int = 96

    @property
    def words(self) -> list[str]:
        """What follows the case."""
        return ["--analysis", self.analysis, *self.options, "--places", str(self.places)]


FEW = ("--tolerance", "1e-10", "--repeats", "1")
SMALL = (
    "--harmonics",
    "1,3,7,15,31,61,121,251,501",
    "--samples",
    "128,2048",
    "--tolerance",
    "1e-4,1e-10",
    "--repeats",
    "1",
)
ASKED = ("--accuracy", "1e-1,1e-2,1e-3,1e-4")
RING = ("--quick", "--set", "mode.amplitude=[1e-5,2e-4]", "--set", "mode.report_at=[]", "--samples", "128", *FEW)
SCENES = {
    "two_dof": Scene("Two-dof oscillator, complex mode, tanh friction", "two_dof", "mode", (*SMALL, *ASKED)),
    "two_dof_epmc": Scene("The same, EPMC", "two_dof", "mode_epmc", (*SMALL, *ASKED)),
    "two_dof_forced": Scene(
        "The same, response to a force of 8.8 N",
        "two_dof",
        "forced",
        ("--harmonics", "1,3,7,15,31,61,181", "--samples", "128,512", "--tolerance", "1e-10", *ASKED),
        "The largest level, whose resonance slips at all times; half of the frequencies stick, with no error to tell.",
    ),
    "blisk_lumped": Scene(
        "Lumped blisk, a wave of 4 nodal diameters, Jenkins sliders",
        "blisk_lumped",
        "mode",
        ("--harmonics", "3,7,15,31,61", "--samples", "128,2048", "--tolerance", "1e-10", *ASKED),
        "The changes of these sliders are found in continuous time: no number of samples changes a digit.",
    ),
    "blade_root": Scene(
        "Blade in a dovetail, reduced, three-dimensional friction (short form of the mesh)",
        "blade_root_retained",
        "mode",
        ("--quick", "--harmonics", "3,5,9,21", "--samples", "128", "--component-modes", "20", *FEW)
        + ("--accuracy", "1e-1"),
    ),
    "blade_root_modes": Scene(
        "The same with fewer component modes",
        "blade_root_retained",
        "mode",
        ("--quick", "--harmonics", "3", "--samples", "128", "--component-modes", "2,5,10,20,40", *FEW),
    ),
    "blisk_ring": Scene(
        "Blisk with a friction ring, a travelling wave on the sector (short form of the mesh)",
        "blisk_ring",
        "mode",
        (*RING, "--harmonics", "3,5,7,9,15,25"),
        "Up to 0.2 mm, past first slip: beyond, at lift-off, lie loops. High harmonics resonate, and move each other:"
        " at 42 um damping grows by 4 % from 15 to 23 harmonics (0.3 % from there to 31), at 57 um by 4 % from 13 to 16"
        " (the 14th alone 1.6 %, the 16th alone 0.3 %). Estimates that end at 7 H / 4 do not see it: of H = 5 they were"
        " within 3 at 69 % of the places, of H = 7 at 75 %.",
    ),
    "blisk_ring_accuracy": Scene(
        "The same, asked for an accuracy",
        "blisk_ring",
        "mode",
        (*RING, "--harmonics", "3,5,9,15,21", "--accuracy", "1e-1,3e-2"),
        "The finest run is not the truth (see above): a run asked for 3e-2 takes more harmonics there and lies off it.",
        places=24,
    ),
}

HEAD = """# How far results are from the truth

Every point of a branch says how wrong it may be: `omega_error`, `zeta_error`, `amplitude_error`, and by source what
harmonics, samples, solver and component modes left out add (`lambda_error_*`, `amplitude_error_*`). The estimate is
one step of Newton's on the harmonics up to 7 H / 4, 17 at the least (large models: 2 H + 1 below 4), and four times
the samples, as far as equations go along it and taken anew where they bend, at the same amplitude, and what lies above
these as the force falls there, like 1 / H where friction jumps, at most like H^-3
([`discretisation_error.h`](../src/hb/discretisation_error.h)); of a reduction it is what the next component modes, as
many again, add to the motion that there is ([`omitted.py`](../python/fretwave/model/omitted.py)). Here it is held
against the error itself: each run of a sweep against the finest one of the study (whose own error is in the column
`estimated`), at 96 amplitudes (in the last table 24) from stick to full slip. Against *exact* motions, with no finer
run in between, see [accuracy](accuracy/README.md).

`within 3` is the share of the amplitudes `judged` at which the estimated error of lambda is within a factor of 3 of the
error, source by source; judged is where the error is three times what the finest run states of its own. Errors of zeta
are the largest of all amplitudes over the peak. Of a forced response it is the complex amplitude, over the largest one,
at 96 frequencies. Times are the processor's. Pictures: error over time left and right, estimate over error below.

Resonances of orders beyond those stay unseen: beside an undamped mode at 19, 21 or 25 times the frequency (H = 3, 7, 9,
nine amplitudes each) estimates are 3 to 30 times too small at 31 of 81 places.

Turned round, a run may be asked for an accuracy (sweep `accuracy`): H and N_t are the most that it took, `kept` the
share of the amplitudes at which lambda is that accurate over zeta omega0, `best fixed` the time of the quickest run
with one set (sweeps `harmonics`, `samples` and `set`, H with its default samples) that keeps it at 95 % of them.
"""


def study(name: str, scene: Scene, folder: Path) -> str:
    """Run it, unless it is there; returns why it has no table, or nothing."""
    out = folder / name
    if (out / "study.md").exists():
        return ""
    command = [sys.executable, "-m", "fretwave", "study", str(TOP / "cases" / scene.case / "case.toml")]
    done = subprocess.run([*command, *scene.words, "--out", str(out)], capture_output=True, text=True)
    print(done.stdout, end="")
    return "" if (out / "study.md").exists() else done.stderr.strip() or f"ended with code {done.returncode}"


def section(name: str, scene: Scene, folder: Path) -> list[str]:
    """Heading, table and pictures."""
    lines = [f"## {scene.title}", "", *([scene.says, ""] if scene.says else [])]
    table, _, notes = (folder / name / "study.md").read_text().partition("\n\n")
    command = " ".join(["fretwave study", f"cases/{scene.case}/case.toml", *scene.words])
    lines += ["```bash", command, "```", "", table, ""]
    lines += [line for line in notes.splitlines()[1:] if line.strip()] + [""]
    for kind in ("study", "calibration"):
        if (folder / name / f"{kind}.png").exists():
            shutil.copyfile(folder / name / f"{kind}.png", PICTURES / f"{name}_{kind}.png")
            lines += [f"![{scene.title}: {kind}](accuracy/pictures/{name}_{kind}.png)", ""]
    return lines


def machine(folder: Path) -> str:
    """Where it was measured."""
    record = json.loads(next(iter(sorted(folder.glob("*/run.json")))).read_text())
    known = record.get("versions", {})
    versions = ", ".join(f"{what} {known[what]}" for what in ("fretwave", "python", "petsc", "numpy") if what in known)
    shared = "Other work ran on the machine: times are good to a factor of two."
    return f"Measured on one thread of {platform.machine()}, {platform.system()}; {versions}. {shared}"


def main() -> None:
    """Studies, then the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[[], *SCENES])
    parser.add_argument("--out", type=Path, default=TOP / "runs" / "accuracy")
    options = parser.parse_args()
    failed = {}
    for name in options.names or SCENES:
        why = study(name, SCENES[name], options.out)
        if why:
            failed[name] = why
    made = [name for name in SCENES if (options.out / name / "study.md").exists()]
    lines = [HEAD, *(line for name in made for line in section(name, SCENES[name], options.out))]
    lines += ["## What failed", ""]
    lines += [f"* {SCENES[name].title}: {why}" for name, why in failed.items()] or ["No study."]
    lines += ["", machine(options.out), ""]
    PAGE.write_text("\n".join(lines))
    print(f"written: {PAGE}")


if __name__ == "__main__":
    main()
