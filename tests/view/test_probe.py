"""``fretwave probe``: pairs, nodes and dofs at a point of a branch, against results.h5 and the equations."""

from __future__ import annotations

import csv
import io
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.chain_case import BUILDER, CHAIN, FORCED
from models.rubbing_sector import BUILDER as SECTOR_BUILDER
from models.rubbing_sector import SECTOR
from tolerances import LAST_DIGITS, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.case.load import load_case
from fretwave.post.contact_history import ContactHistory
from fretwave.post.pair_values import pair_values, slip_range

pytestmark = pytest.mark.ranks(1)

TWO_DOF = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
ANALYSES = """
[[analysis]]
name = "mode"
type = "mode"
method = "EPMC"
harmonics = 5
samples = 256
normalise = "tip"
amplitude = [2e-7, 4e-6]
report_at = [2e-6, 3e-6]

[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [2e-6, 3e-6]
cycles = 4.0
coefficient = 1e-13
report_at = [2.0]
"""
#: Of the meshed sector.
FLUTTER = """
[aerodynamics]
frequency = 1000.0
damping = { 1 = 0.001, 2 = -0.001 }

[[analysis]]
name = "flutter"
type = "flutter"
nodal_diameters = [1, 2]
normalise = "tip"
harmonics = 1
samples = 96
amplitude = [5e-6, 1e-5]
"""
#: No pictures, no check in time.
SHORT = ("--set", "forced.time_points=0", "--no-plots", "-q")


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> dict[str, Path]:
    """The chain reduced, with all its component modes, and as it is."""
    base = tmp_path_factory.mktemp("probe")
    shutil.copy(BUILDER, base / "model.py")
    begin, end = CHAIN.index("[reduction]"), CHAIN.index("[preload]")
    found = {}
    for name, text in (("reduced", CHAIN), ("whole", CHAIN[:begin] + CHAIN[end:])):
        (base / f"{name}.toml").write_text(text + ANALYSES + FORCED)
        assert call("run", base / f"{name}.toml", "--no-plots", "-q", "--out", base / name) == 0
        found[name] = base / name
    return found


@pytest.fixture(scope="module")
def two_dof_run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("probe") / "two_dof"
    assert call("run", TWO_DOF, "--quick", "--only", "mode,forced", *SHORT, "--out", folder) == 0
    return folder


def rows_of(capsys, *words: object) -> list[dict[str, float | str]]:
    """The CSV that a probe prints."""
    capsys.readouterr()
    assert call("probe", *words) == 0
    return table_of(capsys.readouterr().out)


def table_of(text: str) -> list[dict[str, float | str]]:
    def number(value: str) -> float | str:
        try:
            return float(value)
        except ValueError:
            return value

    return [{key: number(value) for key, value in row.items()} for row in csv.DictReader(io.StringIO(text))]


@pytest.mark.parametrize("at", [("peak",), ("start",), ("end",), ("row", "7"), ("0.5",)])
def test_a_dof_is_its_coefficients(two_dof_run: Path, capsys, at: tuple[str, ...]) -> None:
    mode = fw.open_run(two_dof_run)["mode"]
    amplitude = mode["amplitude"]
    (point,) = {
        "peak": [np.argmax(mode["zeta"])],
        "start": [0],
        "end": [len(mode) - 1],
        "row": [7],
    }.get(at[0], [np.argmin(np.abs(amplitude - 0.5))])
    rows = rows_of(capsys, two_dof_run, "--dof", "m2", "--csv", "--at", *at)
    with h5py.File(two_dof_run / "results.h5") as file:
        values = dict(zip(mode.labels, file["mode/coefficients"][point, mode.dofs.index("m2")]))
    assert [row["harmonic"] for row in rows] == [1, 3, 5, 7]
    for row in rows:
        n = f"{row['harmonic']:.0f}"
        turn = np.exp(1j * np.radians(row["m2_phase_deg"]))
        q = row["m2_amplitude"] * turn
        assert abs(q - (values[f"{n}c"] - 1j * values[f"{n}s"])) <= LAST_DIGITS * row["m2_amplitude"]
        assert row["frequency_hz"] == pytest.approx(int(n) * mode["frequency_hz"][point], rel=LAST_DIGITS)


