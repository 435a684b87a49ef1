"""reduction.h5: which static loads it keeps the displacement of, and what that costs."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.chain_case import BUILDER, CHAIN, FORCED

from fretwave.model import residual_statics

pytestmark = pytest.mark.ranks(1)
#: Beside the weight a load on the first pad, whose dofs are kept, and one inside that no preload names.
LOADS = 'loads={"weight": weight, "pad": np.eye(n)[0], "spare": np.eye(n)[3]},'
#: Loads that act, and columns of the factorisations that they cost.
ACTING = {
    "one is on kept dofs alone": (["weight", "pad"], [1]),
    "all are": (["pad"], []),
    "of two analyses": (["weight", "spare"], [2]),
    "the pairs' own alone": ([], []),
}


@pytest.mark.parametrize("acting", ACTING)
def test_loads_that_act_are_kept_by_one_factorisation(acting: str, tmp_path: Path, monkeypatch) -> None:
    made, original = [], residual_statics._solved
    monkeypatch.setattr(residual_statics, "_solved", lambda A, b: made.append(b.shape[1]) or original(A, b))
    names, columns = ACTING[acting]
    text = BUILDER.read_text()
    assert 'loads={"weight": weight},' in text
    (tmp_path / "model.py").write_text(text.replace('loads={"weight": weight},', LOADS))
    own = f"preload = {{ loads = {names[1:]} }}\n".replace("'", '"') if acting == "of two analyses" else ""
    case = CHAIN.replace("modes = 12", "modes = 2") + FORCED + "time_points = 0\n"
    case = case if names else case.replace("pair_loads = false", "pair_loads = true")
    case = case.replace('loads = ["weight"]', f"loads = {names[:1] if own else names}".replace("'", '"'))
    (tmp_path / "case.toml").write_text(case + (f'[[analysis]]\nname = "rest"\ntype = "static"\n{own}' if own else ""))
    words = ("run", tmp_path / "case.toml", "--only", "forced", "--no-plots", "-q", "--out", tmp_path / "run")
    assert call(*words) == 0
    assert made == columns
    with h5py.File(tmp_path / "run" / "reduction.h5") as file:
        kept = [name.decode() for name in file["load"][()]] if "load" in file else []
        assert kept == names
        if names:
            moves = np.abs(file["beyond"][()]).max(axis=0) > 0
            assert moves.tolist() == [name != "pad" for name in names]
