"""Pictures of contact pairs on their faces, of laws with and without a normal direction."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call

from fretwave.plots import faces
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

BUILDER = """
import numpy as np
from fretwave import Pairs, Structure

def build():
    B = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    places = np.array([[0.0, 0.0], [1.0, 0.0]])
    pads = Pairs(B=B, components=1, points=np.column_stack([places, [0.0, 0.0]]), positions=places, faces=["f", "f"])
    K = np.array([[300.0, -100.0, 0.0], [-100.0, 180.0, -80.0], [0.0, -80.0, 80.0]])
    return Structure(np.eye(3), K, dofs={"x": 0}, pairs={"pads": pads}, loads={"pull": np.array([0.0, 10.0, 3.0])})
"""
CASE = """
[model]
builder = "model.py"

[preload]
loads = ["pull"]

[[contact]]
name = "pads"
{law}

[[analysis]]
name = "static"
type = "static"

[[analysis]]
name = "mode"
type = "mode"
harmonics = 1
normalise = "x"
amplitude = [1e-3, 1e-2]
report_at = [5e-3]
"""
JENKINS = 'law = "jenkins"\ntangential_stiffness = 200.0\nfriction_limit = [2.0, 1.0]'
STOP = 'law = "unilateral_spring"\nnormal_stiffness = 200.0'


@pytest.mark.parametrize(
    "law, label, total", [(JENKINS, "Tangential force [N]", 3.0), (STOP, "Normal force [N]", None)]
)
def test_loads_at_rest_and_maps_are_drawn_whatever_the_law(tmp_path: Path, law: str, label: str, total) -> None:
    """Without a normal direction neither was: 'cannot convert float NaN to integer'. Both sliders slip: 2 + 1 N."""
    (tmp_path / "model.py").write_text(BUILDER)
    (tmp_path / "case.toml").write_text(CASE.format(law=law))
    assert call("run", tmp_path / "case.toml", "--out", tmp_path / "run") == 0
    drawn = dict(faces.figures(Run(tmp_path / "run")))
    assert set(drawn) == {"static_load_pads", "mode_map_pads"}
    load = drawn["static_load_pads"]
    assert load.axes[-1].get_ylabel() == label
    assert call("report", tmp_path / "run") == 0
    page = (tmp_path / "run" / "report.html").read_text()
    told = ["largest normal force" in page, "largest tangential force" in page]
    assert told == [total is None, total is not None]  # without friction every row has the largest one, zero
    if total is not None:
        assert f"tangential forces {total:.4g} N; 0 stick, 2 slip" in load._suptitle.get_text()
