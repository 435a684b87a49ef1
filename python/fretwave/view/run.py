"""``fretwave view``: the motion of a run over a period, and its contact pairs, as VTKHDF for ParaView.

Two files: the grid at rest with its displacement at phases of the period, and the faces of the contact. Several
points of a branch follow each other in time, a period each, on one grid. The displacement leaves out the factor
e^{-n beta t} of a decaying mode, as the results do. A wheel is written sector by sector, one in memory at a time.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..arrays import Indices
from ..case.kept import reload_case
from ..errors import InputError
from ..model.laws import learn_laws
from ..model.pairs import Pairs
from ..post.motion import complex_amplitudes
from ..results.results import has_results, open_results
from ..texts import display
from .choice import Choice, analysis_name, read_choice
from .contact import placed_contacts, write_pairs
from .fields import motion_alone, motion_field, write_states
from .geometry import mesh_of
from .motion import Scene, Shape, scene_of
from .options import ViewOptions
from .series import write_series
from .skin import POLYGON, numbered, skin
from .vtkhdf import Cells, GridFile

#: Highest harmonic shown as fields of its own.
SHOWN_HARMONICS = 3
#: Endings of what is written, which a file that is asked for may have or not.
ENDINGS = (".vtkhdf", ".pvd", ".png", ".gif")


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
    out = options.out and options.out.with_name(_stem(options.out) + ".vtkhdf")
    written = case.analyses[name].view(folder, case, replace(options, out=out), say)
    if written is not None:
        return _of_its_own(list(written), name, options, say)
    nodes, cells = mesh_of(case, options.linear or (options.skin and not options.pvd))
    with open_results(folder / "results.h5") as file:
        choice = read_choice(file, folder, case, options)
    for line in choice.lines(options.pvd or not options.skin):  # pictures never show contacts
        say(line)
    with scene_of(case, choice, nodes, folder, options.sectors) as scene:
        for line in scene.note.splitlines():
            say(line)
        scale = options.scale if options.scale is not None else scene.natural_scale()
        out = folder / choice.name if options.out is None else options.out.with_name(_stem(options.out))
        files = _pictures(out, scene, cells, scale, options, say)
        if options.pvd or not files:
            files += _for_paraview(out, scene, cells, placed_contacts(case, choice, say), scale, options, say)
            say(f"units: {case.units.described()}")
            say(_how(scale, options))
    return files


def _how(scale: float, options: ViewOptions) -> str:
    """To see the motion in ParaView."""
    if options.pvd:
        return f"ParaView: 'Warp By Vector' with the field motion and a scale factor of {scale:g}"
    said = f"'Warp By Vector' with the field warp draws displacements {scale:g} times as large"
    return f"ParaView (5.12 or later; --pvd for any): {said}"


def _of_its_own(written: list[Path], name: str, options: ViewOptions, say: Callable[[str], None]) -> list[Path]:
    """Files of an analysis that shows something else than a motion."""
    options.refuse_pictures(name)
    if not options.pvd:
        return written
    found = [_series(path, _of(path, options), say) for path in written]
    for path in written:
        path.unlink()
    return found


def _stem(path: Path) -> str:
    """A file's name without the ending that it may have."""
    return path.stem if path.suffix in ENDINGS else path.name


def _pictures(
    out: Path, scene: Scene, cells: Sequence[Cells], scale: float, options: ViewOptions, say: Callable[[str], None]
) -> list[Path]:
    """A still and an animation, as asked for."""
    if not (options.png or options.gif):
        return []
    from .still import Still

    still, asked = Still(scene, cells, scale, options.eye), {".png": options.png, ".gif": options.gif}
    found = [out.with_name(out.name + ending) for ending, wanted in asked.items() if wanted]
    for path in found:
        (still.png if path.suffix == ".png" else still.gif)(path)
        say(f"{display(path)}: {len(still.faces)} faces, displacements drawn {scale:g} times as large")
    return found


def _for_paraview(
    out: Path,
    scene: Scene,
    cells: Sequence[Cells],
    placed: Mapping[str, Pairs],
    scale: float,
    options: ViewOptions,
    say: Callable[[str], None],
) -> list[Path]:
    """The grid and the contact, as VTKHDF or as series of files."""
    files, pairs = [out.with_name(f"{out.name}.vtkhdf")], out.with_name(f"{out.name}_contact.vtkhdf")
    with TemporaryDirectory(dir=out.parent) if options.pvd else nullcontext() as beside:
        places = [Path(beside) / path.name if beside else path for path in (files[0], pairs)]
        count = write_grid(places[0], scene, cells, scale, options.pvd)
        say(f"{display(_of(files[0], options))}: {_size(scene, count)}, {len(scene.choice.times)} steps")
        if placed:
            shown = write_pairs(places[1], scene, placed, scale)
            files.append(pairs)
            say(f"{display(_of(pairs, options))}: {_pairs(placed, shown, scene)}")
        else:
            places[1].unlink(missing_ok=True)  # of another point
        if options.pvd:
            return [_series(place, _of(path, options), say) for place, path in zip(places, files)]
    return files