def test_the_normalised_dof_has_the_tables_amplitude(two_dof_run: Path, capsys) -> None:
    for name in ("mode", "forced"):
        table = fw.open_run(two_dof_run)[name]
        row = next(iter(rows_of(capsys, two_dof_run, "--analysis", name, "--dof", "m1", "--csv")))
        top = np.argmax(table["zeta"] if name == "mode" else table["amplitude"])
        assert row["m1_amplitude"] == pytest.approx(table["amplitude"][top], rel=ROUNDING)
        phase = 0.0 if name == "mode" else table["phase"][top]
        assert np.radians(row["m1_phase_deg"]) == pytest.approx(phase, abs=ROUNDING)


def test_motion_over_the_period_is_that_of_the_harmonics(runs, capsys) -> None:
    node = (runs["reduced"], "--node", 3, "--at", "end")
    harmonics, motion = rows_of(capsys, *node, "--csv"), rows_of(capsys, *node, "--steps", 8)
    assert len(motion) == 8
    for row in motion:
        tau = 2 * np.pi * row["period"]
        for name in "xyz":
            waves = [
                h[f"{name}_amplitude"] * np.cos(h["harmonic"] * tau + np.radians(h[f"{name}_phase_deg"]))
                for h in harmonics
            ]
            assert row[name] == pytest.approx(sum(waves), abs=ROUNDING * 4e-6)


def test_a_node_of_a_reduced_model_moves_as_without_reduction(runs, capsys) -> None:
    """All component modes are kept: both are the same equations, solved twice."""
    for node in (0, 2, 5):
        reduced, whole = (rows_of(capsys, runs[name], "--node", node, "--csv", "--at", "end") for name in runs)
        assert len(reduced) == len(whole) == 6
        for one, other in zip(reduced, whole):
            for name in "xyz":
                q, p = (r[f"{name}_amplitude"] * np.exp(1j * np.radians(r[f"{name}_phase_deg"])) for r in (one, other))
                assert abs(q - p) <= SOLVED * 4e-6


def test_nodes_under_static_loads_rest_as_without_reduction(runs, tmp_path: Path, capsys) -> None:
    """Of two component modes and of none, from the basis that the run keeps, and made again."""
    for modes in (0, 2):
        shutil.copy(BUILDER, tmp_path / "model.py")
        text = CHAIN.replace("modes = 12", f"modes = {modes}")
        (tmp_path / "case.toml").write_text(text + ANALYSES[: ANALYSES.index('[[analysis]]\nname = "wear"')])
        folder = tmp_path / f"run_{modes}"
        assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", folder) == 0
        for again in (False, True):
            if again:
                (folder / "reduction.h5").unlink()
            for node in range(6):
                rest, whole = (
                    rows_of(capsys, run, "--node", node, "--csv", "--at", "start") for run in (folder, runs["whole"])
                )
                for name in "xyz":
                    mean = whole[0][f"{name}_amplitude"]
                    assert rest[0][f"{name}_amplitude"] == pytest.approx(mean, rel=SOLVED, abs=SOLVED * 1e-6)


def test_a_node_on_component_modes_that_were_chosen_moves_the_same_on_a_basis_made_again(tmp_path, capsys) -> None:
    """As many as the run has taken: all 12, and not the 10 that a case without an accuracy has."""
    shutil.copy(BUILDER, tmp_path / "model.py")
    text = CHAIN.replace("modes = 12", "accuracy = 1e-9\ncompare = 3")
    (tmp_path / "case.toml").write_text(text + ANALYSES[: ANALYSES.index('[[analysis]]\nname = "wear"')])
    folder = tmp_path / "run"
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", folder) == 0
    kept = rows_of(capsys, folder, "--node", 2, "--csv", "--at", "end")
    (folder / "reduction.h5").unlink()
    again = rows_of(capsys, folder, "--node", 2, "--csv", "--at", "end")
    for one, other in zip(kept, again):
        assert other["x_amplitude"] == pytest.approx(one["x_amplitude"], rel=SOLVED, abs=SOLVED * 1e-6)


def test_a_dof_of_a_model_without_reduction_is_its_node(runs, capsys) -> None:
    dof, node = (rows_of(capsys, runs["whole"], *words, "--csv") for words in (("--dof", "tip"), ("--node", 5)))
    for one, other in zip(dof, node):
        assert (one["tip_amplitude"], one["tip_phase_deg"]) == (other["y_amplitude"], other["y_phase_deg"])


