"""Case files: what is read, and that every wrong entry is named with line, value, expectation and fix."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from fretwave.case.load import Case, changed_keys, load_case
from fretwave.case.toml.locate import Locator
from fretwave.errors import CaseErrors, FretwaveError, InputError
from fretwave.model.structure import Structure
from fretwave.results.model_file import write_model

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
TEXT = CASE.read_text(encoding="utf-8")
LINEAR = '[[analysis]]\nname = "a"\ntype = "linear"\n'


@pytest.fixture
def write(tmp_path):
    """Write the committed case with replacements; `load` it to see what is said."""

    def make(*changes: tuple[str, str]) -> Path:
        text = TEXT
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return make


def problems(path: Path, *overrides: str, quick: bool = False) -> list[FretwaveError]:
    with pytest.raises(InputError) as caught:
        load_case(path, overrides, quick)
    error = caught.value
    return error.problems if isinstance(error, CaseErrors) else [error]


def line_of(path: Path, text: str) -> int:
    return next(n for n, line in enumerate(path.read_text().splitlines(), 1) if text in line)


def test_committed_case_is_read() -> None:
    case = load_case(CASE)
    assert case.name == "two_dof"
    assert case.dofs == ["m1", "m2"]
    assert np.array_equal(case.K.toarray(), [[640.0, -40.0], [-40.0, 40.0]])
    assert case.C is None
    assert list(case.analyses)[:3] == ["mode", "mode_epmc", "flutter"]
    assert case.damping_with(case.analyses["flutter"].dampers)[0, 0] == -2 * 0.02 * np.sqrt(640.0)
    assert np.array_equal(case.contacts[0].pairs.own.toarray(), [[0.0, 1.0]])
    assert case.notes == []


def test_quick_form_is_valid() -> None:
    assert load_case(CASE, quick=True).resolved["mode.harmonics"] == 7


#: (text in the case, its replacement, text on the line that must be named, what is said, value shown)
WRONG = {
    "unknown key": (
        "harmonics = 21",
        "harmonic = 21",
        "harmonic = 21",
        "unknown key 'harmonic'",
        "harmonic = 21",
    ),
    "negative mass": (
        "[0.0, 0.02]",
        "[0.0, -0.02]",
        "M = ",
        "negative diagonal",
        "M[1][1] = -0.02 (dof m2)",
    ),
    "NaN in a matrix": (
        "[[1.0, 0.0]",
        "[[1.0, nan]",
        "M = ",
        "not a number",
        "M[0][1] = nan",
    ),
    "singular mass": (
        "[0.0, 0.02]",
        "[0.0, 0.0]",
        "M = ",
        "zero diagonal",
        "M[1][1] = 0 (dof m2)",
    ),
    "singular stiffness": (
        "[[640.0, -40.0]",
        "[[0.0, 0.0]",
        "K = ",
        "K[0][1] = 0 and K[1][0] = -40",
        "",
    ),
    "unsymmetric": (
        "[[640.0, -40.0]",
        "[[640.0, -41.0]",
        "K = ",
        "not symmetric",
        "K[0][1] = -41 and K[1][0] = -40",
    ),
    "wrong size": (
        "[[640.0, -40.0], [-40.0, 40.0]]",
        "[[640.0]]",
        "K = ",
        "wrong size",
        "1 x 1",
    ),
    "amplitude 0": (
        "amplitude = [0.02, 3.0]",
        "amplitude = [0, 3.0]",
        "[0, 3.0]",
        "mode.amplitude[0]",
        "0",
    ),
    "H = 0": (
        "harmonics = 21",
        "harmonics = 0",
        "harmonics = 0",
        "mode.harmonics",
        "0",
    ),
    "missing file": (
        "[[1.0, 0.0], [0.0, 0.02]]",
        '"M.npz"',
        "M = ",
        "does not exist",
        "M.npz",
    ),
    "unknown law": (
        "regularised_coulomb",
        "regularized_coulomb",
        "law = ",
        "unknown contact law",
        "regularized_coulomb",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_case_is_named(write, name: str) -> None:
    old, new, marked, what, value = WRONG[name]
    path = write((old, new))
    found = problems(path)
    assert len(found) == 1
    text = found[0].render()
    assert f"case.toml:{line_of(path, marked)} (" in str(found[0].where)
    assert what in text
    assert value in str(found[0].measured)
    assert found[0].expected
    assert found[0].fix
    assert text.startswith("error: ")
    assert text.count("\n") >= 4


def test_singular_stiffness_names_the_free_dof(write) -> None:
    """Both masses coupled but not held; the contact holds m2, so both are held: a note. Without contact: an error."""
    singular = ("[[640.0, -40.0], [-40.0, 40.0]]", "[[40.0, -40.0], [-40.0, 40.0]]")
    held = load_case(write(singular))
    assert "K is singular without contact" in held.notes[0]
    [problem] = problems(write(singular, ('pairs = ["m2"]', 'pairs = [["m1", "m2"]]')))
    assert "singular" in problem.what
    assert "to ground" in str(problem.fix)


def test_all_errors_at_once_in_the_order_of_the_file(write) -> None:
    path = write(
        ("[0.0, 0.02]", "[0.0, -0.02]"),
        ("friction_limit = 5.0", "friction_limit = -5.0"),
        ("harmonics = 21", "harmonics = 0"),
        ('normalise = "m1"', 'normalise = "m3"'),
        ('observe = "m1"', 'obsreve = "m1"'),
    )
    with pytest.raises(CaseErrors) as caught:
        load_case(path)
    text = caught.value.render()
    for said in (
        "negative diagonal",
        "friction_limit",
        "mode.harmonics",
        "unknown key 'obsreve'",
    ):
        assert said in text
    assert "is missing" not in text
    lines = [int(str(p.where).split("case.toml:")[1].split(" ")[0]) for p in caught.value.problems]
    assert lines == sorted(lines)
    assert "did you mean `observe`?" in text


def test_errors_in_references(write) -> None:
    path = write(
        ('backbone = ["mode", "mode_epmc"]', 'backbone = ["mode", "mode_empc"]'),
        ('mode = "flutter"', 'mode = "forced"'),
        ("samples = 1024", "samples = 32"),
        ("report_at = [0.05, 0.13, 0.14, 0.17, 0.25, 0.5, 2.0]", "report_at = [0.1, 17.0]"),
        ('dampers = [{ dof = "m1"', 'dampers = [{ dof = "m9"'),
        ("frequency = [3.2, 4.6]", "frequency = [4.6, 3.2]"),
    )
    found = {problem.what: problem for problem in problems(path)}
    assert "did you mean `mode_epmc`?" in str(found["forced.backbone[1] is no mode analysis of this case"].fix)
    assert "limit_cycle.mode is no mode analysis of this case" in found
    assert "2 H + 2 = 44" in str(found["mode.samples is too small"].expected)
    assert found["mode.report_at[1] is outside the branch"].measured == "17.0"
    assert "unknown dof 'm9'" in found
    assert found["forced.frequency is not a range"].fix == "write `frequency = [3.2, 4.6]`"


def test_a_range_of_one_value_is_given_a_second_one(write) -> None:
    (problem,) = problems(write(("frequency = [3.2, 4.6]", "frequency = [3.2, 3.2]")))
    assert problem.fix == "write `frequency = [3.2, 6.4]`"


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("mdoe.harmonics=3", "did you mean `mode.harmonics`?"),
        ("mode.harmonics", "not key=value"),
        ("mode.harmonics=[", "not TOML"),
        ("mode.harmonics=7.5", "an integer"),
        ("contact.dampr.friction_limit=3", "did you mean `contact.damper.friction_limit`?"),
        ("dampr.friction_limit=3", "did you mean `contact.damper.friction_limit`?"),
        ("mode=3", "did you mean `mode.<key>`?"),
        ("mode.step.maximun=0.1", "did you mean `maximum`?"),
        ("mode.harmonics=3#5", "what follows # is a comment"),
        ("mode.amplitude=[0.02, 3.0] # x", "what follows # is a comment"),
    ],
)
def test_wrong_overrides(override: str, said: str) -> None:
    [problem] = problems(CASE, override)
    assert said in problem.render()
    assert str(problem.where).startswith(f"--set {override}")


@pytest.mark.parametrize("asked", ["Non", "None", "non"])
def test_an_entry_without_a_name_is_not_meant(write, asked: str) -> None:
    told = problems(write(('name = "mode"\n', "")), f"{asked}.harmonics=3")
    assert any("addresses nothing" in one.what for one in told)
    assert not any("None" in text for one in told for text in (one.expected or "", one.fix or ""))


def test_overrides_address_by_name() -> None:
    case = load_case(
        CASE,
        [
            "mode.harmonics=7",
            "mode.method=EPMC",
            "contact.damper.friction_limit=3",
            "model.M=[[2.0, 0.0], [0.0, 0.02]]",
            "mode.step.maximum=0.1",
            "flutter.dampers.0.c=-0.5",
        ],
    )
    assert case.resolved["mode.harmonics"] == 7
    assert case.resolved["mode.method"] == "EPMC"
    assert case.contacts[0].parameters["friction_limit"] == 3.0
    assert case.M[0, 0] == 2.0
    assert case.analyses["mode"].step.maximum == 0.1
    assert case.analyses["flutter"].dampers[0].c == -0.5


def test_set_wins_over_quick() -> None:
    assert load_case(CASE, ["mode.harmonics=5"], quick=True).resolved["mode.harmonics"] == 5


def test_changed_keys_are_named() -> None:
    then, now = load_case(CASE).resolved, load_case(CASE, ["mode.harmonics=7"]).resolved
    assert changed_keys(then, now) == ["mode.harmonics: 21 then, 7 now"]
    assert load_case(CASE).digest != load_case(CASE, ["mode.harmonics=7"]).digest
    assert load_case(CASE).digest == load_case(CASE, ["mode.harmonics=21"]).digest


@pytest.mark.parametrize("kind", ["save_npz", "savez", "mtx", "NPZ"])
def test_matrices_from_files(write, tmp_path: Path, kind: str) -> None:
    M = np.diag([1.0, 0.02])
    name = "M.mtx" if kind == "mtx" else "M.npz"
    if kind == "save_npz":
        scipy.sparse.save_npz(tmp_path / name, scipy.sparse.csr_matrix(M))
    elif kind == "savez":
        np.savez(tmp_path / name, M=M)
    elif kind == "NPZ":
        np.savez(tmp_path / name, M=M)
        (tmp_path / name).rename(tmp_path / (name := "M.NPZ"))
    else:
        scipy.io.mmwrite(str(tmp_path / name), scipy.sparse.csr_matrix(M))
    path = write(("[[1.0, 0.0], [0.0, 0.02]]", f'"{name}"'))
    case = load_case(path)
    assert np.array_equal(case.M.toarray(), M)
    assert case.resolved["model.M"].startswith("sha256:")


def test_damaged_matrix_file(write, tmp_path: Path) -> None:
    (tmp_path / "M.npz").write_bytes(b"not an archive")
    [problem] = problems(write(("[[1.0, 0.0], [0.0, 0.02]]", '"M.npz"')))
    assert "cannot be read" in problem.what


@pytest.mark.parametrize("name, imported", [("M.npy", True), ("M.mat", True), ("M.csv", False)])
def test_a_matrix_of_another_program_is_told_its_way(write, tmp_path: Path, name: str, imported: bool) -> None:
    """It was to be written with save_npz('M.csv', M), which makes another file, M.csv.npz."""
    M = np.diag([1.0, 0.02])
    if name.endswith(".npy"):
        np.save(tmp_path / name, M)
    elif name.endswith(".mat"):
        scipy.io.savemat(tmp_path / name, {"M": M})
    else:
        np.savetxt(tmp_path / name, M, delimiter=",")
    [problem] = problems(write(("[[1.0, 0.0], [0.0, 0.02]]", f'"{name}"')))
    assert problem.fix is not None and "save_npz('M.npz', M)" in problem.fix
    assert ("fretwave import" in problem.fix) == imported


def test_pairs_between_dofs(write) -> None:
    case: Case = load_case(write(('pairs = ["m2"]', 'pairs = [["m1", "m2"], "m2"]')))
    assert np.array_equal(case.contacts[0].pairs.own.toarray(), [[-1.0, 1.0], [0.0, 1.0]])


def test_not_toml(write) -> None:
    path = write(('name = "damper"', "name = damper"))
    [problem] = problems(path)
    assert problem.where.endswith(f"case.toml:{line_of(path, 'name = damper')}")
    assert "name = damper" in str(problem.measured)


def test_missing_case_file(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(TEXT)
    [problem] = problems(tmp_path / "csae.toml")
    assert "case.toml" in str(problem.fix)


def test_locator_follows_tables_arrays_and_inline_tables() -> None:
    text = """a.b = 1
