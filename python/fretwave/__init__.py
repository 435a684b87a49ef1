"""fretwave: nonlinear dynamics of bladed disks with friction contact, in parallel."""

from __future__ import annotations

import os
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from .errors import FretwaveError, InputError, NotConverged

# Without mpirun Open MPI starts a daemon for a process that might spawn others, which fretwave never does. Where
# several begin and end at once that daemon may get lost, and MPI_Init waits for it for ever.
os.environ.setdefault("OMPI_MCA_ess_singleton_isolated", "1")

if TYPE_CHECKING:
    from .aerodynamics import Aerodynamics
    from .built import BuiltContact, BuiltModel
    from .contact_laws import LawInfo, Limit, ParameterInfo, PythonLaw, Role, laws, register_law
    from .continuation import Continuation, Point, StepControl
    from .cyclic import Sector
    from .cyclic_reduction import SectorReduction, reduce_sector
    from .cyclic_waves import WaveError
    from .faces import match_faces
    from .model import Contact, Model
    from .modes import LinearMode, linear_modes
    from .plots.data import Run, open_run
    from .problems import ForcedResponse, Harmonics, NonlinearMode, choose_harmonics
    from .reduction import FrequencyError, Reduction, reduce
    from .reduction_error import NonlinearError, nonlinear_error
    from .solve.branch import Branch
    from .solve.follow import follow
    from .transient import Transient
    from .wear import Wear, WearControl, WearPoint
    from .worn_mode import WornMode

#: Where each public name lives; loaded when first used, so that `fretwave --help` starts without PETSc.
_HOMES = {
    "aerodynamics": ("Aerodynamics",),
    "built": ("BuiltContact", "BuiltModel"),
    "continuation": ("Continuation", "Point", "StepControl"),
    "cyclic": ("Sector",),
    "cyclic_reduction": ("SectorReduction", "reduce_sector"),
    "cyclic_waves": ("WaveError",),
    "faces": ("match_faces",),
    "contact_laws": ("LawInfo", "Limit", "ParameterInfo", "PythonLaw", "Role", "laws", "register_law"),
    "model": ("Contact", "Model"),
    "modes": ("LinearMode", "linear_modes"),
    "plots.data": ("Run", "open_run"),
    "problems": ("ForcedResponse", "Harmonics", "NonlinearMode", "choose_harmonics"),
    "reduction": ("FrequencyError", "Reduction", "reduce"),
    "reduction_error": ("NonlinearError", "nonlinear_error"),
    "solve.branch": ("Branch",),
    "solve.follow": ("follow",),
    "transient": ("Transient",),
    "wear": ("Wear", "WearControl", "WearPoint"),
    "worn_mode": ("WornMode",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Aerodynamics",
    "Branch",
    "BuiltContact",
    "BuiltModel",
    "Contact",
    "Continuation",
    "ForcedResponse",
    "FrequencyError",
    "FretwaveError",
    "Harmonics",
    "InputError",
    "LawInfo",
    "Limit",
    "LinearMode",
    "Model",
    "NonlinearError",
    "NonlinearMode",
    "NotConverged",
    "ParameterInfo",
    "Point",
    "PythonLaw",
    "Reduction",
    "Role",
    "Run",
    "Sector",
    "SectorReduction",
    "StepControl",
    "Transient",
    "WaveError",
    "Wear",
    "WearControl",
    "WearPoint",
    "WornMode",
    "choose_harmonics",
    "follow",
    "laws",
    "linear_modes",
    "match_faces",
    "nonlinear_error",
    "open_run",
    "reduce",
    "reduce_sector",
    "register_law",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("fretwave")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'fretwave' has no attribute '{name}'")
    value = getattr(import_module(f".{_HOME_OF[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__, "__version__"])
