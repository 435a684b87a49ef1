"""Case files of one sector: faces by name or from a builder, a nodal diameter per analysis, and what is refused."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from models.cyclic_models import MASSES, NEIGHBOUR, blisk_stiffness, lumped_blisk
from tolerances import TIGHT

import fretwave as fw
from fretwave.case.build import build_model
from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.errors import CaseErrors

CASE = Path(__file__).parents[2] / "cases" / "blisk_lumped" / "case.toml"
#: The lumped blisk with the next sector's disk as its high face, on which nothing but the tie is given.
STIFFNESS = np.zeros((4, 4))
STIFFNESS[:3, :3] = blisk_stiffness(0)
STIFFNESS[np.ix_([0, 3], [0, 3])] += NEIGHBOUR * np.array([[1, -1], [-1, 1]])
TEXT = f"""
[model]
dofs = ["disk", "blade", "tip", "next"]
M = {np.diag([*MASSES, 0.0]).tolist()}
K = {STIFFNESS.tolist()}
sectors = 24
low = ["disk"]
high = ["next"]
stiffness_damping = 1e-7

[[contact]]
name = "shroud"
law = "jenkins"
pairs = [["tip", "next"]]
tangential_stiffness = 1e5
friction_limit = 10.0

[[analysis]]
name = "mode"
type = "mode"
nodal_diameter = -4
normalise = "tip"
harmonics = 1
amplitude = [1e-5, 1e-4]
"""


@pytest.fixture
def write(tmp_path):
    """The case with replacements."""

    def make(*changes: tuple[str, str]) -> Path:
        text = TEXT
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return make


@pytest.mark.ranks(1)
def test_matrices_of_the_case_are_tied_by_the_names_of_the_faces(write):
    case = load_case(write())
    expected = lumped_blisk()
    assert case.dofs == ["disk", "blade", "tip"]
    assert np.allclose(case.K.toarray(), expected.K[0]) and np.allclose(case.M.toarray(), expected.M)
    for k in (1, -1):
        assert np.allclose(case.structure.K[k].toarray(), expected.K[k])
    assert case.contacts[0].pairs.own.toarray().tolist() == [[0, 0, -1]]
    assert case.structure.pairs["shroud"].B[1].toarray().tolist() == [[1, 0, 0]]
    assert case.resolved["model.sectors"] == 24 and case.resolved["model.high"] == ["next"]
    assert case.resolved["model.low"] == ["disk"]


def test_model_of_the_case_is_that_of_the_sector(write, tmp_path, comm):
    """Damping included, which grows with K on all sectors: K and C travel alike."""
    case = load_case(write()) if comm.rank == 0 else None
    case = comm.bcast(case)
    ahead = {0: [[0, 0, -1.0]], 1: [[1.0, 0, 0]]}
    shroud = fw.Contact("jenkins", ahead, {"tangential_stiffness": 1e5, "friction_limit": 10.0})
    sector = lumped_blisk(24, [shroud])
    C = {k: 1e-7 * np.asarray(K) for k, K in sector.K.items()}
    expected = fw.Sector(sector.M, sector.K, 24, C, [shroud])
    for state in ("stuck", "linearised"):
        with build_model(case, (), comm, nodal_diameter=-4) as a, expected.model(-4, comm) as b:
            for found, wanted in zip(fw.linear_modes(a, 3, state), fw.linear_modes(b, 3, state)):
                assert found.omega == pytest.approx(wanted.omega, rel=TIGHT)
                assert found.beta == pytest.approx(wanted.beta, abs=TIGHT * wanted.omega)
                assert np.allclose(found.shape + 1j * found.imaginary, wanted.shape + 1j * wanted.imaginary, atol=1e-7)


@pytest.mark.ranks(1)
def test_committed_case_runs_from_its_builder(tmp_path):
    """From full stick to slip; the numbers of the case's README."""
    hook = sys.excepthook
    arguments = ["run", str(CASE), "--quick", "--no-plots", "--only", "mode", "--out", str(tmp_path)]
    assert main([*arguments, "--set", "mode.amplitude=[1e-4, 1e-3]"]) == 0
    sys.excepthook = hook
    with open(tmp_path / "mode.csv", newline="") as file:
        rows = [{key: float(row[key]) for key in ("frequency_hz", "zeta", "slip")} for row in csv.DictReader(file)]
    assert rows[0]["frequency_hz"] == pytest.approx(1031.644, rel=1e-6) and rows[0]["slip"] == 0
    assert max(row["zeta"] for row in rows) == pytest.approx(0.00794, rel=0.01)
    assert "one of 24 sectors" in (tmp_path / "run.log").read_text()


#: (text in the case, its replacement, what is said)
WRONG = {
    "no nodal diameter": ("nodal_diameter = -4\n", "", r"says no nodal diameter(?s:.*)-12 \.\. 12"),
    "too many nodal diameters": ("nodal_diameter = -4", "nodal_diameter = 13", "(?s)has no such.*= -11`, the same"),
    "unknown face dof": ('high = ["next"]', 'high = ["nxt"]', "unknown dof 'nxt' of the high face"),
    "no high face": ('high = ["next"]\n', "", "needs both faces"),
    "no sectors": ("sectors = 24\n", "", "without a number of sectors"),
    "unequal faces": ('low = ["disk"]', 'low = ["disk", "blade"]', "2 low and 1 high dofs"),
    "a face twice": ('low = ["disk"]', 'low = ["next"]', "dof 3 stands 2 times"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_sector_is_said_once(write, change):
    old, new, message = change
    with pytest.raises(CaseErrors, match=message) as caught:
        load_case(write((old, new)))
    assert len(caught.value.problems) == 1


@pytest.mark.ranks(1)
def test_a_whole_structure_has_no_nodal_diameter(write):
    changes = [("sectors = 24\n", ""), ('low = ["disk"]\n', ""), ('high = ["next"]\n', "")]
    with pytest.raises(CaseErrors, match="no sector of a wheel"):
        load_case(write(*changes))


@pytest.mark.ranks(1)
def test_a_sector_is_not_integrated_in_time(write):
    decay = '\n[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [1e-5]\nperiods = 5\n'
    with pytest.raises(CaseErrors, match="integrates in time"):
        load_case(write(("amplitude = [1e-5, 1e-4]\n", "amplitude = [1e-5, 1e-4]\n" + decay)))


@pytest.mark.ranks(1)
@pytest.mark.parametrize("kind", ["free_decay", "limit_cycle", "forced"])
def test_nor_is_a_whole_wheel_and_the_words_fit_it(write, kind):
    """They spoke of one sector alone, and of nothing to remove but a key that is needed."""
    wheel = "wheel = true\nnormalise"
    more = 'mode = "mode"\namplitude = [1e-5]\nperiods = 100\n'
    if kind == "forced":
        more = 'backbone = ["mode"]\nnodal_diameter = -4\nwheel = true\nforce = { tip = 1.0 }\nobserve = "tip"\n'
        more += "levels = [1.0]\nfrequency = [600.0, 700.0]\nharmonics = 1\ntime_points = 1\n"
    analysis = f'\n[[analysis]]\nname = "other"\ntype = "{kind}"\n{more}'
    with pytest.raises(CaseErrors) as caught:
        load_case(write(("normalise", wheel), ("1e-4]\n", "1e-4]\n" + analysis)))
    (found,) = [one for one in caught.value.problems if one.what.startswith("other ")]
    assert "integrates in time" in found.what and found.what.endswith("one sector or the whole wheel")
    assert found.fix == ("write `time_points = 0`" if kind == "forced" else "remove the analysis")
