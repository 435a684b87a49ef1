"""The static state that a motion is about.

A contact with friction remembers: where its sliders stand when nothing vibrates decides about what state the motion
goes on, and under the same load there are many. `fretwave.static_preload` finds the one that a load brings about from
sliders at zero, or from others; a `Rest` made by hand is as good.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Array


@dataclass(frozen=True)
class Rest:
    """A static state, as `fretwave.static_preload` and `fretwave.balanced` find it.

    Attributes
    ----------
    displacement : (n_dof,) [length]
        On every rank.
    load : (n_dof,) [force]
        The static load that it balances, contact included.
    sliders : dict, optional
        Contact name -> (n_pairs, n_tangents) [length], where the sliders of contacts with a memory stand, in directions
        of B's tangents: the tangential force of a pair that sticks is kt (u - w). Without it those that the
        displacement brings about from zero, in one step.
    stick, slip, open : float
        Shares of the pairs.
    imbalance : float
        What the solver left of the load, relative to it.
    contacts : list of dict, on rank 0
        Relative displacement u and force f (components, n_pairs) of each contact, and what its law says of each
        pair: status (stick 0, slip 1, open 2) and gap [length].
    """

    displacement: Array
    load: Array
    sliders: Mapping[str, Array] | None = None
    stick: float = np.nan
    slip: float = np.nan
    open: float = np.nan
    imbalance: float = 0.0
    contacts: list[dict[str, Array]] | None = None

    def __repr__(self) -> str:
        shares = f"{self.stick:.3g} stick, {self.slip:.3g} slip, {self.open:.3g} open"
        return f"Rest({len(self.displacement)} dofs, of the pairs {shares}, imbalance {self.imbalance:.1e})"
