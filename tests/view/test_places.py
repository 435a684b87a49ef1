"""The point that an amplitude means: next to a place where a branch passes it, not merely near it in amplitude."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call

from fretwave.commands.probe import _point_line
from fretwave.view.options import ViewOptions
from fretwave.view.places import around_places, branches_of
from fretwave.view.points import points_asked

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
#: A branch that folds at 1.40 and back at 1.21: it passes 1.2 before the first fold alone, 1.3 three times.
FOLDED = np.array([1.0, 1.15, 1.30001, 1.40, 1.29, 1.21, 1.31, 2.0])


def around(amplitude: np.ndarray, asked: float, kept: list[int] | None = None) -> list[int]:
    rows = np.arange(len(amplitude))
    return around_places([(rows, amplitude)], rows if kept is None else np.array(kept), asked)


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        (1.2, [1]),  # row 5 is nearer, and on the other side of both folds
        (1.3, [2, 4, 6]),
        (1.40, [3, 6]),
        (1.0, [0]),
        (2.0 * (1 + 1e-12), [7]),
        (2.1, []),
        (np.inf, []),
        (-np.inf, []),
        (np.nan, []),
    ],
)
def test_a_branch_that_folds_back(asked: float, expected: list[int]) -> None:
    assert around(FOLDED, asked) == expected


def test_kept_points_are_those_around_the_place() -> None:
    assert around(FOLDED, 1.2, [0, 5, 7]) == [5] and around(FOLDED, 1.19, [0, 3, 5, 7]) == [0]
    assert around(FOLDED, 1.2, [5, 7]) == [5]  # nothing is kept before the place
    assert around(FOLDED, 1.3, [3, 5]) == [3, 5, 5]


def test_amplitudes_that_stay_are_one_place() -> None:
    assert around(np.full(5, 1.1), 1.1) == [0]


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("places") / "run"
    short = ("--quick", "--only", "mode,forced", "--set", "forced.time_points=0", "--no-plots", "-q")
    assert call("run", CASE, *short, "--out", folder) == 0
    return folder


def said(capsys, *words: object) -> str:
    capsys.readouterr()
    assert call("probe", *words, "--dof", "m1") == 0
    return capsys.readouterr().out.splitlines()[0]


def test_it_is_said_how_often_a_branch_passes_an_amplitude(run: Path, capsys) -> None:
    """The mode folds near 0.1354 and 0.1340 m; below the second it passes an amplitude once."""
    once, thrice = said(capsys, run, "--at", 0.134), said(capsys, run, "--at", 0.1345)
    assert "places" not in once and "passed at 3 places" in thrice
    with h5py.File(run / "results.h5") as file:
        amplitude = file["mode/points/amplitude"][()]
        first = int(np.argmax(amplitude > 0.134))
        assert f"point {first}," in once or f"point {first - 1}," in once
        assert np.abs(amplitude - 0.134).argmin() > first  # that is the fold


def test_levels_are_branches_of_their_own(run: Path) -> None:
    with h5py.File(run / "results.h5") as file:
        parts = branches_of(file["forced"])
    assert len(parts) == 2
    for rows, amplitude in parts:
        asked = 0.5 * amplitude.max()
        assert len(around_places([(rows, amplitude)], rows, asked)) == 2


def test_without_a_wish_a_driven_wheel_shows_the_sector_that_moves_most() -> None:
    """Its amplitude is that of the observed sector, which moves most elsewhere."""
    with h5py.File("wheel", "w", driver="core", backing_store=False) as file:
        points = file.create_group("points")
        points["amplitude"], points["largest_amplitude"] = [0.1, 0.2, 0.8], [0.2, 0.9, 0.81]
        ((point, told),) = points_asked(file, np.arange(3), ViewOptions(), "here")
    assert point == 1 and told.endswith("of any sector")


@pytest.mark.parametrize("asked", ["inf", "nan"])
def test_an_amplitude_that_is_no_number_is_refused(run: Path, capsys, asked: str) -> None:
    assert call("probe", run, "--dof", "m1", "--at", asked) == 2
    told = capsys.readouterr()
    assert told.out == "" and "does not reach" in told.err


@pytest.fixture(scope="module")
def linear(tmp_path_factory) -> Path:
    """A run of linear modes alone."""
    tmp_path = tmp_path_factory.mktemp("linear")
    shutil.copy(CASE, tmp_path / "case.toml")
    with (tmp_path / "case.toml").open("a") as file:
        file.write('\n[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = 2\n')
    text = (tmp_path / "case.toml").read_text()
    begin, quick = text.index("[quick]"), text.rindex("[[analysis]]")
    (tmp_path / "case.toml").write_text(text[:begin] + text[quick:])
    assert call("run", tmp_path / "case.toml", "--only", "linear", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    return tmp_path / "run"


def test_linear_modes_have_no_peak(linear: Path, capsys) -> None:
    """Their table has a damping ratio, but no branch on which it could be largest."""
    line = said(capsys, linear)
    assert call("probe", linear, "--dof", "m1", "--at", "1e9") == 2
    assert "point 0, contact stuck, mode 1" in line and "no peak" in line and "largest" not in line


@pytest.mark.parametrize(
    ("asked", "what"),
    [
        ([], "no analysis has motion of contact pairs"),
        (["--analysis", "linear"], "'linear' has no motion of contact pairs"),
        (["--analysis", "liner"], "there is no analysis 'liner'"),
    ],
)
def test_what_no_analysis_has_is_told(linear: Path, capsys, asked: list[str], what: str) -> None:
    assert call("probe", linear, "--pairs", *asked) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.startswith(f"error: {what}\n")
    assert told.err.rpartition("fix:")[2].strip() == "run a mode or forced response"


@pytest.mark.parametrize(
    ("own", "words"),
    [
        ({}, "amplitude 0.2 m, sector 3 moves most, "),
        ({"largest_amplitude": 0.9}, "amplitude 0.2 m, largest of all sectors 0.9 m, in sector 3, "),
    ],
)
def test_a_sector_stands_beside_its_own_amplitude(own: dict[str, float], words: str) -> None:
    """A mode's amplitude is of the dof that is observed, in whatever sector; of a response there are both."""
    with h5py.File("points", "w", driver="core", backing_store=False) as file:
        points = file.create_group("points")
        for name, value in {"amplitude": 0.2, "largest_sector": 3, "frequency_hz": 10.0, **own}.items():
            points[name] = [value]
        points["amplitude"].attrs["units"] = "m"
        assert words in _point_line(file, "wheel", 0, "")
