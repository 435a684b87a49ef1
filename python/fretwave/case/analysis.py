"""What an analysis is: keys, checks, needs, a headline, a run, pictures. A kind of analysis is a subclass.

General code asks these methods and knows no kind by name. The package's kinds are the files of `fretwave.analyses`; a
file of a user's own adds another with `register_analysis`, from a script or named by a case (``plugins``).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Optional, TypeVar, get_args

from pydantic import PrivateAttr

from .. import registry
from ..errors import InputError
from ..model.structure import SPIN
from ..results.sweep_summary import COUNTS, Summary
from ..units import SI, UnitSystem
from .analysis_tables import Damper, MistuningSection
from .checks_common import check_common
from .fields import Name, Section, key
from .schema import PreloadSection

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..analyses.parts.context import AnalysisContext, Outcome
    from ..model.model import Model
    from ..results.reader import Run
    from ..view.options import ViewOptions
    from .facts import Facts
    from .harmonic import HarmonicSection
    from .load import Case
    from .reporter import Reporter

Own = TypeVar("Own", bound="AnalysisSection")
Kind = TypeVar("Kind", bound="type[AnalysisSection]")


class AnalysisSection(Section):
    """What every ``[[analysis]]`` has.

    A kind gives its keys (fields made with :func:`key`), `type` as ``Literal["<its name>"]``, and :meth:`run`. All
    other methods have defaults that are right for an analysis that stands alone.

    Attributes
    ----------
    pictures : tuple of str
        Modules of `fretwave.plots` that draw its results; see also :meth:`figures`.
    summary : Summary
        What a sweep says of each of its branches.
    sweeps : bool
        It runs other analyses in place of a model of its own.
    wears : bool
        It wears the contacts of a model.
    shown_where_kept : bool
        `fretwave view` shows points at which the motion of the contacts is kept, where there are any.
    """

    pictures: ClassVar[tuple[str, ...]] = ()
    summary: ClassVar[Summary] = COUNTS
    sweeps: ClassVar[bool] = False
    wears: ClassVar[bool] = False
    shown_where_kept: ClassVar[bool] = False

    name: Name = key("unique name; results go to <name>.csv", example='"mode"', pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")
    type: str = key("kind of analysis", example='"mode"')
    dampers: list[Damper] = key(
        "viscous dampers to ground added in this analysis",
        example='[{ dof = "m1", c = -1.0 }]',
        default_factory=list,
    )
    petsc: str = key("PETSc options of this analysis", example='"-snes_rtol 1e-9"', default="")

    _units: UnitSystem = PrivateAttr(default=SI)

    @property
    def units(self) -> UnitSystem:
        """The system that the case's numbers are in; ``units("length")`` is its symbol of a length."""
        return self._units

    def read_in(self, units: UnitSystem) -> None:
        """Say which system its numbers are in."""
        self._units = units

    # What the rest of the case must do for it

    def needs(self) -> list[str]:
        """Analyses whose results it reads: they run before it, or their results lie in the run folder."""
        return []

    def compares_with(self) -> list[str]:
        """Analyses whose results it reads where there are any: they run before it."""
        return []

    def beside(self, case: Case) -> list[str]:
        """Analyses that its further tables stand beside where there are results of them: they run before it."""
        return self.compares_with()

    def decided_by(self) -> list[str]:
        """Other analyses whose keys decide its results: when one changes, results kept are no longer its own."""
        return []

    def kept_dofs(self) -> list[str]:
        """Names of the dofs that a reduction must keep for it."""
        return [damper.dof for damper in self.dampers]

    def settings(self, case: Case) -> AnalysisSection:
        """The analysis whose model, wave, preload and harmonics it uses."""
        return self

    def acting_dampers(self, case: Case) -> list[Damper]:
        """Dampers of its model."""
        return list(self.settings(case).dampers)

    def own_preload(self) -> Optional[PreloadSection]:
        """The static state that it names in place of the case's."""
        return None

    def harmonic(self) -> Optional[HarmonicSection]:
        """Its keys in the frequency domain: harmonics, wave, wheel, flow; None where it has none."""
        return None

    def waves(self, sectors: int) -> list[int]:
        """Nodal diameters of the waves that it looks at on a wheel of so many sectors, negative for backward ones."""
        return []

    def spins(self) -> tuple[str, list[float]]:
        """Part of the stiffness that grows with the speed squared, and speeds [rev/min] that are not the case's."""
        return SPIN, []

    def whole_wheel(self) -> tuple[bool, Optional[MistuningSection]]:
        """Whether it looks at all sectors of the wheel, and how these are mistuned."""
        section = self.harmonic()
        return (False, None) if section is None else (section.wheel, section.mistuning)

    def integrates(self) -> str:
        """The key by which it integrates in time, empty where it does not: that needs a law of the present motion."""
        return ""

    def largest_amplitude(self) -> Optional[float]:
        """Largest displacement [length] that it asks for; None where it names none."""
        return None

    def passes(self, amplitude: float) -> bool:
        """Its branch passes an amplitude at which it estimates the error of the reduction."""
        return False

    # Is it right, and what would it do?

    def completed(self, report: Reporter, facts: Facts) -> AnalysisSection:
        """The same with what follows from the model; what is wrong with that goes to the report."""
        return self

    def check(self, report: Reporter, facts: Facts) -> None:
        """Report all that is wrong beyond types and bounds; called once, before anything runs. One rank only.

        Parameters
        ----------
        report : Reporter
            ``report.wrong(("key",), what, expected, fix)``, ``report.dof(("key",), name, facts.named)``
        """
        check_common(report, self, facts)

    def check_chosen(self, case: Case) -> list[InputError]:
        """What is wrong beside analyses that it reads, which is of no account where `--only` leaves it out."""
        return []

    def least_memory(self, facts: Facts) -> Mapping[str, float]:
        """Least memory [bytes] by `<key that asks for it>: <what it is for>`."""
        return {}

    def headline(self) -> str:
        """What it would compute, in a line of `fretwave check`."""
        return self.type.replace("_", " ")

    def details(self, model: Model, preloaded: bool = False) -> list[str]:
        """Further lines of `fretwave check`, of an analysis with a [preload] or without. Collective."""
        if not self.dampers:
            return []
        unit = self.units("force s/length")
        return ["added dampers: " + ", ".join(f"{damper.c:g} {unit} at {damper.dof}" for damper in self.dampers)]

    def at_rest(self, context: AnalysisContext[Any]) -> tuple[list[str], list[InputError]]:
        """What `fretwave check` says of the state at rest once it is solved, and warnings. Collective.

        Raises
        ------
        NotConverged
            There is no such state.
        """
        return [], []

    # The run, and what comes of it

    def run(self: Own, context: AnalysisContext[Own]) -> Outcome:
        """Compute it; rows go to ``context.writer(columns)`` as they are found. Collective.

        Raises
        ------
        NotConverged
            Before its first row: there was nothing to start from.
        """
        raise NotImplementedError

    @classmethod
    def figures(cls, run: Run) -> Iterator[tuple[str, Figure]]:
        """Pictures of its results, each named ``<analysis>_<what>``, beside those of `pictures`."""
        return iter(())

    def view(
        self, folder: Path, case: Case, options: ViewOptions, say: Callable[[str], None]
    ) -> Optional[Sequence[Path]]:
        """Write what `fretwave view` shows of it; returns the files. One rank only.

        None for the motion over a period of the harmonic coefficients that its results keep.
        """
        return None


