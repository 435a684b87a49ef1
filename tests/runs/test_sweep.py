"""Sweeps: closed forms over the value, one result with its dimensions, the same on any ranks, and resumed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import own_environment
from models.csv_columns import column, rows
from models.swept_case import CASE, LIMITS, MEMORYLESS, OVER, fretwave
from tolerances import SOLVED

from fretwave.case.load import load_case
from fretwave.files.dimensions import names_of_data
from fretwave.results.sweep_summary import summarise
from fretwave.run.order import RunOptions
from fretwave.run.runner import Runner
from fretwave.run.sweep_analysis import analysis_sweep

pytestmark = pytest.mark.ranks(1)

#: Differences between numbers of ranks come from the order of additions.
RANK_TOLERANCE = 1e-8


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("slider") / "slider.toml"
    path.write_text(CASE)
    return path


@pytest.fixture(scope="module")
def swept(case: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    assert fretwave("sweep", case, *OVER, "--only", "mode", "--out", folder) == 0
    return folder


def closed_form(a: np.ndarray, limit: float) -> np.ndarray:
    """Damping ratio ki / (2 (k + kr)) of the periodic motion with one harmonic."""
    ratio = np.minimum(limit / a, 1.0)
    th = np.arccos(1 - 2 * ratio)
    return 4 * ratio / np.pi * (1 - ratio) / (2 * (1 + (th - np.sin(2 * th) / 2) / np.pi))


# What is computed


def test_branches_are_the_closed_form_at_every_value(swept: Path) -> None:
    """One harmonic; 512 samples miss the kinks by (2 pi / 512)^2."""
    key = column(swept / "mode.csv", "contact.slider.friction_limit")
    a, zeta = (column(swept / "mode.csv", name) for name in ("amplitude", "zeta"))
    for limit in LIMITS:
        assert zeta[key == limit] == pytest.approx(closed_form(a[key == limit], limit), abs=2e-5)


def test_thresholds_are_proportional_to_the_limit_and_the_largest_damping_does_not_change(swept: Path) -> None:
    fine = np.geomspace(1.0, 60.0, 200001)
    zeta = closed_form(fine, 1.0)
    top = int(np.argmax(zeta))
    onset = np.interp(0.1 * zeta[top], zeta[:top], fine[:top])
    for row, limit in zip(rows(swept / "summary.csv"), LIMITS):
        found = {key: float(text) for key, text in row.items() if key != "analysis"}
        assert found["slip_threshold"] == pytest.approx(limit, rel=0.5 * (np.pi / 512) ** 2)
        assert found["stick_until"] <= limit < found["slip_from"] < 1.2 * limit
        assert found["onset_amplitude"] == pytest.approx(limit * onset, rel=5e-3)
        assert found["largest_zeta"] == pytest.approx(zeta[top], abs=2e-5)
        assert found["amplitude_of_largest_zeta"] == pytest.approx(
            limit * fine[top], rel=1e-2
        )  # flat: sqrt of zeta's error
        assert found["stuck_hz"] == pytest.approx(np.sqrt(2) / (2 * np.pi), rel=SOLVED)
        assert found["free_hz"] == pytest.approx(1 / (2 * np.pi), rel=SOLVED)


def test_limit_cycles_over_the_value(case: Path, tmp_path: Path) -> None:
    """A destabilising damper c: zeta is zero where ki = c w0; both cycles are proportional to the limit."""
    damper = ["--set", "mode.dampers=[{ dof = 'x', c = -0.1 }]", "--only", "mode", "--no-plots"]
    assert fretwave("sweep", case, *OVER, *damper, "--out", tmp_path) == 0
    a = np.geomspace(1.0, 60.0, 20001)
    th = np.arccos(1 - 2 / a)
    net = 4 / (np.pi * a) * (1 - 1 / a) - 0.1 * np.sqrt(1 + (th - np.sin(2 * th) / 2) / np.pi)
    stable, unstable = a[np.flatnonzero(np.diff(np.sign(net)))]
    assert column(tmp_path / "summary.csv", "stable_limit_cycle") / LIMITS == pytest.approx(stable, rel=2e-3)
    found = column(tmp_path / "summary.csv", "unstable_limit_cycle")
    assert found[:2] / LIMITS[:2] == pytest.approx(unstable, rel=2e-3)
    assert np.isnan(found[2]) == (5 * unstable > 60)


def test_onset_is_where_a_tenth_of_the_rise_is_reached() -> None:
    a = np.geomspace(1.0, 100.0, 400)
    table = {"amplitude": a, "zeta": 0.01 + 0.02 * np.log10(a), "omega": a * 0 + 1, "omega0": a * 0 + 1}
    table |= {"frequency_hz": a * 0 + 1, "slip": (a > 2) * 0.5, "newton": a * 0 + 3, "event": [""] * 400}
    found = summarise("mode", table, {})
    assert found["onset_amplitude"] == pytest.approx(10**0.2, rel=1e-3)
    assert found["stick_until"] <= 2 < found["slip_from"]
    assert np.isnan(summarise("mode", {**table, "slip": a * 0 + 0.5}, {})["onset_amplitude"])
    assert np.isnan(summarise("mode", {**table, "slip": a * 0}, {})["slip_from"])


def test_a_value_is_the_run_with_that_value_set(case: Path, swept: Path, tmp_path: Path) -> None:
    arguments = ("--only", "mode", "--no-plots", "--out", tmp_path, "--set", "contact.slider.friction_limit=5.0")
    assert fretwave("run", case, *arguments) == 0
    one = [row for row in rows(swept / "mode.csv") if row.pop("contact.slider.friction_limit") == "5.0"]
    other = rows(tmp_path / "mode.csv")
    assert [{k: v for k, v in row.items() if k not in ("value", "wall_s")} for row in one] == [
        {k: v for k, v in row.items() if k != "wall_s"} for row in other
    ]


def test_friction_lowers_the_threshold_of_the_blisk_and_leaves_its_largest_damping(tmp_path: Path) -> None:
    """The paper's figure 10, over a factor 25; thresholds are proportional to mu, as normal loads are constant."""
    blisk = Path(__file__).parents[2] / "cases" / "blisk_lumped" / "case.toml"
    over = ["--over", "model.options.friction=0.06,0.3,1.5", "--only", "mode", "--quick"]
    assert fretwave("sweep", blisk, *over, "--out", tmp_path, "--no-plots") == 0
    mu, slip, onset, zeta, lowest, stuck, last, free = (
        column(tmp_path / "summary.csv", key)
        for key in ("model.options.friction", "slip_threshold", "onset_amplitude", "largest_zeta")
        + ("lowest_frequency_hz", "stuck_hz", "last_frequency_hz", "free_hz")
    )
    assert slip / mu == pytest.approx(1.9054e-4 / 0.3, rel=1e-4)  # test_blisk_lumped
    assert onset / mu == pytest.approx(np.mean(onset / mu), rel=5e-3)
    assert np.ptp(zeta) < 0.05 * zeta.min()
    assert (lowest < stuck - 0.2).all()
    assert last == pytest.approx(free, rel=1e-4)
    assert (last > stuck).all()


