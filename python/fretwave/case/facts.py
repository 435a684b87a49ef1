"""What is known of a case when one of its analyses is checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Optional

from .schema import AerodynamicsSection, PreloadSection
from .toml.source import Source

if TYPE_CHECKING:
    from ..model.contact import Contact
    from ..model.structure import Structure


@dataclass(frozen=True)
class Facts:
    """The rest of the case, as far as it could be read: what is wrong elsewhere is told there.

    Attributes
    ----------
    source : Source
        The case file, for the places of its keys.
    model_known : bool
        The model could be read, and one of a sector tied to its neighbours.
    dofs : sequence of str, optional
        Of the model that is solved, of a wheel those of a sector; None where it could not be read.
    named : sequence of str, optional
        Dofs that an analysis may name: with a reduction those that it keeps.
    least_dofs : int
        Of the model that is solved, at least.
    neighbours : Structure, optional
        A sector of a wheel, tied to the next ones.
    contacts, complete :
        Contacts without an error, and whether these are all.
    laws : mapping
        Known contact laws.
    loads : sequence of str, optional
        Static loads of the model; None where it could not be read.
    parts : sequence of str, optional
        Parts of the model's stiffness (`Structure.parts`); None where it could not be read.
    preload, flow :
        Tables of the case; None where there are none, or where they are wrong.
    """

    source: Source
    model_known: bool = False
    dofs: Optional[Sequence[str]] = None
    named: Optional[Sequence[str]] = None
    least_dofs: int = 0
    neighbours: Optional[Structure] = None
    contacts: Sequence[Contact] = ()
    complete: bool = False
    laws: Mapping[str, Any] = field(default_factory=dict)
    loads: Optional[Sequence[str]] = None
    parts: Optional[Sequence[str]] = None
    preload: Optional[PreloadSection] = None
    flow: Optional[AerodynamicsSection] = None

    @property
    def sectors(self) -> Optional[int]:
        """Of the wheel; None for a whole structure."""
        return self.neighbours.sectors if self.neighbours else None

    @property
    def has_flow(self) -> bool:
        """There is a table [aerodynamics], right or wrong."""
        return "aerodynamics" in self.source.data

    def analyses_of(self, kind: str) -> list[str]:
        """Names of the analyses of a type, also of those that are wrong."""
        entries = self.source.entries("analysis")
        return [str(entry["name"]) for entry in entries if entry.get("type") == kind and "name" in entry]
