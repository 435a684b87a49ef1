#!/usr/bin/env python3
"""True errors of harmonic balance: the paper's oscillator with a Jenkins element against the exact oracle.

    OMP_NUM_THREADS=1 .venv/bin/python cases/accuracy/study.py [--out FOLDER]

from the top folder prints the tables of README.md and draws its picture. The error of a point has two parts,

    found (H, N_t) - exact  =  [continuous time (H) - exact]  +  [found (H, N_t) - continuous time (H)],

of the harmonics left out, and of how the contact force is had from them: nothing is sampled, so the second is
rounding at any N_t. The oracle (tests/oracle) has both ends and the middle.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Optional

import numpy as np
from mpi4py import MPI

import fretwave as fw

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests"))

from oracle import Jenkins, OracleError, SeriesMotion, System, forced_orbit, mode_orbit, series_motion  # noqa: E402

M, K = np.diag([1.0, 0.02]), np.array([[640.0, -40.0], [-40.0, 40.0]])
B, KT, LIMIT = np.array([0.0, 1.0]), 400.0, 5.0
HARMONICS = [1, 3, 5, 9, 21]
#: of harmonic balance for the picture alone, and in continuous time, to see the order
DRAWN = [*HARMONICS, 41, 81]
LIMITS = [*DRAWN, 161, 321]
#: samples, in multiples of the least that H harmonics allow
SAMPLES = [1, 16]
#: of the continuous-time series that stands for the complex mode: its own error falls below 1e-11
MANY = 801
PHASE = 0.3
#: relative distance from which Newton starts
BESIDE = 1e-6
#: amplitudes of m1 [m], and what the damper does there
MODES = {2.0: "full slip", 0.5: "full slip", 0.2: "most damped", 0.155: "partial slip", 0.145: "partial slip",
         0.137: "first slip", 0.13: "stuck"}  # fmt: skip
#: force on m1 [N] and its angular frequency [rad/s]
FORCED = {(9.0, 24.2): "full slip", (8.5, 24.5): "full slip", (8.5, 25.2): "most damped", (7.0, 24.5): "partial slip",
          (5.0, 24.5): "first slip", (3.0, 24.5): "stuck"}  # fmt: skip


@dataclass
class Point:
    """A motion: its exact value (lambda, or q_1 of m1), that of each H in continuous time, and those found."""

    method: str
    where: Any
    regime: str
    exact: complex
    limits: dict[int, complex] = field(default_factory=dict)
    found: dict[tuple[int, int], complex] = field(default_factory=dict)

    def error(self, H: int, samples: Optional[int]) -> float:
        """Of lambda or q_1, relative; `samples` None: in continuous time."""
        value = self.limits.get(H) if samples is None else self.found.get((H, samples))
        return np.nan if value is None else abs(value - self.exact) / abs(self.exact)

    def sampling(self, H: int, samples: int) -> float:
        """Distance of what is found from continuous time, relative."""
        if (H, samples) not in self.found:
            return np.nan
        return abs(self.found[H, samples] - self.limits[H]) / abs(self.exact)

    def parts(self, H: int, samples: int) -> tuple[float, float]:
        """Relative errors of omega0 and zeta; of a response those of amplitude and phase [rad]."""
        value = self.found.get((H, samples), np.nan)
        if self.method == "forced":
            return abs(value) / abs(self.exact) - 1, float(np.angle(value / self.exact))
        zeta = -value.real / abs(value)
        exact = -self.exact.real / abs(self.exact)
        return abs(value) / abs(self.exact) - 1, zeta / exact - 1 if exact > 1e-12 else np.nan


def system(level: float = 0.0, omega: float = 1.0) -> System:
    """The oscillator as the oracle takes it."""
    return System(M, np.zeros((2, 2)), K, [Jenkins(B, KT, LIMIT)], np.array([level, 0.0]), omega=omega)


def lambda_of(method: str, omega0: float, zeta: float) -> complex:
    """- zeta w0 + i w0 sqrt(1 - zeta^2)."""
    return omega0 * complex(-zeta, np.sqrt(1 - zeta**2))


class Branches:
    """First guesses: where fretwave's branches pass a point. What is exact does not depend on them."""

    def __init__(self, model: fw.Model) -> None:
        self.model, self.start = model, fw.linear_modes(model, 1, "stuck")[0]
        self._kept: dict[Any, tuple[Any, fw.Branch]] = {}

    def problem(self, method: str, level: float, H: int, samples: int) -> Any:
        harmonics = fw.choose_harmonics(self.model, H, samples)
        if method == "forced":
            force = {1: np.array([1.0, 0.0])}
            return fw.ForcedResponse(self.model, harmonics, force, level, 0, self.start)
        return fw.NonlinearMode(self.model, harmonics, method=method, dof=0, start=self.start)

    def motion(self, method: str, where: Any, H: int) -> Optional[SeriesMotion]:
        """The first passage of a branch with 1024 samples."""
        level, at = where if method == "forced" else (0.0, where)
        if (method, level, H) not in self._kept:
            problem = self.problem(method, level, H, 1024)
            begin, end = (26.5, 24.18) if method == "forced" else (0.1, 3.0)
            self._kept[method, level, H] = problem, fw.follow(problem, begin, end)
        problem, branch = self._kept[method, level, H]
        passages = branch.at(at)
        if not len(passages["place"]):
            print(f"  {method} {where}, H = {H}: the branch does not pass ({branch.reason})")
            return None
        Q = branch.coefficients(float(passages["place"][0]))
        q = np.zeros((2, H + 1), complex)
        for k, n in enumerate(problem.harmonics.orders):
            q[:, n] = Q[:, 2 * k] - 1j * Q[:, 2 * k + 1]
        if method == "forced":
            return SeriesMotion(system(level, at), method, q, 1j * at, 0.0, 0.0, [])
        w0, zeta = float(passages["omega0"][0]), float(passages["zeta"][0])
        exponent = lambda_of(method, w0, zeta) if method == "CNM" else 1j * w0
        return SeriesMotion(system(), method, q, exponent, 2 * zeta * w0, 0.0, [])


