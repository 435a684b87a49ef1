"""Waves of the whole sector (no reduction) in the limits of its contact, beside CalculiX' own of the cyclic wheel.

Free: *TIE, CYCLIC SYMMETRY of the rims; tied: of the shrouds as well. Stuck and sliding: SPRING2 elements of the case's
stiffness from the high end of the shroud to nodes in the same places, which the cyclic tie joins to the low end.

    .venv/bin/python cases/shrouded_sector/limits.py [free ...]       # after cases/run; with mpirun -n 2 on two ranks
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

import fretwave as fw

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import deck  # noqa: E402

DIAMETERS, MODES, STIFFNESS = (0, 3, 6, 12), 4, 1e5
LIMITS = ("free", "sliding", "stuck", "tied")
COSINE, SINE = np.cos(np.radians(deck.EDGE)), np.sin(np.radians(deck.EDGE))
ROUND = f"*ORIENTATION, NAME=ROUND\n{-SINE:.15g}, {COSINE:.15g}, 0, {-COSINE:.15g}, {-SINE:.15g}, 0\n"


def surface(name: str, numbers: list[int]) -> str:
    return f"*SURFACE, NAME={name}, TYPE=NODE\n" + "".join(f"{number}\n" for number in numbers)


def springs(limit: str, ends: list[int], twins: list[int]) -> str:
    """Along x, y and z, or along the circumference alone; the twins lie where the ends are."""
    places = deck.cartesian(deck.mesh()[0])[np.array(ends) - 1]
    text = "*NODE\n" + "".join(f"{twin}, {x:.12g}, {y:.12g}, {z:g}\n" for twin, (x, y, z) in zip(twins, places))
    text += ROUND if limit == "sliding" else ""
    for direction in (1,) if limit == "sliding" else (1, 2, 3):
        first = 1000 * direction
        text += f"*ELEMENT, TYPE=SPRING2, ELSET=SPRING{direction}\n"
        text += "".join(f"{first + k}, {a}, {b}\n" for k, (a, b) in enumerate(zip(ends, twins)))
        text += f"*SPRING, ELSET=SPRING{direction}{', ORIENTATION=ROUND' if limit == 'sliding' else ''}\n"
        text += f"{direction}, {direction}\n{STIFFNESS:.1f}\n"
    return text


def cyclic_deck(limit: str) -> str:
    """The deck with the cyclic tie, one step a nodal diameter; held nodes are not tied."""
    nodes, _ = deck.mesh()
    sets = {name: members.tolist() for name, members in deck.sets(nodes).items()}
    low, high = ([n for n in sets[name] if n not in sets["BORE"]] for name in ("LOW", "HIGH"))
    text = deck.model()
    if limit != "free":
        ends = sets["SHHIGH"]
        twins = ends if limit == "tied" else [len(nodes) + 1 + k for k in range(len(ends))]
        text += "" if limit == "tied" else springs(limit, ends, twins)
        low, high = low + sets["SHLOW"], high + twins
    text += surface("LOWS", low) + surface("HIGHS", high) + "*TIE, NAME=WHEEL, CYCLIC SYMMETRY\nHIGHS, LOWS\n"
    text += f"*CYCLIC SYMMETRY MODEL, N={deck.SECTORS}, NGRAPH=1, TIE=WHEEL\n0, 0, 0, 0, 0, 1\n"
    select = "*SELECT CYCLIC SYMMETRY MODES, NMIN={0}, NMAX={0}\n"
    return text + "".join(f"*STEP\n*FREQUENCY\n{2 * MODES}\n{select.format(d)}*END STEP\n" for d in DIAMETERS)


def calculix(limit: str) -> dict[int, list[float]]:
    """Frequencies [Hz] by nodal diameter; CalculiX lists each twice and writes seven digits. Rank 0."""
    job = HERE / "model" / f"wheel_{limit}.inp"
    job.write_text(cyclic_deck(limit), encoding="utf-8")
    subprocess.run(["ccx", job.stem], cwd=job.parent, check=True, stdout=subprocess.DEVNULL)
    found: dict[int, list[float]] = {}
    for words in map(str.split, job.with_suffix(".dat").read_text(encoding="utf-8").splitlines()):
        if len(words) == 6 and words[0].isdigit() and words[1].isdigit():
            found.setdefault(int(words[0]), []).append(float(words[4]))
    return {diameter: hz[::2] for diameter, hz in found.items()}


def fretwave(limit: str, diameter: int, comm: MPI.Comm) -> list[float]:
    """The same of the model file. Collective."""
    sector = comm.bcast(fw.read_model(HERE / "model" / "sector.h5") if comm.rank == 0 else None)
    if limit == "tied":
        sector = with_shrouds_on_the_faces(sector)
    tied = sector.tied()
    law = {"normal_stiffness": STIFFNESS, "tangential_stiffness": STIFFNESS, "friction_coefficient": 0.3}
    shroud = fw.Contact("coulomb_3d", tied.pairs["shroud"], {**law, "normal_load": 20.0})
    contacts = {"stuck": [shroud], "sliding": [shroud.sliding()]}.get(limit, [])
    with tied.model(contacts, comm, diameter) as model:
        return [mode.frequency_hz for mode in fw.linear_modes(model, MODES)]


def with_shrouds_on_the_faces(sector: fw.Structure) -> fw.Structure:
    """The pairs' nodes beside those of the rim, x, y, z of each."""
    names = [[f"n{node}{axis}" for node in nodes for axis in "xyz"] for nodes in sector.pairs["shroud"].nodes.T]
    high, low = ([sector.dof(name) for name in names_of] for names_of in names)
    return replace(sector, low=np.append(sector.low, low), high=np.append(sector.high, high))


def main() -> None:
    comm = MPI.COMM_WORLD
    if not (HERE / "model").exists():
        sys.exit("error: the model is not made yet\nfix: cases/run shrouded_sector --quick" if comm.rank == 0 else 1)
    for limit in sys.argv[1:] or LIMITS:
        expected = comm.bcast(calculix(limit) if comm.rank == 0 else None)
        for diameter in DIAMETERS:
            found = fretwave(limit, diameter, comm)
            off = [f"{a:.7g} ({a / b - 1:+.1e})" for a, b in zip(found, expected[diameter])]
            if comm.rank == 0:
                print(f"{limit:8} {diameter:2d} nodal diameters: {', '.join(off)}")


if __name__ == "__main__":
    main()