# The result


def test_files_of_a_sweep(swept: Path) -> None:
    names = {path.name for path in swept.iterdir()}
    tables = {"mode.csv", "summary.csv", "mode_backbones.png", "mode_summary.png"}
    assert names == tables | {"results.h5", "run.json", "run.log", "case.toml", "values"}
    header = (swept / "mode.csv").read_text().splitlines()[0]
    assert header.startswith("contact.slider.friction_limit,value,point,amplitude,omega,omega0,frequency_hz,beta,zeta,")
    record = json.loads((swept / "run.json").read_text())
    assert record["status"] == "done"
    assert [value["status"] for value in record["values"]] == ["done"] * 3
    assert record["values"][2]["over"] == {"contact.slider.friction_limit": 5.0}


def test_results_have_the_swept_dimension(swept: Path) -> None:
    with h5py.File(swept / "results.h5") as file:
        group = file["mode"]
        assert (group.attrs["type"], group.attrs["of"], group.attrs["status"]) == ("sweep", "mode", "done")
        assert list(group["over/contact.slider.friction_limit"]) == list(LIMITS)
        scale = group["summary/contact.slider.friction_limit"]
        assert list(scale) == list(LIMITS) and "contact.slider.friction_limit" not in group
        for name in names_of_data(group["summary"]):
            data = group["summary"][name]
            assert data.shape == (3,)
            assert data.dims[0][0] == scale, name
        lengths = [len(group[f"values/{number:04d}/points/zeta"]) for number in range(3)]
        assert len(group["points/zeta"]) == sum(lengths)
        start = lengths[0]
        one = group["values/0001"]
        assert np.array_equal(group["points/zeta"][start : start + lengths[1]], one["points/zeta"])
        assert one["coefficients"].shape == (lengths[1], 1, 2)
        assert one["coefficients"].dims[0][0] == one["point"]
        assert one["coefficients"].dims[2][0] == one["harmonic"]
        assert not any(name.startswith("state") for name in one)
        assert one["points/amplitude"].attrs["units"] == "m"


def test_show_plot_and_values(swept: Path, capsys) -> None:
    assert fretwave("show", swept) == 0
    shown = capsys.readouterr().out
    assert "sweep EPMC" in shown
    assert fretwave("plot", swept) == 0
    assert "2 pictures" in capsys.readouterr().out
    assert fretwave("show", swept / "values" / "0001") == 0
    assert fretwave("view", swept) == 2
    assert "fix:      give " in capsys.readouterr().err


