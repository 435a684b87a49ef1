"""A wheel of masses on ground springs (1 kg, 1 N/m), a slider of 1 N/m between each and the next, and the flow."""

from __future__ import annotations

import numpy as np

SECTORS, OMEGA, LIMIT = 5, 1.7, 1.0


def wheel_of(influence: dict[int, complex], damper: float = 0.0, spin: float = 0.0, dof: str = "") -> str:
    """TOML of the model; `damper` holds each mass to the ground, `spin` [N s/m] is gyroscopic between neighbours.

    The flow acts on one dof, if it is named.
    """
    flow = ", ".join(f"{k} = [{L.real}, {L.imag}]" for k, L in influence.items())
    C = f"C = [[{damper}, {spin}], [{-spin}, 0.0]]\n" if damper or spin else ""
    place = f'dof = "{dof}"\n' if dof else ""
    return f"""
[model]
dofs = ["mass", "next"]
M = [[1.0, 0.0], [0.0, 0.0]]
K = [[1.0, 0.0], [0.0, 0.0]]
{C}sectors = {SECTORS}
low = ["mass"]
high = ["next"]

[[contact]]
name = "between"
law = "jenkins"
pairs = [["mass", "next"]]
tangential_stiffness = 1.0
friction_limit = {LIMIT}

[aerodynamics]
frequency = {OMEGA / (2 * np.pi)!r}
{place}influence = {{ {flow} }}
"""


def case_of(influence: dict[int, complex], order: int, keys: str = "", damper: float = 0.0) -> str:
    """TOML of a response to an engine order, with further keys of the analysis."""
    return (
        wheel_of(influence, damper)
        + f"""
[[analysis]]
name = "forced"
type = "forced"
engine_order = {order}
{keys}
harmonics = 1
force = {{ mass = 1.0 }}
levels = [1e-4, 10.0]
frequency = [0.2, 0.3]
observe = "mass"
"""
    )
