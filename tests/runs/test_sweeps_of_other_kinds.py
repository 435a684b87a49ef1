"""Sweeps of linear modes, wear, states at rest and motions in time: a summary of each value, quantiles over draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.csv_columns import column, rows
from models.linear_cases import POINT, ring
from models.swept_case import CASE, MEMORYLESS
from models.wear_case import write_case
from tolerances import REPEATED, SOLVED

from fretwave.columns import Column
from fretwave.post.grid import Plan
from fretwave.results.file import rewritten
from fretwave.results.sweep_quantiles import quantile_lines

pytestmark = pytest.mark.ranks(1)

SECTORS = 6
#: A mass that its contact alone holds along the tangent.
PULLED = """
import numpy as np, scipy.sparse as sp, fretwave as fw

def build(force):
    K = sp.csr_matrix(np.diag([1.0, 1e-14]))
    return fw.Structure(sp.eye(2, format="csr"), K, dofs={"n": 0, "t": 1}, loads={"pull": np.array([0.0, force])})
"""
PULLED_FACE = """
[[contact]]
name = "face"
law = "coulomb_2d"
pairs = ["n"]
tangents = ["t"]
normal_stiffness = 3.0
tangential_stiffness = 2.0
friction_coefficient = 0.5
normal_load = 4.0

[[analysis]]
name = "rest"
type = "static"
factors = [0.5, 1.0, 1.5]
"""


def swept(folder: Path, text: str, over: str, *only: str, exit_code: int = 0) -> Path:
    """The run; summaries are of the last of the analyses."""
    (folder / "case.toml").write_text(text)
    words = ["--over", over, "--only", ",".join(only), "--out", folder / "run"]
    assert call("sweep", folder / "case.toml", *words) == exit_code
    return folder / "run"


def test_how_far_mistuning_amplifies_over_draws(tmp_path: Path, capsys) -> None:
    """Of each draw what its own table says; the quantile over all is an order statistic of these."""
    keys = 'wheel = true\nobserve = "mass"\nengine_order = 2\nmodes = 1\ncontact = ["stuck"]\n'
    plain = ring(SECTORS).replace("speed_rpm = 6.0\n", "").replace("C = [[0.01, 0.0], [0.0, 0.0]]\n", "")
    text = f'{plain}{keys}mistuning = {{ standard_deviation = 0.03 }}\n[damping]\nzeta = 0.004\ncontact = "stuck"\n'
    run = swept(tmp_path, text, "linear.mistuning.seed=1:21", "linear")
    tables = [run / f"values/{number:04d}" for number in range(21)]
    own = np.array([column(folder / "linear_amplification.csv", "amplification")[0] for folder in tables])
    assert np.array_equal(column(run / "summary.csv", "amplification_stuck_1"), own)
    hz = [column(folder / "linear.csv", "frequency_hz") for folder in tables]
    assert np.array_equal(column(run / "summary.csv", "hz_stuck_3"), [one[2] for one in hz])
    (median,) = rows(run / "linear_quantiles.csv", quantity="amplification_stuck_1", q="0.5")
    assert float(median["value"]) == np.sort(own)[10]
    assert call("show", run) == 0
    shown = capsys.readouterr().out
    assert f"linear: amplification_stuck_1: 5 % {np.sort(own)[0]:.3g}"[:38] in shown
    assert (run / "linear_quantiles.png").is_file()


def test_linear_frequencies_in_closed_form(tmp_path: Path, capsys) -> None:
    """m = k = 1 and a slider's own stiffness beside k."""
    linear = '[[analysis]]\nname = "linear"\ntype = "linear"\n'
    run = swept(tmp_path, CASE + linear, "contact.slider.tangential_stiffness=0.5,1.0,3.0", "linear")
    stiffness = np.array([0.5, 1.0, 3.0])
    assert column(run / "summary.csv", "hz_stuck_1") == pytest.approx(np.sqrt(1 + stiffness) / (2 * np.pi), rel=SOLVED)
    assert column(run / "summary.csv", "hz_free_1") == pytest.approx(1 / (2 * np.pi), rel=SOLVED)
    assert (
        "linear: tangential_stiffness = 3.0 N/m: stuck 1 mode 0.31831 Hz, free 1 mode 0.159155 Hz"
        in capsys.readouterr().out
    )
    with rewritten(run / "results.h5", "none") as file:  # as an earlier version wrote it
        for name in ("hz_stuck_1", "hz_free_1"):
            del file[f"linear/summary/{name}"]
    assert call("show", run) == 0
    assert "linear: tangential_stiffness = 3.0 N/m: 2 points" in capsys.readouterr().out


