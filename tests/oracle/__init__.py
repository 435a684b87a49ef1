"""Exact periodic motions with piecewise-linear contact: the truth that the solver's errors are measured against.

Event-driven: between events the equations are linear and solved by their Taylor series, events are zeros of polynomials
found to rounding, none is missed (`pieces`), and the period is closed by Newton with the exact monodromy. NumPy and
SciPy only; not one line of the solver is used.

    system = System(M, C, K, [Jenkins(B, kt, limit)], P, omega=w)   # or Coulomb, Unilateral, LoadedJenkins
    orbit = forced_orbit(system)                                    # .defect, .multipliers, .events, .work()
    orbit.harmonics(system.displacement(0), 21)                     # q_n = Qc_n - i Qs_n, integrated exactly
    mode = mode_orbit(system, dof, a, omega0, zeta, state)          # EPMC: .omega0, .zeta
    motion = series_motion(system, "CNM", 601, dof, a)              # what has no differential equation: .lambda_
    orbit = orbit_3d(Block(M, C, K, [Pair(B, kn, kt, mu, N0)], P, p, w))   # friction on a circle
    F = forces(Q, kn, kt, mu, N0)                                   # the same under a given motion, by its harmonics
"""

from .circle import Block, Orbit3d, Pair, orbit_3d
from .flow import Event, Flow, OracleError
from .friction_3d import forces
from .laws import Coulomb, Jenkins, LoadedJenkins, Unilateral
from .mode import ModeOrbit, mode_orbit
from .orbit import Orbit, forced_orbit
from .period import Hysteresis, hysteresis
from .series import SeriesMotion, series_motion
from .system import System

__all__ = [
    "Block",
    "Coulomb",
    "Event",
    "Flow",
    "Hysteresis",
    "Jenkins",
    "LoadedJenkins",
    "ModeOrbit",
    "OracleError",
    "Orbit",
    "Orbit3d",
    "Pair",
    "SeriesMotion",
    "System",
    "Unilateral",
    "forced_orbit",
    "forces",
    "hysteresis",
    "mode_orbit",
    "orbit_3d",
    "series_motion",
]
