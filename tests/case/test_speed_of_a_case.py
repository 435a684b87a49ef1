"""``[model] speed_rpm``: stiffness and loads of a case at the speed at which it turns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.linear_cases import KN, KT, K, M
from tolerances import ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.case.load import load_case
from fretwave.errors import CaseErrors

pytestmark = pytest.mark.ranks(1)

K2 = np.diag([0.2, 0.1, 0.3])
#: Presses the pair and pulls along it, not beyond friction.
F = np.array([3.0, 0.1, 0.2])
AT = 60.0


def omega2(rpm: float) -> float:
    return (2 * np.pi * rpm / 60) ** 2


def model(*keys: str) -> str:
    lines = ["[model]", 'dofs = ["n", "t", "m"]', f"M = {M.tolist()}", f"K = {K.tolist()}", *keys]
    contact = f"""
[[contact]]
name = "face"
law = "coulomb_2d"
pairs = ["n"]
tangents = ["t"]
normal_stiffness = {KN}
tangential_stiffness = {KT}
friction_coefficient = 0.8
normal_load = 0.0

[preload]
loads = ["centrifugal"]
"""
    return "\n".join(lines) + "\n" + contact


STATIC = '\n[[analysis]]\nname = "rest"\ntype = "static"\n'
INLINE = f"loads_at_speed = {{ centrifugal = {{ 60 = {F.tolist()} }} }}"
STIFFENS = f"at_speed = {{ 90 = {(K + omega2(90) * K2).tolist()} }}"


def put(folder: Path, text: str) -> Path:
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def row(folder: Path, path: Path, rpm: float) -> np.ndarray:
    """Normal and tangential force of the pair at rest at a speed."""
    out = folder / f"run_{rpm:g}"
    assert call("run", path, "--no-plots", "--out", out, "--set", f"model.speed_rpm={rpm}") == 0
    rest = fw.open_run(out)["rest"]
    return np.array([rest["normal_force"][0], rest["tangential_force"][0]])


def by_hand(load: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Forces of the closed and stuck pair."""
    x = np.linalg.solve(stiffness + np.diag([KN, KT, 0.0]), load)
    return np.array([KN * x[0], abs(KT * x[1])])


@pytest.mark.parametrize("rpm", [20.0, AT, 150.0])
def test_a_linear_state_at_rest_grows_with_the_square_of_the_speed(rpm, tmp_path):
    found = row(tmp_path, put(tmp_path, model(INLINE, "speed_rpm = 60.0") + STATIC), rpm)
    assert found == pytest.approx(omega2(rpm) / omega2(AT) * by_hand(F, K), rel=TIGHT)


@pytest.mark.parametrize("rpm", [45.0, 90.0])
def test_stiffness_of_the_speed_takes_the_loads_of_it(rpm, tmp_path):
    found = row(tmp_path, put(tmp_path, model(STIFFENS, INLINE, "speed_rpm = 60.0") + STATIC), rpm)
    assert found == pytest.approx(omega2(rpm) / omega2(AT) * by_hand(F, K + omega2(rpm) * K2), rel=TIGHT)


def test_at_the_speed_of_import_it_is_what_was_imported(tmp_path):
    path = put(tmp_path, model(STIFFENS, INLINE, "speed_rpm = 60.0") + STATIC)
    assert load_case(path).loads["centrifugal"] == pytest.approx(F, rel=ROUNDING)
    assert load_case(path, ["model.speed_rpm=90.0"]).K.toarray() == pytest.approx(K + omega2(90) * K2, rel=ROUNDING)
    assert not load_case(path, ["model.speed_rpm=0"]).loads["centrifugal"].any()


def test_three_speeds_are_fitted_and_what_is_left_is_said(tmp_path):
    """Least squares of w f2' = w f2 + s w^2, w = Omega^2: f2' = f2 + s sum w^3 / sum w^2."""
    w, extra = omega2(np.array([30.0, 60.0, 90.0])), np.array([0.0, 1e-4, 0.0])
    given = ", ".join(f"{rpm} = {(v / omega2(AT) * F + v**2 * extra).tolist()}" for rpm, v in zip((30, 60, 90), w))
    path = put(tmp_path, model(f"loads_at_speed = {{ centrifugal = {{ {given} }} }}", "speed_rpm = 75.0") + STATIC)
    case = load_case(path)
    f2 = F / omega2(AT) + extra * (w**3).sum() / (w**2).sum()
    assert case.loads["centrifugal"] == pytest.approx(omega2(75) * f2, rel=ROUNDING)
    (note,) = [note for note in case.notes if "'centrifugal'" in note]
    loads = [v / omega2(AT) * F + v**2 * extra for v in w]
    left = max(np.linalg.norm(f - v * f2) / np.linalg.norm(f) for v, f in zip(w, loads))
    assert f"leaves {100 * left:.2g} %" in note