def test_products_of_keys_and_texts(case: Path, tmp_path: Path) -> None:
    """The last key changes fastest; texts are values too; a forced response has its levels as a further dimension."""
    more = case.with_name("forced.toml")
    forced = '[[analysis]]\nname = "forced"\ntype = "forced"\nharmonics = 1\nsamples = 64\nforce = { x = 1.0 }\n'
    more.write_text(CASE + forced + 'levels = [0.2, 0.4]\nfrequency = [0.15, 0.25]\nobserve = "x"\n')
    over = ["--over", "mode.method=EPMC,CNM", "--over", "contact.slider.friction_limit=0.5,1,1.5"]
    short = ["--set", "mode.amplitude=[0.3,5.0]", "--out", tmp_path, "--only", "mode,forced"]
    assert fretwave("sweep", more, *over, *short) == 0
    table = rows(tmp_path / "summary.csv")
    modes, responses = ([row for row in table if row["analysis"] == name] for name in ("mode", "forced"))
    assert [row["mode.method"] for row in modes] == ["EPMC"] * 3 + ["CNM"] * 3
    assert [row["contact.slider.friction_limit"] for row in modes] == 2 * ["0.5", "1.0", "1.5"]
    assert len(responses) == 12
    with h5py.File(tmp_path / "results.h5") as file:
        assert file["mode/summary/largest_zeta"].shape == (2, 3)
        assert file["mode/over/mode.method"][()].tolist() == [b"EPMC", b"CNM"]
        peaks = file["forced/summary/largest_amplitude"]
        assert peaks.shape == (2, 3, 2)
        assert [peaks.dims[k][0].name.rpartition("/")[2] for k in (1, 2)] == ["contact.slider.friction_limit", "level"]
        zeta = file["mode/summary/largest_zeta"][()]
    assert np.ptp(zeta[0]) < 1e-5
    assert zeta[1] == pytest.approx(np.sin(np.arctan(2 * zeta[0]) / 2), abs=2e-5)
    assert fretwave("show", tmp_path) == 0
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {f"{n}.png" for n in ("mode_backbones", "mode_summary", "forced_responses", "forced_summary")}


# As an analysis of a case


