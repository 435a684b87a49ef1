"""Right cases with the keys that those of `bases.py` have not, from `right`, and what they name beside them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomllib
from models import built_chain

import fretwave as fw

RIGHT = Path(__file__).parent / "right"
MODELS = Path(built_chain.__file__).parent
#: Springs of the sector's dofs from ground, and between them [N/m].
DOFS = ["lx", "ly", "lz", "disk", "blade", "tip", "hx", "hy", "hz"]
GROUND = (20.0, 30.0, 40.0, 300.0, 0.0, 50.0, 20.0, 30.0, 40.0)
SPRINGS = (("lx", "disk", 300.0), ("ly", "disk", 50.0), ("disk", "hx", 300.0), ("disk", "hy", 20.0))
BLADE = (("disk", "blade", 200.0), ("blade", "tip", 100.0))
SPINNING = """
import numpy as np
import fretwave as fw

def build():
    K = np.array([[500.0, -100.0], [-100.0, 300.0]])
    return fw.Structure(np.eye(2), K, dofs={"tip": 0}, parts={"spin": np.diag([0.2, 0.1])})
"""


def read(name: str) -> dict[str, Any]:
    """A case of the folder."""
    return tomllib.loads((RIGHT / f"{name}.toml").read_text(encoding="utf-8"))


def sector() -> dict[str, Any]:
    """A mass on each face, a disk between them that carries a blade and its tip."""
    case, K = read("sector"), np.diag(GROUND)
    for first, second, stiffness in (*SPRINGS, *BLADE):
        row = np.array([(dof == second) - float(dof == first) for dof in DOFS])
        K += stiffness * np.outer(row, row)
    M = np.diag([0.1, 0.1, 0.1, 1.0, 0.5, 0.2, 0.1, 0.1, 0.1])
    case["model"].update(dofs=list(DOFS), M=M.tolist(), K=K.tolist())
    return case


def prepare(folder: Path) -> None:
    """Builders, a model file and plug-ins, from the suite's models."""
    shutil.copy(MODELS / "built_sector.py", folder / "solid" / "model.py")
    for name in ("toy_law.py", "toy_analysis.py"):
        shutil.copy(MODELS / name, folder / "filed" / name)
    chain = built_chain.build()
    pads = {"pads": replace(chain.pairs["pads"], parameters={})}
    fw.write_model(folder / "filed" / "model.h5", replace(chain, loads={}, pairs=pads, coordinates=None))
    (folder / "spinning" / "model.py").write_text(SPINNING)


SHORT: dict[str, Callable[[], dict[str, Any]]] = {
    **{name: partial(read, name) for name in ("speed", "solid", "filed", "spinning")},
    "sector": sector,
}
