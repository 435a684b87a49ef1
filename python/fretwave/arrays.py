"""Types of the arrays that pass between functions, said once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
#: Numbers from outside: nodes, labels, entries of files.
IntArray = npt.NDArray[np.int64]
#: Places in arrays.
Indices = npt.NDArray[np.intp]
AnyArray = npt.NDArray[Any]
