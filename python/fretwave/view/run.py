"""``fretwave view``: the motion of a run over a period, and its contact pairs, as VTKHDF for ParaView.

Two files: the grid at rest with its displacement at phases of the period, and the contact pairs as points. Several
points of a branch follow each other in time, a period each, on one grid. The displacement leaves out the factor
e^{-n beta t} of a decaying mode, as the results do. A wheel is written sector by sector, one in memory at a time.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Indices
from ..case.kept import reload_case
from ..case.load import Case
from ..errors import InputError
from ..model.laws import STATUS, learn_laws
from ..model.pairs import Pairs
from ..post.contact_history import ContactHistory
from ..post.motion import complex_amplitudes
from ..results.results import has_results, open_results
from ..texts import display
from .choice import Choice, ViewOptions, analysis_name, read_choice
from .motion import Scene, Shape, geometry, mesh_of, scene_of
from .vtkhdf import VERTEX, Cells, GridFile

#: Highest harmonic shown as fields of its own.
SHOWN_HARMONICS = 3


def view_run(folder: Path, options: ViewOptions, say: Callable[[str], None] = print) -> list[Path]:
    """Write the files; returns their paths. One rank only.

    Raises
    ------
    InputError
        The folder holds no run, its case has changed, the model has no nodes, or there is no such analysis, point or
        sector.
    """
    learn_kept_laws(folder)
    case, _ = reload_case(folder, kept=True)
    with open_results(folder / "results.h5") as file:
        name = analysis_name(file, folder, case, options.analysis)
    written = case.analyses[name].view(folder, case, options, say)
    if written is not None:
        return list(written)
    nodes, cells = mesh_of(case, options.linear)
    with open_results(folder / "results.h5") as file:
        choice = read_choice(file, folder, case, options)
    for line in choice.lines():
        say(line)
    out = options.out or folder / f"{choice.name}.vtkhdf"
    pairs = out.with_name(f"{out.stem}_contact{out.suffix}")
    with scene_of(case, choice, nodes, folder, options.sectors) as scene:
        scale = options.scale if options.scale is not None else scene.natural_scale()
        write_grid(out, scene, cells, scale)
        count = sum(len(table) for table, _ in cells)
        say(f"{display(out)}: {_size(scene, len(nodes), 'nodes')}, {count} cells, {len(choice.times)} steps")
        placed = _placed(case, choice, say)
        if placed:
            shown = write_pairs(pairs, scene, placed, scale)
            count = sum(contact.n_pairs for contact in placed.values())
            alone = "" if shown == list(scene.sectors) else " (the samples of a period are no multiple of the sectors)"
            say(f"{display(pairs)}: {f'{len(shown)} times ' * (len(shown) > 1)}{count} contact pairs{alone}")
        else:
            pairs.unlink(missing_ok=True)  # of another point
    say(f"units: {case.units.described()}")
    say(f"ParaView (5.12 or later): 'Warp By Vector' with the field warp draws displacements {scale:g} times as large")
    return [out, pairs] if placed else [out]


def learn_kept_laws(folder: Path) -> None:
    """A case is read with the laws that its results keep, where the core that knows them is missing."""
    if not has_results(folder):
        return
    with open_results(folder / "results.h5") as file:
        kept = [told for group in file.values() for told in json.loads(group.attrs.get("laws", "{}")).values()]
    if not learn_laws(kept):
        fix = "view it where fretwave is installed with its core, or run it again"
        raise InputError("results of an earlier version do not keep their contact laws", display(folder), fix=fix)


def _size(scene: Scene, count: int, what: str) -> str:
    sectors = f"{len(scene.sectors)} of {scene.around} sectors, each " if scene.around > 1 else ""
    return f"{sectors}{count} {what}"


def write_grid(path: Path, scene: Scene, cells: Sequence[Cells], scale: float) -> None:
    """The grid with its displacement, that at rest, and the complex amplitudes of the lowest harmonics."""
    choice, labels = scene.choice, scene.choice.labels
    with GridFile(path, choice.times, choice.units) as grid:
        for sector in scene.sectors:
            grid.part(scene.nodes @ scene.turn(sector).T, *cells)
        _write_states(grid, choice)
        write_motion = _motion(grid, scale)
        rest = grid.field("rest_displacement", 3)
        orders = [order for order in choice.orders if order <= SHOWN_HARMONICS]
        names = [(n, part, f"harmonic_{n}_{part}") for n in orders if n for part in ("real", "imag")]
        names = [(0, "real", "harmonic_0")] * (0 in orders) + names
        amplitudes = {name: grid.field(name, 3, choice.point_of_step) for *_, name in names}
        numbers = grid.field("sector", dtype="i4") if scene.around > 1 else None
        for part, sector in enumerate(scene.sectors):
            shape = scene.shape(sector)
            write_motion(part, shape, slice(None))
            rest(0, part, shape.rest)
            for point, values in enumerate(shape.coefficients):
                q = complex_amplitudes(labels, values.reshape(-1, len(labels)))
                for order, side, name in names:
                    amplitudes[name](point, part, getattr(q[order], side).reshape(-1, 3))
            if numbers is not None:
                numbers(0, part, np.full(len(shape.nodes), sector))


def write_pairs(path: Path, scene: Scene, placed: Mapping[str, Pairs], scale: float) -> list[int]:
    """Contact pairs as points that move with the node next to them; returns the sectors whose pairs are shown.

    Other sectors of a wave are shown where their delay is a whole number of samples.
    """
    choice, contacts = scene.choice, list(placed.values())
    sectors = list(scene.sectors) if choice.whole_delays(scene.around) else [0]
    near = [cKDTree(scene.nodes).query(np.asarray(contact.points))[1] for contact in contacts]
    with GridFile(path, choice.times, choice.units) as grid:
        for sector in sectors:
            for contact in contacts:
                places = np.asarray(contact.points) @ scene.turn(sector).T
                grid.part(places, (np.arange(contact.n_pairs)[:, None], VERTEX))
        _write_states(grid, choice)
        write_motion, write_pair = _motion(grid, scale), _pair_fields(grid, list(placed), contacts, choice)
        for place, sector in enumerate(sectors):
            shape = scene.shape(sector)
            for number, name in enumerate(placed):
                part = place * len(placed) + number
                write_motion(part, shape, near[number])
                histories = choice.histories(name, sector, scene.around)
                write_pair(part, number, histories, scene.turn(sector), sector)
    return sectors


def _pair_fields(
    grid: GridFile, names: Sequence[str], contacts: Sequence[Pairs], choice: Choice
) -> Callable[..., None]:
    """Of every step: forces, gap, status; of every period: shares of the status, dissipated work."""
    first = [history for name in names for history in choice.contacts[name]]
    steps, period, samples = np.arange(len(choice.times)), choice.point_of_step, choice.samples
    fixed = {name: grid.field(name) for name in ("contact", "pair", "sector")}
    moving = {name: grid.field(name, 0, steps) for name in ("normal_force", "tangential_force", "gap")}
    over_period = {"dissipated_work": grid.field("dissipated_work", 0, period)}
    framed = all(contact.frames is not None for contact in contacts) and all(
        history.normal is not None for history in first
    )
    normal = grid.field("normal", 3) if framed else None
    if all(history.status is not None for history in first):
        moving["status"] = grid.field("status", 0, steps, "i1")
        over_period.update({f"share_{word}": grid.field(f"share_{word}", 0, period) for word in STATUS})

    def write(part: int, number: int, histories: Sequence[ContactHistory], turn: Array, sector: int) -> None:
        n = contacts[number].n_pairs
        for name, values in (("contact", np.full(n, float(number))), ("pair", np.arange(float(n)))):
            fixed[name](0, part, values)
        fixed["sector"](0, part, np.full(n, float(sector)))
        if normal is not None:
            normal(0, part, np.asarray(contacts[number].frames)[:, first[0].normal] @ turn.T)
        for point, history in enumerate(histories):
            for name, field in moving.items():
                for step, values in enumerate(getattr(history, name)[samples]):
                    field(point * len(samples) + step, part, values)
            for name, field in over_period.items():
                word = name[len("share_") :]
                field(point, part, history.share(STATUS[word]) if word in STATUS else history.work)

    return write


def _motion(grid: GridFile, scale: float) -> Callable[[int, Shape, slice | Indices], None]:
    """Writes the true displacement of a part, and the one from rest enlarged for the eye."""
    steps = np.arange(grid.steps)
    true, warp = grid.field("displacement", 3, steps), grid.field("warp", 3, steps, "f4")

    def write(part: int, shape: Shape, chosen: slice | Indices) -> None:
        for step, x in enumerate(shape.displacements(chosen)):
            true(step, part, x)
            warp(step, part, scale * (x - shape.rest[chosen]))

    return write


def _write_states(grid: GridFile, choice: Choice) -> None:
    for name, values in choice.states.items():
        grid.field_data(name, values[choice.point_of_step])
    grid.field_data("phase", np.tile(choice.phases, len(choice.points)))


def _placed(case: Case, choice: Choice, say: Callable[[str], None]) -> dict[str, Pairs]:
    """Contacts with known places of their pairs."""
    built = geometry(case).pairs
    for name in choice.contacts:
        if name not in built or built[name].points is None:
            say(f"contact '{name}' is not shown: the model has no places of its pairs")
        elif any(history.status is None for history in choice.contacts[name]):
            say(f"contact '{name}' is shown without status: the results do not keep it, run the analysis anew for it")
    return {name: built[name] for name in choice.contacts if name in built and built[name].points is not None}
