"""The first bending mode of the blade over its amplitude, reduced by Craig-Bampton: a first end-to-end run by script.

    OMP_NUM_THREADS=1 .venv/bin/python cases/blade_root/backbone.py --method CNM --harmonics 7 --highest 1.6e-3

Writes backbone_<method>.csv and .png into --out. The blade is held by contact alone but for its axial stop, so
stop below the amplitude where all pairs slip or open.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

import fretwave as fw
import model as case
from fretwave.preload import balanced
from fretwave.reduction import reduce

MU = 0.5  #: titanium on titanium (Laxalde et al. 2008, section 4)
STIFFNESS_DAMPING = 2e-6  #: [s] C = this times K: a small linear loss, 0.17 % in the first mode


def reduced_model(component_modes: int) -> tuple[fw.Model, int]:
    """The blade on its contact and observation dofs and its component modes; the observed dof's new number."""
    blade: dict[str, Any] = case.build()
    reduction = reduce(blade["M"], blade["K"], keep=blade["keep_dofs"], modes=component_modes)
    place = {int(dof): number for number, dof in enumerate(blade["keep_dofs"])}
    rows = blade["B"].tocoo()
    B = sp.csr_matrix((rows.data, (rows.row, [place[c] for c in rows.col])), (rows.shape[0], reduction.size))
    law = {
        "normal_stiffness": blade["normal_stiffness"],
        "tangential_stiffness": blade["tangential_stiffness"],
        "friction_coefficient": MU,
        "normal_load": blade["normal_loads"],
    }
    root = fw.Contact("coulomb_3d", B, law, name="root")
    return fw.Model(reduction.M, reduction.K, STIFFNESS_DAMPING * reduction.K, [root]), place[
        int(blade["observation_dof"])
    ]


def branch(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Points from full stick upwards."""
    model, dof = reduced_model(arguments.modes)
    rest = balanced(model, fw.linear_modes(model, 1)[0])
    stuck = fw.linear_modes(model, 1)[0]
    mode = fw.NonlinearMode(
        model, fw.choose_harmonics(model, arguments.harmonics, arguments.samples), arguments.method, dof, stuck
    )
    mode.preload(rest.displacement, rest.load)
    steps = fw.StepControl(initial=0.2, maximum=0.4)
    points = fw.Continuation(mode, mode.initial(arguments.lowest), (arguments.lowest, arguments.highest), steps)
    table = []
    for point in points:
        row = {"point": point.index, **mode.state(point.y), **mode.diagnostics(point.y)}
        table.append({**row, "newton": point.newton, "wall_s": point.wall_s, "event": point.event})
        print(
            f"{point.index:4d} a {row['amplitude']:.3e} m  f {row['frequency_hz']:.4f} Hz"
            f"  zeta {100 * row['zeta']:.4f} %  slip {row['slip']:.2f}  open {row['open']:.2f}"
            f"  newton {point.newton}  {point.wall_s:.2f} s  {point.event}",
            flush=True,
        )
    print(f"stuck asymptote {stuck.frequency_hz:.5f} Hz; {points.reason}")
    return table


def draw(table: list[dict[str, Any]], path: Path) -> None:
    """Frequency, damping and contact over amplitude."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    amplitude = 1e3 * np.array([row["amplitude"] for row in table])
    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(7, 8), constrained_layout=True)
    axes[0].plot(amplitude, [row["frequency_hz"] for row in table], ".-")
    axes[0].set_ylabel("Frequency [Hz]")
    axes[1].plot(amplitude, [100 * row["zeta"] for row in table], ".-")
    axes[1].set_ylabel("Damping ratio [%]")
    axes[2].stackplot(
        amplitude,
        *([100 * row[s] for row in table] for s in ("stick", "slip", "open")),
        labels=("stick", "slip", "open"),
    )
    axes[2].set_ylabel("Share of pair-samples [%]")
    axes[2].set_xlabel("Modal amplitude at the trailing-edge tip [mm]")
    axes[2].legend(loc="lower left")
    axes[0].set_xscale("log")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run, write the table, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", choices=("CNM", "EPMC"), default="CNM")
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--modes", type=int, default=10, help="component modes")
    parser.add_argument("--lowest", type=float, default=5e-5, help="[m]")
    parser.add_argument("--highest", type=float, default=1.6e-3, help="[m]")
    parser.add_argument("--out", type=Path, default=Path("runs/blade_root"))
    arguments = parser.parse_args()
    table = branch(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    stem = arguments.out / f"backbone_{arguments.method}"
    with stem.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(table[0]))
        writer.writeheader()
        writer.writerows(table)
    draw(table, stem.with_suffix(".png"))


if __name__ == "__main__":
    main()