def kind_of(kind: object) -> str:
    """The `type` that a class of analyses has in a case.

    Raises
    ------
    InputError
        The class is none, or lacks what is needed.
    """
    shown = getattr(kind, "__name__", repr(kind))

    def wrong(what: str, measured: object, expected: str, fix: str) -> InputError:
        where = registry.file_of(kind) if isinstance(kind, type) else None
        return InputError(f"'{shown}' cannot be registered: {what}", where, measured, expected, fix)

    if not isinstance(kind, type) or not issubclass(kind, AnalysisSection):
        raise wrong("it is no kind of analysis", None, "a subclass of fretwave.AnalysisSection", "derive it from that")
    given = get_args(kind.model_fields["type"].annotation)
    if len(given) != 1 or not isinstance(given[0], str) or not re.fullmatch("[a-z][a-z0-9_]*", given[0]):
        names = ", ".join(map(str, given)) or "no name"
        raise wrong("its `type` is no single name", names, 'Literal["a_name"]', f'`type: Literal["{shown.lower()}"]`')
    hidden = [name for name in kind.model_fields if name not in AnalysisSection.model_fields]
    hidden = [name for name in hidden if hasattr(AnalysisSection, name)]
    if hidden:
        raise wrong("a key has the name of a method", ", ".join(hidden), "other names", "rename the key")
    unknown = [name for name in kind.pictures if find_spec(f"fretwave.plots.{name}") is None]
    if unknown:
        raise wrong("its pictures are not there", ", ".join(unknown), "modules of fretwave.plots", "draw in `figures`")
    if kind.run is AnalysisSection.run:
        raise wrong("it has no `run`", None, "a method that computes it", "`def run(self, context): ...`")
    return given[0]


def register_analysis(kind: Kind) -> Kind:
    """Make a kind of analysis known to cases by its `type`; also as decorator of its class.

    On every rank that runs the case: call it where the script does so on all, or name the file under `plugins`.

    Raises
    ------
    InputError
        The class lacks what is needed, or another file has brought one of its name.
    """
    registry.add(kind_of(kind), kind)
    return kind


def forget_analysis(kind: type[AnalysisSection]) -> None:
    """The inverse of `register_analysis`."""
    registry.forget(kind)


class Analyses(dict[str, AnalysisSection]):
    """The analyses of a case by name, in the order of the file.

    Attributes
    ----------
    plugins : tuple of Plugin
        Files that brought laws and kinds; pickled first, so that whoever gets the analyses knows their classes.
    """

    def __init__(self, given: Mapping[str, AnalysisSection], plugins: Sequence[Any] = ()) -> None:
        super().__init__(given)
        self.plugins = tuple(plugins)

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.plugins, list(self.items()))

    def of(self, kind: type[Own]) -> dict[str, Own]:
        """Those of a class."""
        return {name: analysis for name, analysis in self.items() if isinstance(analysis, kind)}


def _unpickled(plugins: Sequence[Any], items: Sequence[tuple[str, AnalysisSection]]) -> Analyses:
    return Analyses(dict(items), plugins)
