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


#: A mass on a spring of 800 N/m, a stiff link to a mass of 1 mg, and what stiffens there.
LINKED = """
[model]
dofs = ["x", "link"]
M = [[1.0, 0.0], [0.0, 1e-6]]
K = [[{held!r}, {joined!r}], [{joined!r}, {link!r}]]
C = [[0.5, 0.0], [0.0, 0.0]]

[[contact]]
name = "stiffening"
law = "cubic_spring"
pairs = ["link"]
cubic_stiffness = 1e4

[[analysis]]
name = "response"
type = "forced"
harmonics = 9
force = {{ x = 1.0 }}
levels = [20.0]
frequency = [2.0, 12.0]
observe = "x"
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize("link, code", [(1e8, 0), (1e11, 3)], ids=["stiff", "too stiff"])
def test_a_link_so_stiff_that_rounding_hides_the_rest_is_named(tmp_path, capfd, link, code):
    path = tmp_path / "case.toml"
    path.write_text(LINKED.format(held=800.0 + link, joined=-link, link=link), encoding="utf-8")
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == code
    said = capfd.readouterr().err
    assert ("rounding beside the stiffest springs hides" in said) == ("softer links" in said) == (code == 3), said
