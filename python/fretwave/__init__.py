"""fretwave: nonlinear dynamics of bladed disks with friction contact, in parallel."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import FretwaveError, InputError, NotConverged
from .mpi import alone as _alone

_alone.prepare()

if TYPE_CHECKING:
    from .analyses.parts.context import AnalysisContext, Outcome
    from .case.analysis import AnalysisSection, register_analysis
    from .case.build import build_model
    from .case.fields import key
    from .case.harmonic import HarmonicSection
    from .case.load import load_case
    from .case.reduce import reduce_case
    from .columns import Column
    from .commands.main import main
    from .cyclic.aerodynamics import Aerodynamics
    from .cyclic.around_wheel import around_wheel
    from .cyclic.faces import match_faces
    from .cyclic.reduction import SectorReduction, reduce_sector
    from .cyclic.sector import Sector
    from .cyclic.waves import WaveError
    from .cyclic.wheel_modes import deviations, most_alike, standing_wave, travelling_wave
    from .cyclic.wheel_shape import WheelShape
    from .hb.forced_response import ForcedResponse
    from .hb.harmonics import Harmonics, choose_harmonics
    from .hb.nonlinear_mode import NonlinearMode
    from .hb.reduction_error import NonlinearError, nonlinear_error
    from .importers.entries import Entries
    from .importers.formats import register_format
    from .model.contact import Contact
    from .model.frequency_error import FrequencyError
    from .model.law_info import LawInfo, Limit, ParameterInfo, Role
    from .model.laws import laws, register_law
    from .model.modal_damping import modal_damping
    from .model.model import Model
    from .model.modes import LinearMode, linear_modes
    from .model.pair_coordinates import on_pair_coordinates
    from .model.pairs import Pairs
    from .model.python_law import PythonLaw
    from .model.reduction import Reduction, reduce
    from .model.rest import Rest
    from .model.sectors import by_sector, rotation
    from .model.structure import Structure
    from .results.model_file import read_model, write_model
    from .results.reader import Run, open_run
    from .results.results import has_results, open_results
    from .solve.branch import Branch
    from .solve.continuation import Continuation
    from .solve.follow import follow
    from .solve.point import Point
    from .solve.preload import balanced, static_preload
    from .solve.steps import StepControl, WearControl
    from .solve.sweep import Sweep, sweep
    from .solve.transient import Transient
    from .solve.wear import Wear, WearPoint
    from .solve.wear_march import WearMarch, wear
    from .solve.worn_mode import WornMode
    from .units import UnitSystem, unit_system

#: Where each public name lives; loaded when first used, so that `fretwave --help` starts without PETSc.
_HOMES = {
    "solve.preload": ("balanced", "static_preload"),
    "analyses.parts.context": ("AnalysisContext", "Outcome"),
    "case.analysis": ("AnalysisSection", "register_analysis"),
    "case.build": ("build_model",),
    "case.harmonic": ("HarmonicSection",),
    "case.load": ("load_case",),
    "case.reduce": ("reduce_case",),
    "case.fields": ("key",),
    "columns": ("Column",),
    "commands.main": ("main",),
    "results.reader": ("Run", "open_run"),
    "results.results": ("has_results", "open_results"),
    "cyclic.aerodynamics": ("Aerodynamics",),
    "cyclic.around_wheel": ("around_wheel",),
    "model.pair_coordinates": ("on_pair_coordinates",),
    "model.pairs": ("Pairs",),
    "model.sectors": ("by_sector", "rotation"),
    "model.structure": ("Structure",),
    "results.model_file": ("read_model", "write_model"),
    "solve.branch": ("Branch",),
    "solve.follow": ("follow",),
    "solve.continuation": ("Continuation",),
    "solve.point": ("Point",),
    "solve.steps": ("StepControl", "WearControl"),
    "cyclic.sector": ("Sector",),
    "cyclic.reduction": ("SectorReduction", "reduce_sector"),
    "cyclic.waves": ("WaveError",),
    "cyclic.wheel_modes": ("deviations", "most_alike", "standing_wave", "travelling_wave"),
    "cyclic.wheel_shape": ("WheelShape",),
    "model.rest": ("Rest",),
    "solve.sweep": ("Sweep", "sweep"),
    "solve.wear_march": ("WearMarch", "wear"),
    "cyclic.faces": ("match_faces",),
    "importers.entries": ("Entries",),
    "importers.formats": ("register_format",),
    "model.law_info": ("LawInfo", "Limit", "ParameterInfo", "Role"),
    "model.python_law": ("PythonLaw",),
    "model.laws": ("laws", "register_law"),
    "model.contact": ("Contact",),
    "model.modal_damping": ("modal_damping",),
    "model.model": ("Model",),
    "model.modes": ("LinearMode", "linear_modes"),
    "hb.forced_response": ("ForcedResponse",),
    "hb.harmonics": ("Harmonics", "choose_harmonics"),
    "hb.nonlinear_mode": ("NonlinearMode",),
    "model.frequency_error": ("FrequencyError",),
    "model.reduction": ("Reduction", "reduce"),
    "hb.reduction_error": ("NonlinearError", "nonlinear_error"),
    "solve.transient": ("Transient",),
    "solve.wear": ("Wear", "WearPoint"),
    "solve.worn_mode": ("WornMode",),
    "units": ("UnitSystem", "unit_system"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Aerodynamics",
    "AnalysisContext",
    "AnalysisSection",
    "Branch",
    "Column",
    "Contact",
    "Continuation",
    "Entries",
    "ForcedResponse",
    "FrequencyError",
    "FretwaveError",
    "HarmonicSection",
    "Harmonics",
    "InputError",
    "LawInfo",
    "Limit",
    "LinearMode",
    "Model",
    "NonlinearError",
    "NonlinearMode",
    "NotConverged",
    "Outcome",
    "Pairs",
    "ParameterInfo",
    "Point",
    "PythonLaw",
    "Reduction",
    "Rest",
    "Role",
    "Run",
    "Sector",
    "SectorReduction",
    "StepControl",
    "Structure",
    "Sweep",
    "Transient",
    "UnitSystem",
    "WaveError",
    "Wear",
    "WearControl",
    "WearMarch",
    "WearPoint",
    "WheelShape",
    "WornMode",
    "around_wheel",
    "balanced",
    "build_model",
    "by_sector",
    "choose_harmonics",
    "deviations",
    "follow",
    "has_results",
    "key",
    "laws",
    "linear_modes",
    "load_case",
    "main",
    "match_faces",
    "modal_damping",
    "most_alike",
    "nonlinear_error",
    "on_pair_coordinates",
    "open_results",
    "open_run",
    "read_model",
    "reduce",
    "reduce_case",
    "reduce_sector",
    "register_analysis",
    "register_format",
    "register_law",
    "rotation",
    "standing_wave",
    "static_preload",
    "sweep",
    "travelling_wave",
    "unit_system",
    "wear",
    "write_model",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("fretwave")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'fretwave' has no attribute '{name}'")
    value = getattr(import_module(f".{_HOME_OF[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, "__version__", *(name for name in globals() if name.startswith("__"))})
