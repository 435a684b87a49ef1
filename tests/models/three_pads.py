"""Three masses on springs, a contact pair under each: one sticks under (40, 40) N, one slips, one is lifted off.

Nothing couples them, and every stiffness is linear where a pair sticks: the states at rest are known in closed form.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp

from fretwave import Pairs, Structure

#: of the ground springs along x (normal), y, z, and of the contact in every direction [N/m]
SPRINGS, CONTACT = np.array([1.0e6, 1.2e6, 1.5e6]), 1e6
FRICTION = 0.5
#: forces (N, T, T) that the first pair carries when it sticks, and distance at which the last one hangs [m]
STUCK, LIFTED = np.array([100.0, 40.0, 40.0]), 5e-5


def build(**_: Any) -> Structure:
    """The load is what gives these forces: P = f (1 + k / contact) where a pair sticks."""
    held = 1 + SPRINGS / CONTACT
    slides = np.array([100.0, 80.0, 0.0])  # above the 50 N that friction bears
    load = np.concatenate([STUCK * held, slides * held, [-LIFTED * SPRINGS[0], 0.0, 0.0]])
    places = np.column_stack([np.arange(3) * 0.1, np.zeros((3, 2))])
    pads = Pairs(
        B=sp.identity(9, format="csr"),
        points=places,
        frames=np.tile(np.eye(3), (3, 1, 1)),
        faces=["pads"] * 3,
        positions=places[:, :2],
    )
    return Structure(
        M=sp.diags(np.repeat([4.0, 1.0, 1.0], 3)),
        K=sp.diags(np.tile(SPRINGS, 3)),
        dofs={"across": 1},
        pairs={"pads": pads},
        loads={"press": load},
        coordinates=places,
    )