def value_of(motion: SeriesMotion) -> complex:
    """lambda, or q_1 of m1."""
    return motion.q[0, 1] if motion.method == "forced" else lambda_of(motion.method, motion.omega0, motion.zeta)


def in_continuous_time(guess: SeriesMotion, where: Any, H: int) -> Optional[SeriesMotion]:
    amplitude = 0.0 if guess.method == "forced" else where
    try:
        return series_motion(guess.system, guess.method, H, amplitude=amplitude, guess=guess)
    except OracleError as error:
        print(f"  {guess.method} {where}, H = {H}: {error}")
        return None


def exact(guess: SeriesMotion, where: Any) -> complex:
    """By shooting; the complex mode, which has no differential equation, by many harmonics in continuous time."""
    if guess.method == "CNM":
        return value_of(series_motion(guess.system, "CNM", MANY, amplitude=where, guess=guess))
    if guess.method == "EPMC":
        orbit = mode_orbit(guess.system, 0, where, guess.omega0, guess.zeta, guess.state(PHASE), phase=PHASE)
        return lambda_of("EPMC", orbit.omega0, orbit.zeta)
    response = forced_orbit(guess.system)
    return response.harmonics(response.system.displacement(0), 1)[1]


def unknowns(problem: Any, motion: SeriesMotion, scale: float, scalars: list[float]) -> Any:
    """y of a motion: Q / scale dof by dof, then the scalars."""
    Q = np.array([[(q[n].real, -q[n].imag) for n in problem.harmonics.orders] for q in motion.q]).ravel() / scale
    y = problem.initial(motion.omega0)
    # beside the solution, so that Newton's steps decide where it ends and not its tolerance
    y.setArray(np.concatenate([Q * (1 + BESIDE), [s * (1 + BESIDE) for s in scalars[:-1]], scalars[-1:]]))
    return y


def solve(branches: Branches, point: Point, motion: SeriesMotion, H: int, samples: int) -> Optional[complex]:
    """Harmonic balance as users have it: Newton at the point's parameter, from the motion in continuous time."""
    level, at = point.where if point.method == "forced" else (0.0, point.where)
    problem, reference = branches.problem(point.method, level, H, samples), branches.start.omega
    if point.method == "forced":
        y = unknowns(problem, motion, problem.core.reference_amplitude, [at / reference])
    else:
        beta = motion.zeta * motion.omega0
        w = motion.lambda_.imag  # w0 of EPMC
        y = unknowns(problem, motion, at, [beta / reference, w / reference, np.log(at)])
    first = next(iter(fw.Continuation(problem, y, (at / 2, at * 2), way=True)), None)
    if first is None:
        print(f"  {point.method} {point.where}: Newton fails with H = {H}, N_t = {samples}")
        return None
    state = problem.state(first.y)
    if point.method == "forced":
        return state["amplitude"] * np.exp(1j * state["phase"])
    return lambda_of(point.method, state["omega0"], state["zeta"])


def measure() -> list[Point]:
    """All points, with all H and N_t."""
    damper = fw.Contact("jenkins", [B], {"tangential_stiffness": KT, "friction_limit": LIMIT}, "damper")
    branches = Branches(fw.Model(M, K, contacts=[damper], comm=MPI.COMM_WORLD))
    asked = [("forced", FORCED), ("EPMC", MODES), ("CNM", MODES)]
    return [measured(branches, method, *item) for method, points in asked for item in points.items()]


