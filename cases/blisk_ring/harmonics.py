"""Damping and frequency of the mode with few and with many harmonics, from folders of `fretwave run`.

    fretwave run cases/blisk_ring/case.toml --only mode --no-plots --out runs/h3
    fretwave run cases/blisk_ring/case.toml --only mode --no-plots --set mode.harmonics=15 --set mode.errors=false \\
        --set 'mode.report_at=[]' --out runs/h15                                             # ten minutes
    .venv/bin/python cases/blisk_ring/harmonics.py runs/h15 runs/h3 [--out PICTURE]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fretwave import open_run
from fretwave.plots import style

PICTURE = Path(__file__).parent / "pictures" / "harmonics.png"


def draw(folders: list[Path], path: Path) -> None:
    with style.rules():
        figure, (upper, lower) = style.new_figure(6.4, rows=2, sharex=True)
        for k, folder in enumerate(folders):
            found = open_run(folder)["mode"]
            highest, folds = found.labels[-1].rstrip("cs"), len(found.met("fold"))
            label = f"H = {highest}, {len(found)} points, {folds} folds"
            look = {"color": (style.RED, style.BLUE, style.INK)[k % 3], "lw": 0.7 if folds > 5 else 1.8}
            curve = found.curve(8)
            upper.plot(1e3 * curve["amplitude"], 100 * curve["zeta"], label=label, **look)
            lower.plot(1e3 * curve["amplitude"], curve["frequency_hz"], label=label, **look)
        upper.set_ylabel(style.label("Modal damping", "%"))
        lower.set(xlabel=style.label("Amplitude of the tip", "mm"))
        lower.set_ylabel(style.label("Frequency", "Hz"))
        upper.legend()
        figure.savefig(path, dpi=style.DPI)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, default=PICTURE)
    options = parser.parse_args()
    draw(options.folders, options.out)