text = \"\"\"
[not.a.table]
\"\"\"
[[item]]
x = [1, # comment ]
     [2, 3]]
[item.sub]
y = { z = 1, 'w w' = [
  5] }
[[item]]
x = "]"
"""
    locate = Locator(text)
    expected = {
        ("a", "b"): 1,
        ("item", 0): 5,
        ("item", 0, "x", 1, 1): 7,
        ("item", 0, "sub", "y", "z"): 9,
        ("item", 0, "sub", "y", "w w", 0): 10,
        ("item", 1, "x"): 12,
    }
    assert {path: locate.line(path) for path in expected} == expected
    assert ("not",) not in locate
    assert locate.line(("item", 1, "missing")) == 11


def test_a_reader_that_knows_what_is_wrong_is_told_once(tmp_path: Path) -> None:
    """Its own error stood inside another: two places and two ways to mend it."""
    (tmp_path / "K.mtx").write_text("%%MatrixMarket matrix coordinate pattern general\n1 1 1\n1 1\n")
    for given in ('K = "K.mtx"', 'K = [[1.0]]\nat_speed = { 30 = "K.mtx" }'):
        (tmp_path / "case.toml").write_text(f"[model]\nM = [[1.0]]\n{given}\n{LINEAR}")
        (problem,) = problems(tmp_path / "case.toml")
        assert problem.what == "the matrix has places without values" and "K.mtx: pattern" in str(problem.measured)
        assert str(problem).count("fix:") == str(problem).count("where:") == 1 and "case.toml:" in str(problem.where)


def test_a_model_file_in_place_of_a_matrix(tmp_path: Path) -> None:
    """It was to be imported into itself."""
    eye = scipy.sparse.identity(1, format="csr")
    write_model(tmp_path / "good.h5", Structure(eye, eye))
    (tmp_path / "case.toml").write_text(f'[model]\nM = "good.h5"\nK = [[1.0]]\n{LINEAR}')
    (problem,) = problems(tmp_path / "case.toml")
    assert problem.fix is not None and problem.fix.startswith('file = "') and "good.h5" in problem.fix
    assert "import" not in problem.fix