def test_work_of_the_pairs_is_what_the_table_says(runs, capsys) -> None:
    """The wear table has the contact's work; every row that keeps its pairs."""
    wear = fw.open_run(runs["reduced"])["wear"]
    assert len(wear.reported) > 3
    for row in wear.reported:
        pairs = rows_of(capsys, runs["reduced"], "--analysis", "wear", "--pairs", "--at", "row", row)
        assert sum(pair["work"] for pair in pairs) == pytest.approx(wear["work"][row], rel=ROUNDING)


def test_work_of_the_pairs_balances_the_artificial_damping(runs, capsys) -> None:
    """EPMC: contact takes what 2 zeta w0 M - C feeds, pi n^2 w0 q_n^H (2 zeta w0 M - C) q_n over all harmonics."""
    mode = fw.open_run(runs["whole"])["mode"]
    case = load_case(runs["whole"].parent / "whole.toml")
    point = len(mode) - 1
    zeta, omega = mode["zeta"][point], mode["omega0"][point]
    D = (2 * zeta * omega * case.M - case.damping_with(())).toarray()
    fed = 0.0
    coefficients = dict(zip(mode.labels, mode.coefficients([point])[0].T))
    for n in range(1, 6):
        q = coefficients[f"{n}c"] - 1j * coefficients[f"{n}s"]
        fed += np.pi * n**2 * omega * np.real(np.conj(q) @ D @ q)
    pairs = rows_of(capsys, runs["whole"], "--pairs", "--at", "end")
    assert sum(pair["work"] for pair in pairs) == pytest.approx(fed, rel=TIGHT) and fed > 0


def test_values_of_the_pairs_are_those_of_the_kept_period(runs, capsys) -> None:
    mode = fw.open_run(runs["reduced"])["mode"]
    point = len(mode) - 1
    kept, pairs = mode.loop("pads", point), rows_of(capsys, runs["reduced"], "--pairs", "--at", "end")
    force = kept["f"]
    for k, pair in enumerate(pairs):
        assert pair["normal_largest"] == force[:, 0, k].max() and pair["normal_least"] == force[:, 0, k].min()
        assert pair["pressure_largest"] == pytest.approx(force[:, 0, k].max() / 2e-4, rel=LAST_DIGITS)
        assert pair["tangential_largest"] == np.hypot(force[:, 1, k], force[:, 2, k]).max()
        assert [pair[word] for word in ("stick", "slip", "open")] == kept["shares"][:, k].tolist()
        assert (pair["contact"], pair["face"], pair["along"]) == ("pads", "pads", [0.0, 0.1][k])
    stuck, slides = pairs
    assert stuck["slip_range"] <= ROUNDING * slides["slip_range"] and stuck["work"] == 0.0 < slides["work"]
    # one tangent moves: the work is that of friction mu N over the slip path, twice the range
    assert slides["work"] == pytest.approx(0.4 * slides["normal_mean"] * 2 * slides["slip_range"], rel=2e-3)


@pytest.mark.parametrize("name", ["mode", "forced", "wear"])
def test_pairs_have_their_places_and_pressures_in_every_analysis(runs, capsys, name: str) -> None:
    """The two pads of the chain: 0.1 m apart, of 2e-4 m^2 each."""
    pairs = rows_of(capsys, runs["reduced"], "--analysis", name, "--pairs", "--at", "end")
    assert [(pair["face"], pair["along"]) for pair in pairs] == [("pads", 0.0), ("pads", 0.1)]
    for pair in pairs:
        assert pair["pressure_mean"] == pytest.approx(pair["normal_mean"] / 2e-4, rel=LAST_DIGITS)


def test_pairs_of_flutter_have_their_places_and_pressures(tmp_path: Path, capsys) -> None:
    """Of each wave of a meshed sector in a flow."""
    shutil.copy(SECTOR_BUILDER, tmp_path / "model.py")
    (tmp_path / "case.toml").write_text(SECTOR[: SECTOR.index("[[analysis]]")] + FLUTTER)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    areas = fw.open_run(tmp_path / "run")["flutter"].pairs("pads")["area"]
    for at in ("start", "end"):
        pairs = rows_of(capsys, tmp_path / "run", "--pairs", "--at", at)
        assert len(pairs) == len(areas)
        for pair, area in zip(pairs, areas):
            assert pair["pressure_mean"] == pytest.approx(pair["normal_mean"] / area, rel=LAST_DIGITS)
    last = len(fw.open_run(tmp_path / "run")["flutter"]["nodal_diameter"]) - 1
    assert call("view", tmp_path / "run", "--point", 0, last) == 0
    said = capsys.readouterr().out
    assert "flutter: point 0, nodal diameter 1, amplitude 5e-06 m, " in said
    assert f"flutter: point {last}, nodal diameter 2, amplitude " in said