def test_a_table_names_dofs_in_any_order_and_leaves_out_those_without_force(tmp_path):
    (tmp_path / "f.csv").write_text("dof,force [N],of\nt,0.1,drawn\nn,3.0,pressed\n", encoding="utf-8")
    text = model(INLINE.replace(str(F.tolist()), '"f.csv"'), "speed_rpm = 60.0") + STATIC
    assert load_case(put(tmp_path, text)).loads["centrifugal"] == pytest.approx([3.0, 0.1, 0.0], rel=ROUNDING)


BUILDER = f"""
import numpy as np
from fretwave import Structure

def build():
    return Structure(np.diag([2.0, 2.0, 1.0]), {K.tolist()}, names=["n", "t", "m"],
                     loads={{"pull": np.array({F.tolist()})}}, parts={{"spin": np.diag([0.2, 0.1, 0.3])}})
"""


def test_a_load_and_a_part_of_the_builder_are_taken_to_the_speed(tmp_path):
    (tmp_path / "model.py").write_text(BUILDER, encoding="utf-8")
    own = 'builder = "model.py"\nloads_at_speed = { centrifugal = { 60 = "pull" } }\nspeed_rpm = 120.0\n'
    text = "[model]\n" + own + model()[model().index("\n[[contact]]") :] + STATIC
    case = load_case(put(tmp_path, text))
    assert case.loads["centrifugal"] == pytest.approx(4 * F, rel=ROUNDING)
    assert case.K.toarray() == pytest.approx(K + omega2(120) * K2, rel=ROUNDING)


MODE = """
[[analysis]]
name = "mode"
type = "mode"
normalise = "t"
harmonics = 3
samples = 64
amplitude = [0.05, 1.0]
report_at = [0.9]

[[analysis]]
name = "forced"
type = "forced"
harmonics = 3
samples = 64
force = { t = 0.2 }
levels = [1.0]
frequency = [0.5, 0.9]
report_at = [0.7]
observe = "t"
"""


def test_a_nonlinear_mode_and_a_response_take_preload_stiffness_and_force_of_the_speed(tmp_path):
    """At 120 of 60 rev/min four times every load: the same tables as of the case with these numbers written."""
    grown = "loads_at_speed = { centrifugal = { 60 = [3.0, 0.0, 0.2] } }\nspeed_rpm = 120.0\nmass_damping = 0.05"
    turning = model(STIFFENS, grown).replace("normal_load = 0.0", "normal_load = 0.5\nload_rpm = 60.0")
    turning += MODE.replace("force = {", "force_rpm = 60.0\nforce = {")
    written = model("loads_at_speed = { centrifugal = { 120 = [12.0, 0.0, 0.8] } }\nspeed_rpm = 120.0")
    written = written.replace(str(K.tolist()), str((K + omega2(120) * K2).tolist()) + "\nmass_damping = 0.05")
    written = written.replace("normal_load = 0.0", "normal_load = 2.0") + MODE.replace("t = 0.2", "t = 0.8")
    found = []
    for name, text in (("turning", turning), ("written", written)):
        (tmp_path / name).mkdir()
        assert call("run", put(tmp_path / name, text), "--no-plots", "--out", tmp_path / name / "run") == 0
        run = fw.open_run(tmp_path / name / "run")
        point = run["mode"].at(0.9)[0]
        found.append([point["zeta"], point["omega"], point["slip"], run["forced"]["amplitude"].max()])
    assert found[0] == pytest.approx(found[1], rel=SOLVED) and found[0][2] > 0.1


def test_linear_modes_at_speeds_do_not_depend_on_that_of_the_case(tmp_path):
    linear = '\n[[analysis]]\nname = "linear"\ntype = "linear"\nspeeds_rpm = [0.0, 45.0, 90.0]\ncontact = ["free"]\n'
    for rpm in (0.0, 70.0):
        path = put(tmp_path, model(STIFFENS, INLINE, f"speed_rpm = {rpm}") + linear)
        assert call("run", path, "--no-plots", "--force", "--out", tmp_path / "run") == 0
        table = fw.open_run(tmp_path / "run")["linear"]
        for speed in (0.0, 45.0, 90.0):
            wanted = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K + omega2(speed) * K2)).real))
            assert table["omega"][table["speed_rpm"] == speed] == pytest.approx(wanted, rel=TIGHT)


