"""The chain on two pads in any consistent system: one joint, its numbers in SI or in millimetres and tonnes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import scipy.sparse as sp

from fretwave import Pairs, Structure


@dataclass(frozen=True)
class Scale:
    """Of SI's numbers in another system: its numbers are SI's times these."""

    length: float
    mass: float

    @property
    def force(self) -> float:
        return self.mass * self.length

    @property
    def stiffness(self) -> float:
        return self.mass

    def of(self, unit: str) -> float:
        """Factor by which a number in this unit becomes SI's: every unit that a table can have."""
        symbols = {
            "mm": self.length,
            "N": self.force,
            "mJ": self.force * self.length,
            "MPa": self.force / self.length**2,
        }
        symbols |= {"sqrt(t)": self.mass**0.5, "sqrt(t) mm": self.mass**0.5 * self.length}
        symbols |= {"s": 1.0, "rad": 1.0, "Hz": 1.0, "1": 1.0, "-": 1.0, "": 1.0}
        top, *below = unit.split("/")
        name, _, power = top.partition("^")
        factor = symbols[name] ** int(power or 1)
        for one in below:
            factor /= symbols[one]
        return 1 / factor


SCALES = {"m-kg-s": Scale(1.0, 1.0), "mm-t-s": Scale(1e3, 1e-3)}

BUILDER = """
from models.joint_in_units import in_system

def build(system: str = "m-kg-s", declares: bool = False):
    return in_system(system, declares)
"""


def in_system(system: str, declares: bool) -> Structure:
    """`built_chain` in a system; declares: it says so itself."""
    from models.built_chain import build

    s, given = SCALES[system], build()
    pads = given.pairs["pads"]
    own: dict[str, Any] = {
        "normal_stiffness": pads.parameters["normal_stiffness"] * s.stiffness,
        "normal_load": pads.parameters["normal_load"] * s.force,
    }
    return Structure(
        M=sp.csr_matrix(given.M * s.mass),
        K=sp.csr_matrix(given.K * s.stiffness),
        dofs=given.dofs,
        pairs={
            "pads": Pairs(
                B=pads.B,
                parameters=own,
                areas=pads.areas * s.length**2,
                points=pads.points * s.length,
                frames=pads.frames,
                faces=pads.faces,
                positions=pads.positions * s.length,
            )
        },
        loads={"weight": given.loads["weight"] * s.force},
        coordinates=given.coordinates * s.length,
        units=system if declares else None,
    )


def write_case(folder: Path, system: str, declares: bool = False) -> Path:
    """The case file with its builder: rest, mode, forced response, wear, decay and a sweep."""
    s = SCALES[system]
    folder.mkdir(exist_ok=True)
    (folder / "model.py").write_text(BUILDER)
    units = "" if declares or system == "m-kg-s" else f'units = "{system}"\n'
    (folder / "case.toml").write_text(
        f"""
title = "Chain on two pads in {system}"

[model]
builder = "model.py"
{units}mass_damping = 2.0
options = {{ system = "{system}", declares = {str(declares).lower()} }}

[preload]
pair_loads = false
loads = ["weight"]

[[contact]]
name = "pads"
law = "coulomb_3d"
friction_coefficient = 0.4
tangential_stiffness_per_area = {2e10 * s.stiffness / s.length**2:.17g}

[[analysis]]
name = "rest"
type = "static"

[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 128
normalise = "tip"
amplitude = [{2e-7 * s.length:.17g}, {4e-6 * s.length:.17g}]
report_at = [{2e-6 * s.length:.17g}]

[[analysis]]
name = "coordinate"
type = "mode"
harmonics = 3
samples = 128
normalise = {{ mode = 1 }}
amplitude = [{1e-6 * s.length * s.mass**0.5:.17g}, {1e-5 * s.length * s.mass**0.5:.17g}]

[[analysis]]
name = "forced"
type = "forced"
backbone = ["mode"]
harmonics = 3
samples = 128
force = {{ tip = {0.05 * s.force:.17g} }}
levels = [5.0, 20.0]
frequency = [190.0, 225.0]
observe = "tip"

[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [{2.5e-6 * s.length:.17g}]
cycles = 4.0
coefficient = {1e-13 / s.stiffness * s.length:.17g}
report_at = [2.0]

[[analysis]]
name = "over_friction"
type = "sweep"
of = "mode"
over = {{ "contact.pads.friction_coefficient" = [0.3, 0.5] }}
"""
    )
    return folder / "case.toml"
