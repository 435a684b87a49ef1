"""What the error of a reduction at the speeds of linear analyses costs: which models are solved for it, how often."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call

from fretwave.case import reduction_report

pytestmark = pytest.mark.ranks(1)


@pytest.fixture
def solves(monkeypatch) -> list[tuple[int, float, int]]:
    """Dofs, sum of the stiffness and nodal diameter of each model whose frequencies a report asks for."""
    made, original = [], reduction_report._lowest_hz

    def noted(case, count, comm, limit, nodal_diameter=0):
        made.append((case.structure.n_dof, round(float(case.K.sum()), 6), nodal_diameter))
        return original(case, count, comm, limit, nodal_diameter)

    monkeypatch.setattr(reduction_report, "_lowest_hz", noted)
    return made


def chain(sector: bool, reduction: str, *analyses: str) -> str:
    """Masses in a row, the first held, or as a sector's face tied to that of the next; stiffer where they turn."""
    n = 25 if sector else 24
    mass, K = np.r_[np.linspace(1.0, 2.5, 24), 0.0][:n], np.zeros((n, n))
    for i, j, k in [(i, i + 1, 100.0) for i in range(23)] + [(0, 24, 30.0)] * sector:
        K[np.ix_([i, j], [i, j])] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    K[0, 0] += 50.0
    turning, names = K + np.diag(np.r_[np.ones(24), 0.0][:n]), [f"m{k}" for k in range(n)]
    faces = 'sectors = 6\nlow = ["m0"]\nhigh = ["m24"]\n' if sector else ""
    model = f"[model]\ndofs = {names}\nM = {np.diag(mass).tolist()}\nK = {K.tolist()}\n"
    at_speed = f"at_speed = {{ 60 = {turning.tolist()} }}\n"
    text = f"{model}{at_speed}{faces}[reduction]\n{reduction}\n"
    return text.replace("'", '"') + "".join(
        f'[[analysis]]\nname = "linear{k}"\ntype = "linear"\nmodes = 2\n{keys}\n' for k, keys in enumerate(analyses)
    )


KEEPS = 'dampers = [{ dof = "m23", c = 0.0 }]\n'


@pytest.mark.parametrize("sector", [True, False])
def test_each_unreduced_model_is_solved_once_whatever_numbers_are_tried(sector, solves, tmp_path):
    diameters = "compare_diameters = [0, 1]\n" if sector else ""
    asked = f"accuracy = {1e-6 if sector else 1e-9}\ncompare = 2\n{diameters}"
    text = chain(sector, asked, f"{KEEPS}speeds_rpm = [0.0, 45.0]")
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    tries = (tmp_path / "run" / "run.log").read_text().count(" leave ")
    full = [one for one in solves if one[0] == 24]
    assert tries == 2 and len(full) == len(set(full)) == 2  # at rest and at 45 rev/min, or of two waves there
    assert len(solves) - len(full) == tries * len(full)


def test_the_error_is_stated_at_the_speeds_of_what_runs(solves, tmp_path):
    """A number of component modes that is chosen still holds for all, so that it does not depend on what runs."""
    for reduction, count in (("modes = 3\ncompare = 2", 1), ("accuracy = 0.5\ncompare = 2", 2)):
        path, out = tmp_path / "case.toml", tmp_path / f"run{count}"
        path.write_text(chain(False, reduction, KEEPS, "speeds_rpm = [0.0, 45.0]"))
        solves.clear()
        assert call("run", path, "--only", "linear0", "--no-plots", "--out", out) == 0
        assert [n for n, *_ in solves].count(24) == count
        assert len(json.loads((out / "run.json").read_text())["reduction"]["speeds"]) == count - 1


def test_a_speed_that_adds_no_stiffness_is_not_compared(solves, tmp_path):
    """Whatever the part is called that does not grow at rest; of the case's own speed as before."""
    (tmp_path / "model.py").write_text(
        "import numpy as np, scipy.sparse as sp, fretwave as fw\n"
        "def build():\n"
        "    K = sp.diags([[2.0] * 6, [-1.0] * 5, [-1.0] * 5], [0, 1, -1], format='csr')\n"
        "    return fw.Structure(sp.identity(6, format='csr'), K, dofs={'tip': 5}, parts={'disc': sp.identity(6)})\n"
    )
    (tmp_path / "case.toml").write_text(
        '[model]\nbuilder = "model.py"\n[reduction]\nmodes = 2\ncompare = 2\n[[analysis]]\nname = "linear"\n'
        'type = "linear"\nspin_stiffness = "disc"\nspeeds_rpm = [0.0, 45.0]\ndampers = [{ dof = "tip", c = 0.0 }]\n'
    )
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    (found,) = json.loads((tmp_path / "run" / "run.json").read_text())["reduction"]["speeds"]
    assert found["speed_rpm"] == 45.0 and len(solves) == 4


def test_modes_that_rigid_contact_takes_are_not_called_rigid_motions(tmp_path):
    """A pair that cannot move when stuck leaves the reduced model one mode fewer than dofs, and none at 0 Hz."""
    pad = 'name = "pad"\nlaw = "regularised_coulomb"\npairs = ["m23"]\nfriction_limit = 1.0\n'
    contact = f"[[contact]]\n{pad}regularisation_velocity = 0.1\n"
    (tmp_path / "case.toml").write_text(chain(False, "modes = 3", "") + contact)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    found = json.loads((tmp_path / "run" / "run.json").read_text())["reduction"]
    assert len(found["full_hz"]) == len(found["reduced_hz"]) == len(found["relative"]) == 3
    assert "0 Hz" not in (tmp_path / "run" / "run.log").read_text()