def measured(branches: Branches, method: str, where: Any, regime: str) -> Point:
    """One point."""
    guess = branches.motion(method, where, max(HARMONICS))
    assert guess is not None
    fine = in_continuous_time(guess, where, max(HARMONICS))
    assert fine is not None
    point = Point(method, where, regime, exact(fine, where))
    for H in LIMITS:
        guess = branches.motion(method, where, H) if max(HARMONICS) > H else fine
        motion = None if guess is None else in_continuous_time(guess, where, H)
        if motion is None:
            continue
        point.limits[H] = value_of(motion)
        for samples in [n * (2 * H + 2) for n in SAMPLES if H in DRAWN]:
            value = solve(branches, point, motion, H, samples)
            if value is not None:
                point.found[H, samples] = value
    return point


def order(x: list[int], y: list[float]) -> float:
    """Least-squares slope, double logarithmic, of what is there and above rounding."""
    use = [(a, b) for a, b in zip(x, y) if np.isfinite(b) and b > 1e-13]
    if len(use) < 3:
        return np.nan
    a, b = np.log(np.array(use)).T
    return float(np.polyfit(a, b, 1)[0])


def number(value: float) -> str:
    return "-" if not np.isfinite(value) else "0" if abs(value) < 5e-14 else f"{value:.1e}"


def table(points: list[Point], columns: list[str], row: Any) -> None:
    print("\n| motion | regime | " + " | ".join(columns) + " |")
    print("|---|---|" + "---:|" * len(columns))
    for point in points:
        name = f"{point.where} m" if point.method != "forced" else "{} N, {} rad/s".format(*point.where)
        print(f"| {point.method} {name} | {point.regime} | " + " | ".join(row(point)) + " |")


def report(points: list[Point]) -> None:
    """The README's tables."""
    print("\nHarmonics left out (continuous time):")
    far = LIMITS[4:]
    table(points, [f"{H}" for H in LIMITS] + ["order from 21"],
          lambda p: [number(p.error(H, None)) for H in LIMITS]
          + [f"{order(far, [p.error(H, None) for H in far]):.1f}"])  # fmt: skip
    far = max(point.sampling(H, least(H)) for point in points for H in DRAWN if H in point.limits)
    more = max(change(point) for point in points)
    print(f"\nFound with 2 H + 2 samples, at most {far:.1e} from continuous time; 16 times as many change {more:.1e}.")
    print("\nomega0 and zeta, relative (responses: amplitude, and phase in rad):")
    table(points, [f"H = {H}" for H in DRAWN],
          lambda p: [" / ".join(number(v) for v in p.parts(H, least(H))) for H in DRAWN])  # fmt: skip


def least(H: int) -> int:
    """Samples."""
    return 2 * H + 2


def change(point: Point) -> float:
    """The largest of all H that more samples make, relative."""
    found = [(point.found.get((H, least(H))), point.found.get((H, 16 * least(H)))) for H in DRAWN]
    return max(abs(a - b) / abs(point.exact) for a, b in found if a is not None and b is not None)


def draw(points: list[Point], path: Path) -> None:
    """Error of lambda against H, at three amplitudes."""
    from fretwave.plots import style

    chosen = [p for p in points if p.method == "CNM" and p.where in (0.137, 0.2, 2.0)][::-1]
    with style.rules():
        figure, axes = style.new_figure(4.6, columns=3, sharey=True)
        for plane, point in zip(axes, chosen):
            exact = [point.error(H, None) for H in LIMITS]
            plane.loglog(LIMITS, exact, "k--", label="continuous time", lw=1.2, zorder=3)
            found = [point.error(H, least(H)) for H in DRAWN]
            plane.loglog(DRAWN, found, "o", color=style.PALETTE[0], label="found with 2H + 2 samples", ms=5)
            guide = np.array([21.0, 321.0])
            plane.loglog(guide, 20 * exact[4] * (guide / 21) ** -4, color=style.GREY, lw=1)
            plane.text(90, 20 * exact[4] * (90 / 21) ** -4, " $H^{-4}$", color=style.GREY)
            plane.set(title=f"{point.regime}, a = {point.where:g} m", xlabel="highest harmonic H")
            plane.set_xticks([1, 3, 9, 21, 81, 321], ["1", "3", "9", "21", "81", "321"])
            plane.minorticks_off()
        axes[0].set_ylabel("true relative error of λ")
        style.legend_outside(figure, axes[0], columns=2)
        figure.savefig(path, dpi=style.DPI)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE / "pictures", help="folder of the picture")
    options = parser.parse_args()
    began = time.process_time()
    points = measure()
    report(points)
    options.out.mkdir(parents=True, exist_ok=True)
    draw(points, options.out / "error_by_harmonics.png")
    print(f"\n{time.process_time() - began:.0f} s of processor time")


if __name__ == "__main__":
    main()
