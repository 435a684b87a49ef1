"""Models built by Python: the contract of a builder, its errors, reduction, preload and static analysis in a run."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.chain_case import BUILDER, CHAIN
from test_resume import command, kill_at, rows, without_time
from tolerances import LAST_BIT, REPEATED, TIGHT

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors, InputError
from fretwave.model.reduction import Reduction, reduce

pytestmark = pytest.mark.ranks(1)

TEXT = (
    CHAIN.replace("modes = 12", "modes = 6").replace('pair_loads = false\nloads = ["weight"]\n', "")
    + """
[[analysis]]
name = "static"
type = "static"
preload = { pair_loads = false, loads = ["weight"] }
factors = [0.5, 1.0]

[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 128
normalise = "tip"
amplitude = [2e-7, 2.2e-6]
report_at = [1e-6, 1.8e-6, 2.1e-6]
"""
)
#: Differences between rank counts come from the order of additions.
RANK_TOLERANCE = 1e-9


@pytest.fixture
def write(tmp_path):
    """Write the case and its builder, with replacements in either."""

    def make(*changes: tuple[str, str], builder: str | None = None) -> Path:
        text, code = TEXT, BUILDER.read_text() if builder is None else builder
        for old, new in changes:
            assert old in text or old in code
            text, code = text.replace(old, new), code.replace(old, new)
        (tmp_path / "model.py").write_text(code)
        (tmp_path / "case.toml").write_text(text)
        return tmp_path / "case.toml"

    return make


def all_problems(path: Path, *overrides: str) -> list[InputError]:
    with pytest.raises(InputError) as caught:
        load_case(path, overrides)
    error = caught.value
    return error.problems if isinstance(error, CaseErrors) else [error]


def only_problem(path: Path, *overrides: str) -> InputError:
    problems = all_problems(path, *overrides)
    assert len(problems) == 1, problems
    return problems[0]


def table(folder: Path, name: str) -> list[dict[str, str]]:
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


def column(folder: Path, name: str, key: str) -> np.ndarray:
    return np.array([float(row[key]) for row in table(folder, name)])


# The contract


def test_parameters_come_from_the_case_then_the_builder(write) -> None:
    case = load_case(write())
    pads = case.contacts[0]
    assert (pads.n_pairs, pads.components, case.dof("tip")) == (2, 3, 16)
    assert np.array_equal(pads.parameters["normal_stiffness"], [1e7, 2e7])
    assert np.allclose(pads.parameters["tangential_stiffness"], 2e10 * 2e-4, rtol=LAST_BIT)
    assert pads.parameters["friction_coefficient"] == 0.4
    assert (case.structure.stiffness_damping, case.structure.mass_damping) == (0.0, 2.0)
    assert case.keep == [0, 1, 2, 15, 16, 17]
    assert "contact alone holds the structure" in case.notes[0]


def test_damping_has_shares_of_both_matrices(write) -> None:
    case = load_case(write(), ["model.stiffness_damping=1e-6"])
    wanted = 1e-6 * case.K + 2.0 * case.M
    assert abs(case.damping_with(()) - wanted).max() <= LAST_BIT * abs(wanted).max()


AS_BUILT = "write what the builder's build() takes for it"


def test_options_reach_the_builder_with_their_types(write) -> None:
    case = load_case(write(), ["model.options.masses=3", "model.options.mass=2", "model.options.tilt=[1, 2]"])
    assert len(case.dofs) == 9
    assert case.M[0, 0] == 2.0
    assert case.resolved["model.options.masses"] == 3


@pytest.mark.parametrize(
    ("override", "what", "fix"),
    [
        ("model.options.maas=2", "unknown option 'maas'", "did you mean `mass`?"),
        ("model.options.masses=2.5", "the option 'masses' has a wrong value", AS_BUILT),
        ('model.options.masses="3"', "the option 'masses' has a wrong value", AS_BUILT),
        ("model.options.mass=true", "the option 'mass' has a wrong value", AS_BUILT),
        ("model.options.masses=1", "the chain is too short", "lengthen it"),
        ("model.options.mass=-1", "the builder failed: ValueError: no mass", None),
    ],
)
def test_wrong_options(write, override: str, what: str, fix: str | None) -> None:
    problem = only_problem(write(), override)
    assert what in problem.what
    assert fix is None or problem.fix == fix
    if "option" in what:
        assert problem.where == f"--set {override}"
    else:
        sought = "too short" if "short" in what else "no mass"
        line = next(n for n, text in enumerate(BUILDER.read_text().splitlines(), 1) if sought in text)
        assert problem.where.endswith(f"model.py:{line}")


@pytest.mark.parametrize(
    ("changes", "what", "measured"),
    [
        ([("def build", "def built")], "the builder has no function build", None),
        ([("def build(", "def build(]")], "the builder failed: SyntaxError", None),
        ([("return Structure(", "return dict(")], "gave no usable model", "it returned dict"),
        ([('loads={"weight": weight}', 'loads={"weight": weight[1:]}')], "no usable model", "load 'weight'"),
        ([("np.full(2, AREA)", "np.full(3, AREA)")], "no usable model", "areas of contact 'pads'"),
        ([('dofs={"tip": n - 2}', 'dofs={"tip": n}')], "no usable model", "dof 'tip' has the number 18 of 18"),
        ([('builder = "model.py"', 'builder = "models.py"')], "there is no such builder", "models.py"),
        ([('builder = "model.py"', 'builder = "model.py"\nM = [[1.0]]')], "several places: builder, M", None),
        ([('name = "pads"\nlaw', 'name = "pad"\nlaw')], "the model has no contact 'pad'", None),
        ([('law = "coulomb_3d"', 'law = "coulomb_3d"\npairs = ["tip"]')], "brings the pairs of 'pads'", None),
        ([("per_area = 2e10", "per_area = 2e10\ntangential_stiffness = 1e6")], "given twice", None),
        ([("per_area = 2e10", "per_ara = 2e10")], "unknown key 'tangential_stiffness_per_ara'", None),
        ([('loads = ["weight"]', 'loads = ["wait"]')], "is no load of the model", "wait"),
        ([('loads = ["weight"]', 'loads = ["weight", "weight"]')], "is named twice, and would act twice", "weight"),
        ([("modes = 6", "modes = 6\nup_to_hz = 400.0")], "is given beside modes", "400"),
        ([('preload = { pair_loads = false, loads = ["weight"] }\n', "")], "has no load to act on", "[0.5, 1.0]"),
        ([('normalise = "tip"', 'normalise = "top"')], "unknown dof 'top'", None),
    ],
)
def test_what_is_wrong_is_named(write, changes, what: str, measured: str | None) -> None:
    problem = next(problem for problem in all_problems(write(*changes)) if what in problem.what)
    assert what in problem.what
    assert measured is None or measured in str(problem.measured)
    assert problem.where


def test_law_must_fit_the_pairs(write) -> None:
    change = 'law = "coulomb_3d"\nfriction_coefficient = 0.4\ntangential_stiffness_per_area = 2e10'
    problem = only_problem(write((change, 'law = "jenkins"\ntangential_stiffness = 1e6\nfriction_limit = 3.0')))
    assert problem.measured == "jenkins has 1, the pairs have 3 components"


def test_time_integration_refuses_a_preload(write) -> None:
    extra = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "mode"\namplitude = [1e-6]\nperiods = 3\n'
    found = all_problems(write(('\n[[analysis]]\nname = "mode"', f'\n{extra}\n[[analysis]]\nname = "mode"')))
    preload, law = (problem.what for problem in found)
    assert "time integration, which does not know a preload" in preload
    assert "time integration, which does not know the law 'coulomb_3d' of contact 'pads'" in law


# Runs


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    shutil.copy(BUILDER, folder / "model.py")
    (folder / "case.toml").write_text(TEXT)
    assert call("run", str(folder / "case.toml"), "--out", str(folder / "run")) == 0
    return folder / "run"


def test_static_forces_carry_the_weight(run: Path) -> None:
    factor, normal = column(run, "static", "factor"), column(run, "static", "normal_force")
    for value in (0.5, 1.0):
        assert normal[factor == value].sum() == pytest.approx(30.0 * value, rel=TIGHT)
    assert {row["status"] for row in table(run, "static")} == {"stick"}
    assert np.all(column(run, "static", "gap") == 0)


def test_stuck_part_of_the_mode_is_linear(run: Path) -> None:
    """omega0 is that of the linear mode with closed contact, beta = alpha / 2 for C = alpha M."""
    case = load_case(run.parent / "case.toml")
    spec = case.contacts[0]
    kn, kt = (np.broadcast_to(spec.parameters[f"{name}_stiffness"], 2) for name in ("normal", "tangential"))
    springs = np.column_stack([kn, kt, kt]).ravel()
    B, K, M = spec.pairs.own.toarray(), case.K.toarray(), case.M.toarray()
    omega = np.sqrt(np.linalg.eigvalsh((K + B.T @ np.diag(springs) @ B) / M[0, 0])[0])
    with h5py.File(run / "results.h5") as file:
        stuck = file["mode"].attrs["stuck_omega"]
        error = json.loads(file["mode"].attrs["reduction"])
    assert abs(stuck / omega - 1) <= max(error["relative"][0] * 1.01, 1e-10)
    stick = column(run, "mode", "stick") == 1
    assert stick.sum() > 2
    assert np.abs(column(run, "mode", "omega0")[stick] / stuck - 1).max() < REPEATED
    assert np.abs(column(run, "mode", "beta")[stick] - 1).max() < REPEATED


def test_slip_lowers_the_frequency_and_damps(run: Path) -> None:
    omega, zeta, slip = (column(run, "mode", key) for key in ("omega", "zeta", "slip"))
    assert slip[-1] > 0.1
    assert omega[-1] < omega[0] and zeta[-1] > 2 * zeta[0]


def test_reduction_is_reported(run: Path) -> None:
    record = json.loads((run / "run.json").read_text())["reduction"]
    assert (record["unreduced"], record["kept"], record["component_modes"]) == (18, 6, 6)
    assert min(record["relative"]) > -1e-10
    assert 0 < max(record["relative"]) < 0.1
    assert "reduction: 18 dofs to 6 kept and 6 component modes" in (run / "run.log").read_text()


def test_error_at_an_amplitude_is_the_difference_to_the_unreduced_model(write, tmp_path: Path) -> None:
    """Estimated at one nonlinear point, in partial slip; within a factor 2 of the true change."""
    out = [tmp_path / "whole", tmp_path / "reduced"]
    omega = []
    for folder, text in zip(out, ("", "[reduction]\nmodes = 8\nerror_at = 2.1e-6\n")):
        changed = write(("[reduction]\nmodes = 6\n", text))
        assert call("run", str(changed), "--only", "mode", "--no-plots", "--out", str(folder)) == 0
        amplitude, found = column(folder, "mode", "amplitude"), column(folder, "mode", "omega")
        omega.append(float(found[np.argmin(np.abs(amplitude - 2.1e-6))]))
    estimate = json.loads((out[1] / "run.json").read_text())["analyses"]["mode"]["reduction_error"]
    assert estimate["amplitude"] == pytest.approx(2.1e-6)
    change = omega[0] - omega[1]
    assert abs(change) > 1e-7 * omega[0]
    assert 0.5 < estimate["omega"] / change < 2
    assert "the unreduced model would change omega" in (out[1] / "run.log").read_text()


@pytest.mark.parametrize("kept, made", [(1e9, 1), (0, 2)])
def test_an_error_of_the_reduction_makes_a_small_one_once(write, tmp_path: Path, monkeypatch, kept, made) -> None:
    """Modes that are too large to keep are made again for it."""
    times = []

    def counted(*arguments, **options):
        times.append(options)
        return reduce(*arguments, **options)

    monkeypatch.setattr("fretwave.model.reduction.reduce", counted)
    monkeypatch.setattr("fretwave.case.reduce.KEPT", kept)
    case = str(write(("[reduction]\nmodes = 6\n", "[reduction]\nmodes = 8\nerror_at = 2.1e-6\n")))
    assert call("run", case, "--only", "mode", "--no-plots", "--out", str(tmp_path / "out")) == 0
    assert len(times) == made
    assert "reduction_error" in json.loads((tmp_path / "out" / "run.json").read_text())["analyses"]["mode"]


@pytest.mark.parametrize("wrong, ended", [("", 0), ("-mode_nonsense 3", 2)])
def test_a_kept_reduction_is_freed_however_the_run_ends(write, tmp_path: Path, monkeypatch, wrong, ended) -> None:
    freed, destroy = [], Reduction.destroy
    monkeypatch.setattr(Reduction, "destroy", lambda self: (freed.append(self), destroy(self)))
    case = str(write(("[reduction]\nmodes = 6\n", "[reduction]\nmodes = 8\nerror_at = 2.1e-6\n")))
    out = ["--no-plots", "--out", str(tmp_path / "out")]
    assert call("run", case, "--only", "mode", "--petsc", wrong, *out) == ended
    assert len(freed) == 1


def test_pictures_show_the_pairs(run: Path) -> None:
    names = {"mode_map_pads.png", "mode_hysteresis_pads.png", "static_load_pads.png", "mode_backbone.png"}
    assert names <= {path.name for path in run.glob("*.png")}


def test_component_modes_up_to_a_frequency(write, tmp_path: Path) -> None:
    arguments = ("run", str(write(("modes = 6", "up_to_hz = 500.0"))), "--only", "static", "--no-plots")
    assert call(*arguments, "--out", str(tmp_path / "run")) == 0
    report = json.loads((tmp_path / "run" / "run.json").read_text())["reduction"]
    assert 0 < report["component_modes"] < 12 and report["highest_component_hz"] < 500.0


def test_all_component_modes_change_nothing(write, tmp_path: Path) -> None:
    path, out = write(), [tmp_path / "whole", tmp_path / "reduced"]
    whole = write(("[reduction]\nmodes = 6\n", "")).read_text()
    (tmp_path / "case.toml").write_text(whole)
    assert call("run", str(path), "--out", str(out[0]), "--no-plots") == 0
    write(("modes = 6", "modes = 12"))
    assert call("run", str(path), "--out", str(out[1]), "--no-plots") == 0
    for key in ("omega", "zeta"):
        one, other = (np.interp(1e-6, column(o, "mode", "amplitude"), column(o, "mode", key)) for o in out)
        assert one == pytest.approx(other, rel=REPEATED)


def test_two_ranks_give_the_same(run: Path, launch, tmp_path: Path) -> None:
    case = run.parent / "case.toml"
    done = launch(2, "-m", "fretwave", "run", str(case), "--no-plots", "--out", str(tmp_path / "two"))
    assert done.returncode == 0, done.stderr
    for name, keys in (("mode", ("omega", "zeta")), ("static", ("normal_force",))):
        for key in keys:
            one, two = column(run, name, key), column(tmp_path / "two", name, key)
            assert np.abs(two / one - 1).max() < RANK_TOLERANCE


def test_a_changed_builder_is_a_changed_case(write, tmp_path: Path, capsys) -> None:
    path, out = write(), tmp_path / "run"
    assert call("run", str(path), "--only", "static", "--out", str(out), "--set", "model.options.weight=10") == 0
    assert column(out, "static", "normal_force")[-2:].sum() == pytest.approx(10.0, rel=TIGHT)
    assert call("resume", str(out)) == 0
    write(("AREA = 4e6, 2e-4", "AREA = 5e6, 2e-4"))
    capsys.readouterr()
    assert call("resume", str(out)) == 2
    said = capsys.readouterr().err
    assert "the case has changed" in said and "model.builder: " in said


def test_a_killed_run_goes_on_with_its_options(write, tmp_path: Path) -> None:
    """The model is built again with the options of the command line, and the preload solved again."""
    path = write(
        ("report_at = [1e-6, 1.8e-6, 2.1e-6]", "report_at = [1e-6]\nstep = { initial = 0.005, maximum = 0.01 }")
    )
    weight = ("--set", "model.options.weight=29")
    start = [command("run", str(path), "--out", str(tmp_path / name), *weight) for name in ("whole", "killed")]
    subprocess.run(start[0], check=True, stdout=subprocess.DEVNULL)
    expected = rows(tmp_path / "whole", "mode")
    assert kill_at(start[1], tmp_path / "killed" / "mode.csv", len(expected) // 2) < len(expected)
    subprocess.run(command("resume", str(tmp_path / "killed")), check=True, stdout=subprocess.DEVNULL)
    for name in ("static", "mode"):
        assert without_time(rows(tmp_path / "killed", name)) == without_time(rows(tmp_path / "whole", name))


def test_nothing_holds_a_lifted_chain(write, tmp_path: Path, capsys) -> None:
    """Pulled upwards there is no static state: exit code 3, with the reason and what to do."""
    arguments = ("run", str(write()), "--only", "static", "--no-plots", "--out", str(tmp_path / "run"))
    lifted = ("--set", "model.options.weight=-30", "--set", "contact.pads.normal_load=0")
    assert call(*arguments, *lifted) == 3
    said = capsys.readouterr().err
    assert "'static' stopped early" in said and "hold the structure where contact alone cannot" in said


@pytest.mark.parametrize("gaps", [(0.0, 1e-6), (1e-6, 0.0), (0.0, 1e-4), (0.0, -1e-7)])
def test_pairs_that_only_touch_hold_a_chain_beside_gaps(gaps: tuple[float, float], write, tmp_path: Path) -> None:
    """One pad touches without load, the other is apart or presses: K x + kn max(0, x - gap) = P along the chain."""
    arguments = ("run", str(write()), "--only", "static", "--no-plots", "--out", str(tmp_path / "run"))
    apart = ("--set", f"contact.pads.gap={list(gaps)}", "--set", "static.preload.balanced=false")
    assert call(*arguments, *apart) == 0
    K = 4e6 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    K[0, 0] = K[5, 5] = 4e6
    stiffness, places, x = np.array([1e7, 2e7]), [0, 5], np.ones(6)
    for _ in range(4):  # the pads that are closed
        closed = np.where(x[places] > gaps, stiffness, 0.0)
        added, f = np.zeros((6, 6)), np.full(6, 5.0)
        added[places, places], f[places] = closed, f[places] + closed * gaps
        x = np.linalg.solve(K + added, f)
    found = column(tmp_path / "run", "static", "normal_force")[-2:]
    assert found == pytest.approx(np.maximum(0.0, stiffness * (x[places] - gaps)), rel=TIGHT)


@pytest.mark.parametrize("law", ["unilateral_spring", "coulomb_2d"])
def test_an_interference_alone_moves_the_structure(law: str, tmp_path: Path) -> None:
    """Neither loads nor pair loads, not balanced: k x + kn (x - gap) = 0, with k kn / (k + kn) |gap| in the pair."""
    friction = 'friction_coefficient = 0.3\ntangential_stiffness = 1e3\ntangents = ["b"]\n'
    (tmp_path / "case.toml").write_text(
        '[model]\ndofs = ["a", "b"]\nM = [[1.0, 0.0], [0.0, 1.0]]\nK = [[1e3, 0.0], [0.0, 1e3]]\n\n'
        f'[[contact]]\nlaw = "{law}"\npairs = ["a"]\nnormal_stiffness = 3e3\ngap = -1e-3\n'
        + (friction if law == "coulomb_2d" else "")
        + '\n[preload]\npair_loads = false\nbalanced = false\n\n[[analysis]]\nname = "static"\ntype = "static"\n'
    )
    assert call("run", str(tmp_path / "case.toml"), "--no-plots", "--out", str(tmp_path / "run")) == 0
    assert column(tmp_path / "run", "static", "normal_force") == pytest.approx([0.75], rel=TIGHT)
    assert column(tmp_path / "run", "static", "tangential_force").tolist() == [0.0]


def test_a_mode_needs_a_held_structure(write, tmp_path: Path, capsys) -> None:
    arguments = ("run", str(write()), "--only", "mode", "--no-plots", "--out", str(tmp_path / "run"))
    assert call(*arguments, "--set", "preload.pair_loads=false") == 2
    said = capsys.readouterr().err
    assert "linear mode 1 is a rigid motion" in said and "100 % of the pairs open at rest" in said
    assert not (tmp_path / "run").exists()


def test_weight_or_equal_pair_loads_give_the_same_threshold(write, tmp_path: Path) -> None:
    """The weight presses both pads almost alike (14.5 and 15.5 N for 15 and 15)."""
    found = []
    for name, preload in (("given", ()), ("solved", ("preload.pair_loads=false", 'preload.loads=["weight"]'))):
        words = [word for setting in preload for word in ("--set", setting)]
        assert call("run", str(write()), "--only", "mode", "--no-plots", "--out", str(tmp_path / name), *words) == 0
        stick, amplitude = (column(tmp_path / name, "mode", key) for key in ("stick", "amplitude"))
        found.append(amplitude[stick == 1].max())
    assert found[1] == pytest.approx(found[0], rel=0.1)