def test_values_with_fewer_modes_than_others_are_shown_as_they_were_told(tmp_path: Path, capsys) -> None:
    """In results.h5 nan stands for the modes that they lack: these were counted."""
    linear = '[[analysis]]\nname = "linear"\ntype = "linear"\n'
    run = swept(tmp_path, CASE + linear, 'linear.contact=["stuck"],["stuck","free"]', "linear")
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("linear: contact")]
    assert [line.rpartition(": ")[2] for line in told] == [
        "stuck 1 mode 0.225079 Hz",
        "stuck 1 mode 0.225079 Hz, free 1 mode 0.159155 Hz",
    ]
    assert call("show", run) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if line in told] == told


def test_wear_by_amplitude(tmp_path: Path, capsys) -> None:
    """First and last row of each amplitude, and the volume of all faces."""
    path = write_case(tmp_path)
    run = tmp_path / "run"
    assert call("sweep", path, "--over", "wear.coefficient=1e-13,2e-13", "--only", "mode,wear", "--out", run) == 0
    summary = run / "summary.csv"
    assert len(rows(summary, analysis="wear")) == 6
    for value in range(2):
        table = run / f"values/{value:04d}/wear.csv"
        for line in range(3):
            mine = {"line": str(line)}
            found = {"value": str(value), "analysis": "wear", **mine}
            assert column(summary, "done", **found) == 1
            for name, key, row in (("new", "zeta", 0), ("last", "zeta", -1), ("last", "frequency_hz", -1)):
                assert column(summary, f"{name}_{key}", **found)[0] == column(table, key, **mine)[row]
            faces = [key for key in rows(table)[0] if key.startswith("worn_")]
            volume = sum(column(table, key, **mine)[-1] for key in faces)
            assert column(summary, "worn_volume", **found)[0] == pytest.approx(volume, rel=REPEATED)
            assert (volume > 0) == (line > 0)  # the first amplitude does not slip
    shown = capsys.readouterr().out
    assert "wear: coefficient = 2e-13 1/Pa, line 2: a = 3e-06 m: zeta" in shown and "after 8 cycles" in shown


@pytest.mark.parametrize(
    "over", ["wear.coefficient=1e-13,2e-13", "contact.pads.friction_coefficient=0.4,0.8"], ids=["k_w", "mu"]
)
def test_wear_after_other_numbers_of_vibrations_is_said(tmp_path: Path, capsys, over: str) -> None:
    """A normalised cycle is 1 / (k_w mean(kn / I) 4 mean(mu N / kt)) unless it is given: another one for each value."""
    path, words = write_case(tmp_path), ["--over", over, "--only", "mode,wear", "--set", "wear.amplitude=[2e-6]"]
    own, given = tmp_path / "own", tmp_path / "given"
    assert call("sweep", path, *words, "--out", own) == 0
    one = 1 / (1e-13 * 1.5e7 / 2e-4 * 4 * 0.4 * 15.0 / 4e6)
    assert column(own / "summary.csv", "cycle_unit", analysis="wear") == pytest.approx([one, one / 2], rel=SOLVED)
    note = "wear: a normalised cycle is 1.111e+07 to 2.222e+07 vibrations, by the value"
    assert note in capsys.readouterr().out
    assert call("show", own) == 0 and note in capsys.readouterr().out
    assert call("sweep", path, *words, "--set", "wear.cycle_unit=1e7", "--out", given) == 0
    assert column(given / "summary.csv", "cycle_unit", analysis="wear").tolist() == [1e7, 1e7]
    assert "a normalised cycle is" not in capsys.readouterr().out


def test_states_at_rest(tmp_path: Path, capsys) -> None:
    """One closed pair, which bears its load."""
    text = POINT + '[[analysis]]\nname = "rest"\ntype = "static"\n'
    run = swept(tmp_path, text, "contact.face.normal_load=1.0,2.5", "rest")
    assert column(run / "summary.csv", "smallest_normal_force") == pytest.approx([1.0, 2.5], rel=SOLVED)
    assert column(run / "summary.csv", "normal_force") == pytest.approx([1.0, 2.5], rel=SOLVED)
    assert column(run / "summary.csv", "open_share").tolist() == [0.0, 0.0]
    assert "rest: normal_load = 2.5 N, factor 1: 0 % of the pairs slip, 0 % are open" in capsys.readouterr().out


def test_factors_that_are_solved_came_to_their_end(tmp_path: Path) -> None:
    """A pair alone holds t up to mu N = 2: beyond it nothing is in balance, whatever the factors before it say."""
    (tmp_path / "model.py").write_text(PULLED)
    text = '[model]\nbuilder = "model.py"\n[preload]\nloads = ["pull"]\n' + PULLED_FACE
    run = swept(tmp_path, text, "model.options.force=1.0,1.5", "rest", exit_code=3)
    summary = run / "summary.csv"
    assert column(summary, "factor").tolist() == [0.5, 1.0, 1.5, 0.5, 1.0]
    assert column(summary, "done").tolist() == [1, 1, 1, 1, 1]
    assert column(summary, "normal_force") == pytest.approx(5 * [4.0], rel=SOLVED)