def _of(path: Path, options: ViewOptions) -> Path:
    """The file that is left of one: that of a series names its steps."""
    return path.with_name(f"{path.name[: -len('.vtkhdf')]}.pvd") if options.pvd else path


def _series(source: Path, out: Path, say: Callable[[str], None]) -> Path:
    """As ParaView 5.11 plays it."""
    size = write_series(source, out)
    say(f"{display(out)}: {size / 1e6:.3g} MB with its steps")
    return out


def _pairs(placed: Mapping[str, Pairs], shown: Sequence[int], scene: Scene) -> str:
    count = sum(contact.n_pairs for contact in placed.values())
    alone = "" if list(shown) == list(scene.sectors) else " (the samples of a period are no multiple of the sectors)"
    return f"{f'{len(shown)} times ' * (len(shown) > 1)}{count} contact pairs{alone}"


def learn_kept_laws(folder: Path) -> None:
    """A case is read with the laws that its results keep, where the core that knows them is missing."""
    if not has_results(folder):
        return
    with open_results(folder / "results.h5") as file:
        kept = [told for group in file.values() for told in json.loads(group.attrs.get("laws", "{}")).values()]
    if not learn_laws(kept):
        fix = "view it where fretwave is installed with its core, or run it again"
        raise InputError("results of an earlier version do not keep their contact laws", display(folder), fix=fix)


def _size(scene: Scene, count: tuple[int, int]) -> str:
    """Nodes and cells of a sector, or of the whole."""
    sectors = f"{len(scene.sectors)} of {scene.around} sectors, each " if scene.around > 1 else ""
    return f"{sectors}{count[0]} nodes, {count[1]} cells"


def write_grid(
    path: Path, scene: Scene, cells: Sequence[Cells], scale: float, outside: bool = False
) -> tuple[int, int]:
    """The grid with its displacement, that at rest, and the complex amplitudes of the lowest harmonics.

    Parameters
    ----------
    outside : the outer faces alone, with the displacement from rest in single precision and nothing else

    Returns
    -------
    Nodes and cells of a sector.
    """
    nodes, cells = _outside(scene, cells) if outside else (slice(None), list(cells))
    with GridFile(path, scene.choice.times, scene.choice.units) as grid:
        for sector in scene.sectors:
            grid.part(scene.nodes[nodes] @ scene.turn(sector).T, *cells)
        write_states(grid, scene.choice)
        write_motion = motion_alone(grid) if outside else motion_field(grid, scale)
        write_more = _harmonics(grid, scene.choice) if not outside else None
        numbers = grid.field("sector", dtype="i4") if scene.around > 1 else None
        for part, sector in enumerate(scene.sectors):
            shape = scene.shape(sector)
            write_motion(part, shape, nodes)
            if write_more is not None:
                write_more(part, shape)
            if numbers is not None:
                numbers(0, part, np.full(len(shape.nodes[nodes]), sector))
    return len(scene.nodes[nodes]), sum(len(table) for table, _ in cells)


def _outside(scene: Scene, cells: Sequence[Cells]) -> tuple[Indices, list[Cells]]:
    """The nodes on the outer faces, and these faces; all nodes where there are none."""
    faces = skin(scene.nodes, cells)
    if not faces:
        return np.arange(len(scene.nodes)), list(cells)
    used, faces = numbered(faces)
    return used, [(table, POLYGON) for table in faces]


def _harmonics(grid: GridFile, choice: Choice) -> Callable[[int, Shape], None]:
    """Writes the displacement at rest and the complex amplitudes of a part."""
    labels = choice.labels
    rest = grid.field("rest_displacement", 3)
    orders = [order for order in choice.orders if order <= SHOWN_HARMONICS]
    names = [(n, part, f"harmonic_{n}_{part}") for n in orders if n for part in ("real", "imag")]
    names = [(0, "real", "harmonic_0")] * (0 in orders) + names
    amplitudes = {name: grid.field(name, 3, choice.point_of_step) for *_, name in names}

    def write(part: int, shape: Shape) -> None:
        rest(0, part, shape.rest)
        for point, values in enumerate(shape.coefficients):
            q = complex_amplitudes(labels, values.reshape(-1, len(labels)))
            for order, side, name in names:
                amplitudes[name](point, part, getattr(q[order], side).reshape(-1, 3))

    return write