@pytest.fixture(scope="module")
def analysed(case: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("analysed")
    assert fretwave("run", case, "--out", folder) == 0
    return folder


def test_analysis_of_type_sweep(analysed: Path) -> None:
    names = {path.name for path in analysed.iterdir()}
    assert {"mode.csv", "limits.csv", "limits_summary.csv", "limits_backbones.png", "limits_summary.png"} <= names
    assert column(analysed / "limits_summary.csv", "largest_zeta") == pytest.approx(0.11127, abs=5e-5)
    record = json.loads((analysed / "run.json").read_text())
    assert record["analyses"]["limits"]["status"] == "done"
    with h5py.File(analysed / "results.h5") as file:
        assert {"mode", "limits"} == set(file)
        assert file["limits"].attrs["of"] == "mode"
        amplitude = file["limits/points/amplitude"][()]
        assert amplitude.min() == pytest.approx(0.1), "overrides act in the sweep"
        assert file["mode/points/amplitude"][0] == pytest.approx(0.05), "and not outside of it"


def test_resuming_a_run_with_a_sweep_that_is_done(analysed: Path, capsys) -> None:
    before = (analysed / "results.h5").read_bytes()
    assert fretwave("resume", analysed, "--no-plots") == 0
    assert "limits: already done" in capsys.readouterr().out
    assert (analysed / "results.h5").read_bytes() == before


def test_a_sweep_runs_what_its_analysis_needs(case: Path) -> None:
    path = case.with_name("decay.toml")
    decay = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [2.0]\nperiods = 3\n'
    path.write_text(CASE.replace('of = "mode"', 'of = "decay"').replace(*MEMORYLESS) + decay)
    loaded = load_case(path)
    assert analysis_sweep(Runner, loaded, loaded.analyses["limits"], RunOptions()).options.only == ["mode", "decay"]


# On several ranks, cut off, and stopped early


@pytest.mark.parametrize(("ranks", "groups"), [(2, None), (3, 1), (4, None)])
def test_same_answers_on_any_ranks_and_groups(case: Path, swept: Path, tmp_path: Path, launch, ranks, groups) -> None:
    """Four ranks share three values, so that one group has two ranks."""
    asked = ["--groups", str(groups)] if groups else []
    arguments = [*OVER, "--only", "mode", "--out", str(tmp_path), "--no-plots", *asked]
    done = launch(ranks, "-m", "fretwave", "sweep", str(case), *arguments, timeout=120)
    assert done.returncode == 0, done.stderr
    assert f"{ranks} ranks in {groups or min(ranks, 3)} group" in done.stdout
    for key in ("value", "amplitude", "omega", "zeta"):
        one, other = (column(folder / "mode.csv", key) for folder in (swept, tmp_path))
        assert other == pytest.approx(one, rel=RANK_TOLERANCE, abs=RANK_TOLERANCE), key
    sizes = [json.loads(path.read_text())["ranks"] for path in sorted(tmp_path.glob("values/*/run.json"))]
    assert max(sizes) == -(-ranks // (groups or min(ranks, 3)))


def test_killed_sweep_goes_on_with_the_values_not_done(case: Path, swept: Path, tmp_path: Path, launch) -> None:
    words = ["sweep", str(case), *OVER, "--only", "mode", "--out", str(tmp_path), "--no-plots"]
    command = [sys.executable, "-m", "fretwave", *words]
    second = tmp_path / "values" / "0001" / "mode.csv"
    with subprocess.Popen(command, env=own_environment(), stdout=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 60
        while not (second.exists() and len(second.read_text().splitlines()) > 5):
            assert process.poll() is None, "the sweep ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
    first = (tmp_path / "values" / "0000" / "results.h5").read_bytes()
    assert not (tmp_path / "results.h5").exists()
    shown = launch(1, "-m", "fretwave", "show", str(tmp_path))
    assert shown.returncode == 2 and "no results here yet" in shown.stderr and "`fretwave resume" in shown.stderr
    done = launch(2, "-m", "fretwave", "resume", str(tmp_path), "--no-plots", timeout=120)
    assert done.returncode == 0, done.stderr
    assert "friction_limit = 0.2 N: already done" in done.stdout
    assert (tmp_path / "values" / "0000" / "results.h5").read_bytes() == first
    for key in ("value", "point", "zeta"):
        one, other = (column(folder / "mode.csv", key) for folder in (swept, tmp_path))
        assert other == pytest.approx(one, rel=RANK_TOLERANCE, abs=RANK_TOLERANCE), key


def test_one_value_that_stops_early_keeps_the_others(case: Path, tmp_path: Path, capsys) -> None:
    over = ["--over", "mode.step.max_points=500,4,600", "--only", "mode"]
    assert fretwave("sweep", case, *over, "--out", tmp_path) == 3
    said = capsys.readouterr().err
    assert "1 of 3 values did not come to their end" in said
    assert "max_points = 4: " in said
    values = json.loads((tmp_path / "run.json").read_text())["values"]
    assert [value["status"] for value in values] == ["done", "stopped", "done"]
    counts = column(tmp_path / "summary.csv", "points")
    assert counts[1] == 4
    assert counts[0] == counts[2] > 20
    with h5py.File(tmp_path / "results.h5") as file:
        assert file["mode"].attrs["status"] == "stopped"


def test_a_value_without_any_point_is_named_and_left_out(case: Path, tmp_path: Path, capsys) -> None:
    """Newton may take no iteration at one value."""
    over = ["--over", "mode.petsc='','-snes_max_it 0'", "--only", "mode"]
    assert fretwave("sweep", case, *over, "--out", tmp_path, "--no-plots", "--set", "mode.amplitude=[2.0, 9.0]") == 3
    assert 'petsc = "-snes_max_it 0": ' in capsys.readouterr().err
    assert [value["status"] for value in json.loads((tmp_path / "run.json").read_text())["values"]] == [
        "done",
        "failed",
    ]
    with h5py.File(tmp_path / "results.h5") as file:
        assert np.isnan(file["mode/summary/largest_zeta"][1])
        assert list(file["mode/values"]) == ["0000"]


def test_a_smaller_sweep_in_the_same_folder_forgets_the_others(case: Path, tmp_path: Path) -> None:
    for values in ("1.0,2.0", "3.0"):
        over = ["--over", f"contact.slider.friction_limit={values}", "--only", "mode", "--out", tmp_path]
        assert fretwave("sweep", case, *over, "--no-plots", "--set", "mode.amplitude=[0.5, 1.0]") == 0
    assert [path.name for path in (tmp_path / "values").iterdir()] == ["0000"]
    assert set(column(tmp_path / "mode.csv", "contact.slider.friction_limit")) == {3.0}


def test_a_changed_case_is_not_resumed(swept: Path, case: Path, capsys) -> None:
    text = case.read_text()
    try:
        case.write_text(text.replace("samples = 512", "samples = 256"))
        assert fretwave("resume", swept, "--no-plots") == 2
    finally:
        case.write_text(text)
    assert "mode.samples: 512 then, 256 now" in capsys.readouterr().err