def jenkins(amplitude: float, n: int = 4096) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and force of a slider with kt = 2 and the limit 1, after a period from rest."""
    u, w, f = amplitude * np.cos(2 * np.pi * np.arange(2 * n) / n), 0.0, []
    for x in u:
        w += np.sign(2 * (x - w)) * max(0.0, abs(x - w) - 0.5)
        f.append(2 * (x - w))
    return u[n:], np.array(f[n:])


@pytest.mark.parametrize(("amplitude", "slips"), [(0.4, 0.0), (0.5, 0.0), (1.5, 2.0)])
def test_range_of_a_slider(amplitude: float, slips: float) -> None:
    """Of a Jenkins element 2 (a - R / kt), in one tangent and in any direction of two."""
    u, f = jenkins(amplitude)
    one = ContactHistory(u[:, None, None], 0 * u[:, None, None], f[:, None, None])
    assert slip_range(one, np.array([2.0]))[0] == pytest.approx(slips, abs=1e-5)
    turned = np.array([0.0, 0.6, 0.8])[:, None]
    two = ContactHistory(u[:, None, None] * turned, 0 * u[:, None, None] * turned, f[:, None, None] * turned, normal=0)
    assert slip_range(two, np.array([2.0]))[0] == pytest.approx(slips, rel=2e-4, abs=LAST_DIGITS)
    assert slip_range(one)[0] == pytest.approx(2 * amplitude, rel=TIGHT)


@pytest.mark.parametrize("mean", [0.0, 0.3, 300.0])
def test_a_pair_that_sticks_has_no_range_of_rounding(mean: float) -> None:
    """The rounding of u - f / kt, beside a static displacement, stood in the table as a path of the slider."""
    u = (mean + 1e-6 * np.cos(2 * np.pi * np.arange(64) / 64))[:, None, None]
    history = ContactHistory(u, 0 * u, 7.3 * u, np.zeros((64, 1), dtype=np.int8))
    assert slip_range(history, np.array([7.3]))[0] == 0.0
    slips = ContactHistory(u, 0 * u, 0 * u, np.ones((64, 1), dtype=np.int8))
    assert slip_range(slips, np.array([7.3]))[0] == pytest.approx(2e-6, rel=1e-6)


def test_a_slip_between_the_samples_is_not_none() -> None:
    """All samples stick; the share of the whole period, where it is kept, knows better."""
    u = (1e-6 * np.cos(2 * np.pi * np.arange(64) / 64))[:, None, None] * np.ones(3)
    f = u * np.array([7.3, 7.0, 7.3])
    shares = np.array([[1.0, 0.999, 1.0], [0.0, 0.001, 0.0], [0.0, 0.0, 0.0]])
    for status in (np.zeros((64, 3), dtype=np.int8), None):
        history = ContactHistory(u, 0 * u, f, status, kept_shares=shares)
        stuck, slips, _ = slip_range(history, np.full(3, 7.3))
        assert stuck == 0.0 and slips == pytest.approx(2e-6 * (1 - 7.0 / 7.3), rel=1e-6)


def test_open_pairs_do_not_slip() -> None:
    """The displacement of an open pair moves no slider."""
    u, closed = np.linspace(0.0, 1.0, 5)[:, None, None], np.zeros((5, 1, 1))
    status = np.array([[0], [0], [2], [2], [2]], dtype=np.int8)
    values = pair_values(ContactHistory(u, closed, closed, status))
    assert values["slip_range"][0] == 0.25 and values["open"][0] == pytest.approx(0.6, rel=LAST_DIGITS)
    assert "normal_mean" not in values and "pressure_mean" not in values


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--node", "50"], "one of 6 nodes, 0 to 5"),
        (["--dof", "tpi"], "--dof tip"),
        (["--dof", "zz"], "component_1"),
        (["--pairs", "--at", "row", "3"], "not kept at this point"),
        (["--pairs", "--at", "row", "3000"], "there is no such point"),
        (["--pairs", "--at", "1.0"], "does not reach this amplitude"),
        (["--pairs", "--at", "pek"], "--at peak"),
        (["--pairs", "--analysis", "mod"], "did you mean `mode`?"),
        (["--dof", "tip", "--analysis", "zzz"], "there is no analysis 'zzz'"),
        (["--node", "1", "--sector", "2"], "--sector 0"),
        (["--pairs", "--sector", "0"], "--pairs has all sectors"),
        (["--dof", "tip", "--sector", "0"], "sector in its name"),
        (["--pairs", "--steps", "4"], "of a whole period"),
        (["--node", "1", "--steps", "0"], "--steps 64"),
        (["--pairs", "--node", "1"], "not allowed with"),
        ([], "--pairs --node --dof"),
    ],
)
def test_wrong_words_are_told_with_one_fix(runs, capsys, words: list[str], said: str) -> None:
    assert call("probe", runs["reduced"], *words) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("fix:") == 1 and said in told.err


def test_of_a_sweep_the_folder_of_a_value_is_asked_for(tmp_path: Path, capsys) -> None:
    short = ("--only", "mode", "--set", "mode.amplitude=[0.02, 0.03]", "--set", "mode.report_at=[]", "--no-plots", "-q")
    over = ("--over", "contact.damper.friction_limit=4,5")
    assert call("sweep", TWO_DOF, *over, *short, "--out", tmp_path / "swept") == 0
    for words in (["--pairs"], ["--dof", "m1"], ["--node", "1"]):
        assert call("probe", tmp_path / "swept", *words) == 2
        told = capsys.readouterr().err
        assert "folder of a sweep" in told and "values/0000" in told.rpartition("fix:")[2]
    assert call("probe", tmp_path / "swept" / "values" / "0000", "--pairs") == 0


def test_a_fix_works(runs, capsys) -> None:
    assert call("probe", runs["reduced"], "--pairs", "--at", "row", 3) == 2
    fix = capsys.readouterr().err.rpartition("fix:")[2].split()
    assert call("probe", runs["reduced"], "--pairs", *fix) == 0


def test_labels_are_in_the_units_of_the_case(tmp_path: Path, capsys) -> None:
    """Of numbers in mm-t-s: every heading that has a unit says it."""
    short = ("--quick", "--only", "mode", "--set", 'model.units="mm-t-s"', "--no-plots", "-q")
    assert call("run", TWO_DOF, *short, "--out", tmp_path) == 0
    for words, expected in (
        (["--pairs"], ["work [mJ]", "tangential_largest [N]", "slip_range [mm]"]),
        (["--dof", "m2", "--csv"], ["frequency_hz [Hz]", "m2_amplitude [mm]", "m2_phase_deg [deg]"]),
        (["--dof", "m2", "--steps", "2"], ["m2 [mm]"]),
    ):
        (row, *_) = rows_of(capsys, tmp_path, *words)
        assert [name for name in row if "[" in name] == expected
    assert call("probe", tmp_path, "--dof", "m2") == 0
    said = capsys.readouterr().out
    assert "amplitude [mm]" in said and " mm, " in said.splitlines()[0]
    assert call("report", tmp_path) == 0
    text = (tmp_path / "report.html").read_text()
    assert "amplitude [mm]" in text and "regularisation_velocity 0.05 mm/s" in text and "[m]" not in text


def test_it_goes_to_a_file_and_to_the_screen(runs, tmp_path: Path, capsys) -> None:
    printed = rows_of(capsys, runs["reduced"], "--pairs")
    assert call("probe", runs["reduced"], "--pairs", "--out", tmp_path / "pairs.csv") == 0
    said = capsys.readouterr().out
    assert "mode: point" in said and "2 rows" in said
    assert table_of((tmp_path / "pairs.csv").read_text()) == printed
    assert call("probe", runs["reduced"], "--node", 5) == 0
    screen = capsys.readouterr().out.splitlines()
    top = rows_of(capsys, runs["reduced"], "--node", 5, "--csv")[1]
    assert f"{top['y_amplitude']:.4g}" in screen[4] and f"{top['frequency_hz']:.6g}" in screen[4]