def test_decays_by_start(tmp_path: Path, capsys) -> None:
    """Beyond slip by a weak limit the decay is nearly that of the damper: half of it after log 2 / (zeta omega)."""
    c = 0.02
    text = CASE.replace(*MEMORYLESS).replace("friction_limit = 1.0", "friction_limit = 1e-6", 1)
    text = text.replace("K = [[1.0]]\n", f"K = [[1.0]]\nC = [[{c}]]\n")
    decay = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [10.0, 20.0]\nperiods = 20\n'
    run = swept(tmp_path, text + decay, "model.C=[[0.02]],[[0.04]]", "mode", "decay")
    half = column(run / "summary.csv", "half_time", analysis="decay")
    assert half == pytest.approx(2 * np.log(2.0) / np.array([c, c, 2 * c, 2 * c]), rel=1e-5)
    zeta = column(run / "summary.csv", "largest_zeta", analysis="decay")
    assert zeta == pytest.approx(np.array([c, c, 2 * c, 2 * c]) / 2, rel=1e-4)
    assert "decay: C = [[0.04]] N s/m, start 1: half of it after 34.65" in capsys.readouterr().out


def test_damping_is_that_of_cycles_between_others(tmp_path: Path, capsys) -> None:
    """Damped by 45 %, more by friction: two cycles above the noise, of which the first one's decrement is -12 %."""
    text = CASE.replace(*MEMORYLESS).replace("friction_limit = 1.0", "friction_limit = 0.05", 1)
    text = text.replace("K = [[1.0]]\n", "K = [[1.0]]\nC = [[0.9]]\n")
    decay = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [4.0]\nperiods = 20\n'
    run = swept(tmp_path, text + decay, "model.C=[[0.01]],[[0.9]]", "mode", "decay")
    zeta = column(run / "summary.csv", "largest_zeta", analysis="decay")
    assert np.isnan(zeta[1]) and zeta[0] > 0.005
    for value in range(2):
        cycles = column(run / f"values/{value:04d}/decay.csv", "zeta")
        assert len(cycles) < 3 if np.isnan(zeta[value]) else zeta[value] == cycles[1:-1].max()
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("decay: C = [[0.9]]")]
    assert "zeta" not in line and line.endswith(" at the end")


def test_what_no_draw_has_is_said(tmp_path: Path, capsys) -> None:
    """Motions that grow settle on no limit cycle, with any draw: nothing was told of them at all."""
    text = CASE.replace(*MEMORYLESS).replace("friction_limit = 1.0", "friction_limit = 0.05", 1)
    text = text.replace("K = [[1.0]]\n", "K = [[1.0]]\nC = [[-0.02]]\n")
    cycle = '[[analysis]]\nname = "ends"\ntype = "limit_cycle"\nmode = "mode"\namplitude = [9.0]\nperiods = 12\n'
    limits = '{ distribution = "uniform", low = 0.9, high = 1.1 }'
    drawn = f"[uncertainty]\nfactors.contact.slider.friction_limit = {limits}\n"
    run = swept(tmp_path, drawn + text + cycle, "uncertainty.seed=1:3", "mode", "ends")
    said = "ends: no value that came to its end has limit_cycle, limit_cycle_hz"
    assert said in capsys.readouterr().out
    assert call("show", run) == 0
    assert said in capsys.readouterr().out


def test_an_analysis_that_finds_nothing_is_named(tmp_path: Path, capsys) -> None:
    """Fed by 45 % of damping all motions leave before four cycles: the sweep ended without a word of them."""
    text = CASE.replace(*MEMORYLESS).replace("friction_limit = 1.0", "friction_limit = 0.05", 1)
    text = text.replace("K = [[1.0]]\n", "K = [[1.0]]\nC = [[-0.9]]\n")
    decay = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [4.0]\nperiods = 20\n'
    over = '[[analysis]]\nname = "own"\ntype = "sweep"\nof = "decay"\nover.model.C = [[[-0.8]], [[-0.9]]]\n'
    swept(tmp_path, text + decay + over, "contact.slider.friction_limit=0.05,0.06", "mode", "decay")
    assert "decay: nothing was found with any of the values" in capsys.readouterr().out
    call("run", tmp_path / "case.toml", "--only", "own", "--out", tmp_path / "own")
    assert "own: nothing was found with any of the values" in capsys.readouterr().out