def test_resume_refuses_another_speed(tmp_path, capsys):
    path = put(tmp_path, model(INLINE, "speed_rpm = 60.0") + STATIC)
    assert call("run", path, "--no-plots", "--out", tmp_path / "run") == 0
    put(tmp_path, path.read_text(encoding="utf-8").replace("speed_rpm = 60.0", "speed_rpm = 61.0"))
    assert call("resume", tmp_path / "run") == 2
    assert "model.speed_rpm: 60.0 then, 61.0 now" in capsys.readouterr().err


WRONG = {
    "no speed": (model(INLINE), "a speed that is not given", "add `speed_rpm = 60` to [model]"),
    "no dependence": (model("speed_rpm = 60.0"), "nothing of the model depends on its speed", "remove speed_rpm"),
    "not a speed": (model(INLINE.replace("60 =", "fast ="), "speed_rpm = 60.0"), "'fast' is no speed", "centrifugal"),
    "another size": (model(INLINE.replace("3.0, ", ""), "speed_rpm = 60.0"), "2 numbers", "one number for each dof"),
    "no number": (model(INLINE.replace("3.0, ", "nan, "), "speed_rpm = 60.0"), "a wrong value", "a finite number"),
    "endless": (model(INLINE.replace("3.0, ", "inf, "), "speed_rpm = 60.0"), "a wrong value", "a finite number"),
    "no file": (model(INLINE.replace(str(F.tolist()), '"f9.csv"'), "speed_rpm = 60.0"), "does not exist", "f9.csv"),
    "no load": (model(INLINE.replace(str(F.tolist()), '"pull"'), "speed_rpm = 60.0"), "no such load", "brings none"),
    "backwards": (model(INLINE, "speed_rpm = -60.0"), "model.speed_rpm", "a value >= 0"),
    "four speeds": (
        model("loads_at_speed = { centrifugal = { 1 = [], 2 = [], 3 = [], 4 = [] } }", "speed_rpm = 60.0"),
        "loads_at_speed",
        "at most 3",
    ),
    "no speed of a contact": (
        model().replace("normal_load = 0.0", "normal_load = 1.0\nload_rpm = 60.0").replace('["centrifugal"]', "[]"),
        "a speed that is not given",
        "add `speed_rpm = 60` to [model]",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_load_at_a_speed_is_refused(name, tmp_path):
    text, what, expected = WRONG[name]
    path = put(tmp_path, text.replace('["centrifugal"]', "[]") + STATIC)
    with pytest.raises(CaseErrors) as caught:
        load_case(path)
    said = str(caught.value)
    assert what in said and expected in said and said.count("fix:") == 1


def test_a_preload_of_a_load_that_cannot_be_read_is_no_second_error(tmp_path):
    text = model(INLINE.replace("3.0, ", ""), "speed_rpm = 60.0") + STATIC
    assert 'loads = ["centrifugal"]' in text
    with pytest.raises(CaseErrors) as caught:
        load_case(put(tmp_path, text))
    assert str(caught.value).count("fix:") == 1


@pytest.mark.parametrize(
    "table, line, what",
    [
        ("dof,force\nq,1.0\n", ":2", "is of no dof"),
        ("dof,force\nn,1.0\nn,2.0\n", ":3", "has a dof again"),
        ("dof,force\nn,much\n", ":2", "has no such value"),
        ("node,force\nn,1.0\n", ":1", "has other headings"),
        ("dof,force\nn,1,5\n", ":2", "has a line of more columns"),
    ],
)
def test_a_wrong_line_of_a_table_is_named(table, line, what, tmp_path):
    (tmp_path / "f.csv").write_text(table, encoding="utf-8")
    text = model(INLINE.replace(str(F.tolist()), '"f.csv"'), "speed_rpm = 60.0").replace('["centrifugal"]', "[]")
    with pytest.raises(CaseErrors) as caught:
        load_case(put(tmp_path, text + STATIC))
    said = str(caught.value)
    assert what in said and f"f.csv{line}" in said and said.count("fix:") == 1
