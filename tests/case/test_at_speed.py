"""Stiffness of a turning model from the matrices that another code gives at rest and at one or two speeds."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from command_line import call
from models import hexahedra
from tolerances import ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.case.load import load_case
from fretwave.errors import CaseErrors
from fretwave.report.report import report_text
from fretwave.results.model_file import write_model

pytestmark = pytest.mark.ranks(1)

M = np.diag([2.0, 1.0])
K = np.array([[50.0, -20.0], [-20.0, 30.0]])
K2 = np.array([[0.5, -0.1], [-0.1, 0.3]])
ANALYSIS = """
[[analysis]]
name = "linear"
type = "linear"
speeds_rpm = [0.0, 45.0]
"""


def at(speed: float, second: float = 0.0) -> np.ndarray:
    """Stiffness [N/m] at a speed [rev/min], with a share that does not follow its square."""
    omega = 2 * np.pi * speed / 60
    return K + omega**2 * K2 + second * omega**4 * np.eye(2)


def inline(**stiffness: np.ndarray) -> str:
    given = ", ".join(f"{speed.strip('n')} = {A.tolist()}" for speed, A in stiffness.items())
    return f"[model]\nM = {M.tolist()}\nK = {K.tolist()}\nat_speed = {{ {given} }}\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "case.toml"
    path.write_text(text + ANALYSIS, encoding="utf-8")
    return path


def rows_of(out: Path) -> list[dict[str, str]]:
    with open(out / "linear.csv", newline="") as file:
        return list(csv.DictReader(file))


def spin_of(path: Path) -> np.ndarray:
    return load_case(path).structure.parts["spin"].toarray()


def test_one_speed_gives_the_part_that_grows_with_its_square(tmp_path):
    assert np.abs(spin_of(written(tmp_path, inline(n30=at(30.0)))) - K2).max() < ROUNDING


def test_frequencies_between_the_speeds_are_those_of_the_matrices_there(tmp_path):
    path = written(tmp_path, inline(n30=at(30.0), n60=at(60.0)))
    assert call("run", path, "--no-plots", "--out", tmp_path / "run") == 0
    rows = rows_of(tmp_path / "run")
    for speed in (0.0, 45.0):
        found = [float(row["omega"]) for row in rows if float(row["speed_rpm"]) == speed]
        expected = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, at(speed))).real))
        assert found == pytest.approx(expected, rel=TIGHT)


def test_two_speeds_are_fitted_and_what_is_left_is_said(tmp_path):
    """Least squares of w K2' = w K2 + s w^2 1, w = Omega^2: K2' = K2 + s sum w^3 / sum w^2 1."""
    path = written(tmp_path, inline(n30=at(30.0, 1e-3), n60=at(60.0, 1e-3)))
    w = (2 * np.pi * np.array([30.0, 60.0]) / 60) ** 2
    expected = K2 + 1e-3 * (w**3).sum() / (w**2).sum() * np.eye(2)
    assert np.abs(spin_of(path) - expected).max() < ROUNDING
    (note,) = [note for note in load_case(path).notes if "at speed" in note]
    change = at(30.0, 1e-3) - K
    left = np.linalg.norm(change - w[0] * expected) / np.linalg.norm(change)
    assert f"leaves {100 * left:.2g} % of its change" in note


def test_model_files_of_one_mesh(tmp_path):
    for name, stiffness in (("rest", K), ("turning", at(30.0))):
        write_model(tmp_path / f"{name}.h5", fw.Structure(sp.csr_matrix(M), sp.csr_matrix(stiffness)))
    path = written(tmp_path, '[model]\nfile = "rest.h5"\nat_speed = { 30 = "turning.h5" }\n')
    assert np.abs(spin_of(path) - K2).max() < ROUNDING
    assert load_case(path).resolved["model.at_speed.30"].startswith("turning.h5 ")


WRONG = {
    "no speed": (inline(fast=at(30.0)), "'fast' is no speed"),
    "at rest": (inline(n0=at(0.0)), "'0' is no speed"),
    "other dofs": (inline(n30=np.eye(3)), "is of another model"),
    "not symmetric": (inline(n30=np.array([[50.0, 1.0], [-1.0, 30.0]])), "is not symmetric"),
    "no stiffness at rest": (inline(n30=at(30.0)).replace(f"K = {K.tolist()}", 'K = "at_speed.mtx"'), "does not exist"),
    "no mass": (
        inline(n30=at(30.0)).replace(f"M = {M.tolist()}", 'dofs = ["a", "b"]\nM = "none.mtx"'),
        "does not exist",
    ),
    "no file": ('[model]\nfile = "rest.h5"\nat_speed = { 30 = "none.h5" }\n', "none.h5"),
    "another mass": ('[model]\nfile = "rest.h5"\nat_speed = { 30 = "other.h5" }\n', "its mass differs by 1e+02 %"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_stiffness_at_a_speed_is_refused(name, tmp_path):
    for file, factor in (("rest", 1.0), ("other", 2.0)):
        write_model(tmp_path / f"{file}.h5", fw.Structure(sp.csr_matrix(factor * M), sp.csr_matrix(K)))
    text, said = WRONG[name]
    with pytest.raises(CaseErrors) as caught:
        load_case(written(tmp_path, text))
    assert said in str(caught.value) and str(caught.value).count("fix:") == 1


def test_a_model_file_in_capitals(tmp_path):
    """It was read as a matrix, and its own import into it advised."""
    for name, stiffness in (("rest.h5", K), ("turning.H5", at(30.0))):
        write_model(tmp_path / name, fw.Structure(sp.csr_matrix(M), sp.csr_matrix(stiffness)))
    path = written(tmp_path, '[model]\nfile = "rest.h5"\nat_speed = { 30 = "turning.H5" }\n')
    assert np.abs(spin_of(path) - K2).max() < ROUNDING


def test_a_matrix_file_that_a_case_does_not_read(tmp_path):
    """The way over a model file ends at this key, not at another source of the model."""
    (tmp_path / "turning.sti").write_text("1 1 50.0\n1 2 -20.0\n2 2 30.0\n")
    path = written(tmp_path, inline(n30=at(30.0)).split("at_speed")[0] + 'at_speed = { 30 = "turning.sti" }\n')
    with pytest.raises(CaseErrors, match='brings it into a model file, 30 = ".*turning.h5"'):
        load_case(path)


#: What is given in place of K at a speed, K_G = 1e-3 of K: whether a mesh is refused (one without cells noted), and a
#: model of few dofs noted.
SLIPS = {
    "all of it": (lambda K: 1.001 * K, False, False),
    "stress stiffness alone": (lambda K: 1e-3 * K, True, True),
    "in other units": (lambda K: 1.001e3 * K, True, True),
    "its dofs backwards": (lambda K: K[::-1, ::-1], True, False),
}


@pytest.mark.parametrize("slip", SLIPS)
@pytest.mark.parametrize("known", ["cells", "dofs", "nothing"])
def test_another_stiffness_than_at_speed(slip, known, tmp_path):
    """Of a mesh stress changes K by thousandths; 0 Hz came of the others beyond the speed, without a word."""
    bar = hexahedra.bar((4, 1, 2), (0.1, 0.02, 0.01))
    free = np.setdiff1d(np.arange(bar.K.shape[0]), bar.layer(0.0))
    M, K = (A[free][:, free] for A in (bar.M, bar.K))
    labels = None if known == "nothing" else np.column_stack([free // 3 + 1, free % 3 + 1])
    rest = fw.Structure(M, K, labels=labels)
    if known == "cells":
        number, square = np.arange(len(bar.nodes)).reshape(5, 2, 3), ((0, 0), (1, 0), (1, 1), (0, 1))
        rest.node_numbers, rest.coordinates = np.arange(1, len(bar.nodes) + 1), bar.nodes
        rest.hexahedra = np.array(
            [[number[i + a, b, k + c] for c in (0, 1) for a, b in square] for i in range(4) for k in (0, 1)]
        )
    write_model(tmp_path / "rest.h5", rest)
    given, refused, noted = SLIPS[slip]
    sp.save_npz(tmp_path / "turning.npz", sp.csr_matrix(given(K)))
    path = written(tmp_path, '[model]\nfile = "rest.h5"\nat_speed = { 30 = "turning.npz" }\n')
    if known == "cells" and refused:
        with pytest.raises(CaseErrors, match="is not that of this mesh") as caught:
            load_case(path)
        assert str(caught.value).count("fix:") == 1
        return
    notes = [note for note in load_case(path).notes if "is it all of K at this speed" in note]
    assert len(notes) == {"cells": False, "dofs": refused, "nothing": noted}[known]


@pytest.mark.parametrize("drawn", [False, True])
def test_a_beam_reduced_to_its_tip(drawn, tmp_path):
    """The tension of a slender beam stiffens its tip by as much as its bending does, with a table of dofs too."""
    K, M = sp.csr_matrix([[50.0]]), sp.csr_matrix([[0.5]])
    rest = fw.Structure(M, K, labels=np.array([[17, 2]]))
    if drawn:  # the cells that it was reduced from
        bar = hexahedra.bar((1, 1, 1), (0.1, 0.02, 0.01))
        rest.node_numbers, rest.coordinates = np.arange(10, 18), bar.nodes
        rest.hexahedra = np.array([[0, 4, 6, 2, 1, 5, 7, 3]])
    write_model(tmp_path / "rest.h5", rest)
    sp.save_npz(tmp_path / "turning.npz", 1.86 * K)
    notes = load_case(written(tmp_path, '[model]\nfile = "rest.h5"\nat_speed = { 30 = "turning.npz" }\n')).notes
    assert any("K changes by 0.86 of that at rest" in note for note in notes)


#: A sector of a ring: a mass on the rim, tied to the next one, that carries a blade of two.
RIM = """
[model]
dofs = ["rim", "root", "tip", "next"]
M = [[2.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 0]]
K = [[95.0, -40.0, 0, -30.0], [-40.0, 60.0, -20.0, 0], [0, -20.0, 20.0, 0], [-30.0, 0, 0, 30.0]]
at_speed = { 60 = [[95.0, -40.0, 0, -30.0], [-40.0, 80.0, -25.0, 0], [0, -25.0, 45.0, 0], [-30.0, 0, 0, 30.0]] }
sectors = 6
low = ["rim"]
high = ["next"]
"""


def whole_and_reduced(tmp_path, sector, reduction, analysis):
    """Folders of two runs of the rim, as a sector or its matrices as a structure, with more keys of the analysis."""
    text, found = RIM, []
    if not sector:
        text = RIM[: RIM.index("sectors")].replace("[0, 0, 0, 0]", "[0, 0, 0, 1.0]")
    for number, table in enumerate(("", f"[reduction]\n{reduction}")):
        path, out = written(tmp_path, text + table), tmp_path / f"run{number}"
        path.write_text(path.read_text(encoding="utf-8") + analysis, encoding="utf-8")
        assert call("run", path, "--no-plots", "--out", out) == 0
        found.append(out)
    return found


@pytest.mark.parametrize("sector, modes", [(True, 1), (False, 3)])
def test_a_reduction_with_all_component_modes_keeps_the_turning_model(sector, modes, tmp_path):
    damper = 'dampers = [{ dof = "tip", c = 0.0 }]\n'  # keeps the tip
    runs = whole_and_reduced(tmp_path, sector, f"modes = {modes}\ncompare = 0\n", damper)
    found = [[float(row["omega"]) for row in rows_of(out)] for out in runs]
    assert found[1] == pytest.approx(found[0], rel=SOLVED)
    assert np.ptp(found[0]) > 5.0 and len(found[0]) == (24 if sector else 8)


#: Free of what holds it at rest from 30 rev/min on.
LOOSE = """
[model]
dofs = ["a", "b", "c"]
M = [[2.0, 0, 0], [0, 1.0, 0], [0, 0, 0.5]]
K = [[60.0, -40.0, 0], [-40.0, 60.0, -20.0], [0, -20.0, 20.0]]
at_speed = { 30 = [[40.0, -40.0, 0], [-40.0, 40.0, -20.0], [0, -20.0, 0.0]] }
"""


@pytest.mark.parametrize("count, left, told", [(2, 2, "no frequency is compared, 2 at 0 Hz"), (3, 2, ", 2 at 0 Hz")])
def test_what_is_unstable_at_a_speed_has_no_error(count, left, told, tmp_path):
    """K(Omega) is indefinite: 0 Hz was counted as exact, whatever the reduced model has there."""
    text = f'{LOOSE}[reduction]\nmodes = 2\ncompare = {count}\n{ANALYSIS}dampers = [{{ dof = "b", c = 0.0 }}]\n'
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    (found,) = json.loads((tmp_path / "run" / "run.json").read_text())["reduction"]["speeds"]
    assert found["full_hz"].count(0.0) == found["relative"].count(None) == left
    assert all(abs(error) < SOLVED for error in found["relative"] if error is not None)
    assert told in (tmp_path / "run" / "run.log").read_text() and "–" in report_text(tmp_path / "run")


@pytest.mark.parametrize("sector", [True, False])
def test_a_reduction_states_its_error_at_the_speeds_that_are_asked_for(sector, tmp_path):
    """As the tables of the unreduced and of the reduced model differ: it was made with the stiffness at rest."""
    tables = []
    damper = 'modes = 2\ndampers = [{ dof = "root", c = 0.0 }]\n'  # keeps the root
    for out in whole_and_reduced(tmp_path, sector, f"modes = {0 if sector else 1}\ncompare = 2\n", damper):
        rows = [row for row in rows_of(out) if row["speed_rpm"] == "45.0" and row.get("nodal_diameter", "0") == "0"]
        tables.append(np.array([float(row["frequency_hz"]) for row in rows]))
    found, *others = json.loads((out / "run.json").read_text())["reduction"]["speeds"]
    assert [other["nodal_diameter"] for other in others] == [3] * sector  # of all waves the last too
    assert found["speed_rpm"] == 45.0 and found.get("nodal_diameter") == (0 if sector else None)
    assert found["relative"] == pytest.approx(tables[1] / tables[0] - 1, rel=SOLVED) and max(found["relative"]) > 1e-3
    worst, log = max(found["relative"]), (out / "run.log").read_text()
    assert "reduction: at 45 rev/min, " in log and f"to {worst:.1e} (worst)" in log
    assert "45 rev/min, " in report_text(out)