def test_limit_cycles_by_start(tmp_path: Path, capsys) -> None:
    """Negative damping against the friction of a weak limit: Coulomb's amplitude 4 F / (pi |c| omega) is unstable.

    The start below it comes to rest or stays, the one above grows; none settles.
    """
    text = CASE.replace(*MEMORYLESS).replace("friction_limit = 1.0", "friction_limit = 0.05", 1)
    text = text.replace("K = [[1.0]]\n", "K = [[1.0]]\nC = [[-0.01]]\n")
    cycle = '[[analysis]]\nname = "ends"\ntype = "limit_cycle"\nmode = "mode"\namplitude = [5.0, 8.0]\nperiods = 12\n'
    run = swept(tmp_path, text + cycle, "contact.slider.friction_limit=0.05,0.052", "mode", "ends")
    own = {"analysis": "ends"}
    assert column(run / "summary.csv", "settled", **own).tolist() == [0, 0, 0, 0]
    assert np.isnan(column(run / "summary.csv", "limit_cycle", **own)).all()
    last = column(run / "summary.csv", "last_amplitude", **own)
    unstable = 4 * np.array([0.05, 0.05, 0.052, 0.052]) / (np.pi * 0.01)
    assert np.array_equal(last > unstable, [False, True, False, True])
    assert "ends: friction_limit = 0.052 N, start 1: no limit cycle" in capsys.readouterr().out


def test_of_many_modes_the_lowest_are_told_and_where_the_others_stand(tmp_path: Path, capsys) -> None:
    """A wheel has hundreds: each had a line. Of 24 modes six, of waves of which each has two modes the first."""
    text = ring(24).replace("speed_rpm = 6.0\n", "wheel = true\nmistuning = { standard_deviation = 0.03 }\n")
    run = swept(tmp_path, text, "linear.mistuning.seed=1:3", "linear")
    said = [line for line in capsys.readouterr().out.splitlines() if "] Hz (n = 3)" in line]
    assert [line.split(": ")[1] for line in said] == [f"hz_{c}_{k}" for c in ("stuck", "free") for k in range(1, 7)]
    assert len({row["quantity"] for row in rows(run / "linear_quantiles.csv")}) == 48
    plan, waves = Plan({"a.seed": [1, 2, 3]}), range(25)
    names = [f"hz_{contact}_{k}" for contact in ("stuck", "free") for k in (1, 2)]
    table = [
        {"value": k, "nodal_diameter": d, "done": 1, **dict.fromkeys(names, k + d)} for k in range(3) for d in waves
    ]
    lines = quantile_lines("linear", plan, table, [Column(name, "Hz", name) for name in names], "nodal_diameter")
    assert sum("n = 3" in line for line in lines) == 50
    assert "linear: hz_stuck_2, hz_free_2: see linear_quantiles.csv" in lines


def test_no_quantile_of_what_is_cut_off(tmp_path: Path) -> None:
    """Draws whose decay does not reach its half have no time of it: the median of the others would be too small."""
    text = CASE.replace(*MEMORYLESS).replace("friction_limit = 1.0", "friction_limit = 1e-6", 1)
    text = text.replace("K = [[1.0]]\n", 'K = [[1.0]]\nbuilder = "damped.py"\n')
    text = text.replace("K = [[1.0]]\n", "").replace("M = [[1.0]]\n", "").replace('dofs = ["x"]\n', "", 1)
    (tmp_path / "damped.py").write_text(
        "import fretwave as fw, numpy as np\n"
        "def build(c=0.02):\n"
        "    return fw.Structure(M=np.eye(1), K=np.eye(1), C=c * np.eye(1), dofs={'x': 0})\n"
    )
    drawn = 'values.model.options.c = { distribution = "uniform", low = 0.005, high = 0.03 }\n'
    decay = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [10.0]\nperiods = 12\n'
    text = text.replace('builder = "damped.py"\n', 'builder = "damped.py"\noptions = { c = 0.02 }\n')
    run = swept(tmp_path, f"{text}{decay}[uncertainty]\n{drawn}", "uncertainty.seed=1:6", "mode", "decay")
    half = column(run / "summary.csv", "half_time", analysis="decay")
    assert 0 < np.isnan(half).sum() < 6
    told = {row["quantity"] for row in rows(run / "decay_quantiles.csv")}
    assert told == {"largest_zeta", "last_amplitude"}
    words = ["--over", "uncertainty.seed=1:6", "--only", "mode,decay", "--set", "decay.periods=60"]
    assert call("sweep", tmp_path / "case.toml", *words, "--out", tmp_path / "long") == 0
    assert {"half_time"} < {row["quantity"] for row in rows(tmp_path / "long" / "decay_quantiles.csv")}
