"""``fretwave view`` of the contact: the faces that the pairs span, with pressure, traction, status and work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array
from ..case.load import Case
from ..model.law_info import STATUS
from ..model.pairs import Pairs
from ..post.contact_history import ContactHistory
from .choice import Choice
from .contact_faces import surface
from .fields import motion_field, write_states
from .geometry import geometry
from .motion import Scene
from .vtkhdf import GridFile

Write = Callable[[int, int, Sequence[ContactHistory], Array, int], None]


def write_pairs(path: Path, scene: Scene, placed: Mapping[str, Pairs], scale: float) -> list[int]:
    """Faces on the contact pairs, which move with the node next to them; returns the sectors whose pairs are shown.

    Other sectors of a wave are shown where their delay is a whole number of samples.
    """
    choice, contacts = scene.choice, list(placed.values())
    sectors = list(scene.sectors) if choice.whole_delays(scene.around) else [0]
    near = [cKDTree(scene.nodes).query(np.asarray(contact.points))[1] for contact in contacts]
    cells = [surface(contact) for contact in contacts]
    with GridFile(path, choice.times, choice.units) as grid:
        for sector in sectors:
            for contact, faces in zip(contacts, cells):
                grid.part(np.asarray(contact.points) @ scene.turn(sector).T, faces)
        write_states(grid, choice)
        write_motion = motion_field(grid, scale)
        writers = [_pair_fields(grid, list(placed), contacts, choice), _stresses(grid, list(placed), contacts, choice)]
        for place, sector in enumerate(sectors):
            shape = scene.shape(sector)
            for number, name in enumerate(placed):
                part = place * len(placed) + number
                write_motion(part, shape, near[number])
                histories = choice.histories(name, sector, scene.around)
                for write in writers:
                    write(part, number, histories, scene.turn(sector), sector)
    return sectors


def _pair_fields(grid: GridFile, names: Sequence[str], contacts: Sequence[Pairs], choice: Choice) -> Write:
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


def _stresses(grid: GridFile, names: Sequence[str], contacts: Sequence[Pairs], choice: Choice) -> Write:
    """Pressure and traction, what acts on the second body, where the areas and directions of all pairs are known."""
    first = [history for name in names for history in choice.contacts[name]]
    steps, samples = np.arange(len(choice.times)), choice.samples
    areas = all(contact.areas is not None for contact in contacts) and all(h.normal is not None for h in first)
    framed = areas and all(c.frames is not None and c.components == np.shape(c.frames)[1] for c in contacts)
    pressure = grid.field("pressure", 0, steps) if areas else None
    traction = grid.field("traction", 3, steps) if framed else None

    def write(part: int, number: int, histories: Sequence[ContactHistory], turn: Array, sector: int) -> None:
        contact = contacts[number]
        for point, history in enumerate(histories):
            for step, sample in enumerate(samples):
                place = point * len(samples) + step
                if pressure is not None:
                    pressure(place, part, history.normal_force[sample] / np.asarray(contact.areas))
                if traction is not None:
                    force = np.einsum("cp,pcx->px", history.f[sample], np.asarray(contact.frames)) @ turn.T
                    traction(place, part, force / np.asarray(contact.areas)[:, None])

    return write


def placed_contacts(case: Case, choice: Choice, say: Callable[[str], None]) -> dict[str, Pairs]:
    """Contacts with known places of their pairs."""
    built = geometry(case).pairs
    for name in choice.contacts:
        if name not in built or built[name].points is None:
            say(f"contact '{name}' is not shown: the model has no places of its pairs")
        elif any(history.status is None for history in choice.contacts[name]):
            say(f"contact '{name}' is shown without status: the results do not keep it, run the analysis anew for it")
    return {name: built[name] for name in choice.contacts if name in built and built[name].points is not None}
