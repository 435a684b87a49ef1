"""Nodes of a sector that lie on the next one's, and that neither its faces nor a contact join."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from models.meshed_wheel import PAIRS, Wheel, sector_of

import fretwave as fw
from fretwave.commands.main import main
from fretwave.errors import InputError
from fretwave.importers.nodes import Nodes
from fretwave.importers.sector import SectorFaces
from fretwave.importers.untied import check_untied

pytestmark = pytest.mark.ranks(1)


def said_of(folder: Path, capfd: pytest.CaptureFixture[str], dropped: list[int], *options: str) -> list[str]:
    """Warnings of an import whose faces lack some places of the rim's nodes."""
    wheel = Wheel()
    command = wheel.write(folder)
    with np.load(folder / "nodes.npz") as archive:
        found = dict(archive)
    found |= {f"rim{side}": np.delete(wheel.face("rim", side), dropped) + 1 for side in ("low", "high")}
    np.savez(folder / "nodes.npz", **found)
    assert main([*command, *sector_of(), *options]) == 0
    return [line for line in capfd.readouterr().out.splitlines() if "nothing joins them" in line]


def test_faces_that_are_complete(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Nodes of a contact with the next sector are joined to it."""
    assert not said_of(tmp_path, capfd, [], *PAIRS)


def test_faces_that_lack_a_node(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    wheel = Wheel()
    low, high = (wheel.face("rim", side) for side in ("low", "high"))
    place = int(np.argmax(np.isin(low, wheel.free)))
    (text,) = said_of(tmp_path, capfd, [place], *PAIRS)
    assert f"1 free node ({low[place] + 1}) turned to the next sector lie on its nodes {high[place] + 1}" in text
    assert "are RIMLOW and RIMHIGH complete?" in text


def test_shrouds_without_contact_are_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (text,) = said_of(tmp_path, capfd, [])
    assert f"{len(Wheel().face('shroud', 'low'))} free nodes" in text


@pytest.mark.parametrize("held", [False, True])
def test_a_node_on_the_axis(held: bool) -> None:
    """Every sector would have one of its own, unless it is held."""
    points = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 0.3], [0.4, 0.3, 0]])
    nodes = Nodes(np.arange(1, 5), points, "four", {"LOW": np.array([1]), "HIGH": np.array([2])})
    free = np.array([1, 2, 4] if held else [1, 2, 3, 4])
    labels = np.column_stack([np.repeat(free, 3), np.tile([1, 2, 3], len(free))])
    model = fw.Structure(np.eye(len(labels)), np.eye(len(labels)), labels=labels)
    wheel = SectorFaces(4, "LOW", "HIGH", "z")
    if held:
        assert check_untied(model, wheel, nodes, None) == []
        return
    with pytest.raises(InputError, match="free nodes lie on the axis") as caught:
        check_untied(model, wheel, nodes, None)
    assert caught.value.fix and "nodes 3" in str(caught.value.where)


def test_nodes_of_a_narrow_sector(tmp_path: Path) -> None:
    """Of 100 sectors a bore of 30 moves by 1.9 to the next one: less than pairs may be apart, and not on the axis."""
    radius, angle = np.repeat([30.0, 40.0], 2), 2 * np.pi / 100 * np.tile([-0.5, 0.5], 2)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * radius])
    nodes = Nodes(np.arange(1, 5), points, "four", {"LOW": np.array([1, 3]), "HIGH": np.array([2, 4])})
    nodes.coordinates = np.vstack([points, [[30.0, 0, 0]]])
    nodes.numbers = np.arange(1, 6)
    labels = np.column_stack([np.repeat(nodes.numbers, 3), np.tile([1, 2, 3], 5)])
    model = fw.Structure(np.eye(15), np.eye(15), labels=labels)
    assert check_untied(model, SectorFaces(100, "LOW", "HIGH", "z"), nodes, 2.0) == []
