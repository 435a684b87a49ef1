"""What a stopped branch says of the numbers of a case: those of the case, however its forces have grown since."""

from __future__ import annotations

import pytest
from command_line import call

STIFFENING = """
[model]
dofs = ["x"]
M = [[1.0]]
K = [[100.0]]

[[contact]]
name = "slider"
law = "jenkins"
pairs = ["x"]
tangential_stiffness = 2e-4
friction_limit = 1.0

[[contact]]
name = "stiffening"
law = "cubic_spring"
pairs = ["x"]
cubic_stiffness = 1e14

[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
normalise = "x"
amplitude = [1e-6, 1e9]
step = { max_points = 60 }
"""


@pytest.mark.ranks(1)
def test_a_contact_is_measured_against_the_structure_not_against_what_its_springs_became(tmp_path, capfd):
    path = tmp_path / "case.toml"
    path.write_text(STIFFENING, encoding="utf-8")
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == 3
    said = capfd.readouterr().err
    assert "largest number of points" in said and "holds nothing" not in said, said
