"""Case files whose sector is reduced: the same branch, the stated error, the wheel of it, and what is refused."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.rubbing_sector import BUILDER, SECTOR
from tolerances import REPEATED, SOLVED

import fretwave as fw
from fretwave.case.build import build_model
from fretwave.case.load import load_case
from fretwave.case.reduce import reduce_case
from fretwave.case.wheel import on_wheel
from fretwave.errors import CaseErrors

pytest.importorskip("skfem")

#: All component modes there are, faces whole: nothing is left out.
TEXT = SECTOR + "\n[reduction]\nmodes = 80\n"
MODES = ("modes = 80", 'modes = 12\ninterface = "modes"\ninterface_diameters = [2, 0]\ninterface_waves = 4')


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    folder.mkdir(exist_ok=True)
    shutil.copy(BUILDER, folder / "model.py")
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return folder / "case.toml"


def run(path: Path) -> tuple[list[dict[str, float]], dict]:
    """Table and record of a run."""
    out = path.parent / "run"
    assert call("run", str(path), "--out", str(out), "--no-plots") == 0
    with (out / "mode.csv").open(newline="") as file:
        rows = [
            {key: float(row[key]) for key in ("amplitude", "omega", "beta", "slip")} for row in csv.DictReader(file)
        ]
    return rows, json.loads((out / "run.json").read_text())


@pytest.mark.ranks(1)
def test_a_reduction_that_leaves_nothing_out_changes_nothing(tmp_path):
    """Preload, contact and slip included: two ways to the same branch."""
    whole, _ = run(write(tmp_path / "whole", ("[reduction]\nmodes = 80\n", "")))
    reduced, record = run(write(tmp_path / "reduced"))
    assert record["reduction"]["interface"] == 24 and record["reduction"]["unreduced"] == 138
    assert record["reduction"]["component_modes"] == 80
    picked = [
        [row for row in rows if min(abs(row["amplitude"] / a - 1) for a in (1e-5, 2e-5)) < 1e-9]
        for rows in (whole, reduced)
    ]
    assert len(picked[0]) == 2 and picked[0][1]["slip"] > 0.1
    for a, b in zip(*picked):
        assert b["omega"] == pytest.approx(a["omega"], rel=REPEATED)
        assert b["beta"] == pytest.approx(a["beta"], rel=1e-6)


@pytest.mark.ranks(1)
def test_the_error_is_stated(tmp_path):
    _, record = run(write(tmp_path, MODES, ("modes = 12", "modes = 12\ncompare = 3\ncompare_diameters = [2, 1]")))
    waves = record["reduction"]["waves"]
    assert [(w["nodal_diameter"], w["contact"], w["gave_interface_modes"]) for w in waves] == [
        (2, "stuck", True),
        (2, "sliding", True),
        (1, "stuck", False),
        (1, "sliding", False),
    ]
    assert all(len(w["full_hz"]) == 3 and min(w["relative"]) > -1e-9 for w in waves)
    assert max(waves[0]["relative"]) < 1e-3 and record["reduction"]["relative"] == waves[0]["relative"]
    log = (tmp_path / "run" / "run.log").read_text()
    assert "1 nodal diameters, sliding (gave no interface modes)" in log


@pytest.mark.ranks(1)
@pytest.mark.parametrize("faces", ["", MODES[1].partition("\n")[2]], ids=["whole faces", "interface modes"])
def test_error_at_an_amplitude_is_the_difference_to_the_unreduced_sector(tmp_path, faces):
    """In slip, of CNM with its damping and preload, to 1 % (with whole faces 0.04 % in omega, 0.1 % in beta)."""
    whole, _ = run(write(tmp_path / "whole", ("[reduction]\nmodes = 80\n", "")))
    asked = f"modes = 12\nerror_at = 2e-5\ncompare = 0\n{faces}"
    reduced, record = run(write(tmp_path / "reduced", ("modes = 80", asked)))
    estimate = record["analyses"]["mode"]["reduction_error"]
    for key in ("omega", "beta"):
        difference = whole[-1][key] - reduced[-1][key]
        assert estimate[key] == pytest.approx(difference, rel=0.01)
        assert abs(difference) > 1e-7 * whole[-1][key]


@pytest.mark.ranks(1, 2)
def test_the_wheel_of_a_reduced_sector(shared_tmp, comm):
    """Its modes are the waves of the reduced sector; a deviation of all stiffness scales what it should."""
    wheel = 'type = "mode"\nwheel = true\nmistuning = { deviations = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1] }'
    if comm.rank == 0:
        write(shared_tmp, MODES, ('type = "mode"', wheel))
    comm.barrier()
    case = reduce_case(load_case(shared_tmp / "case.toml", ["reduction.compare=0"]), comm)
    with build_model(case, (), comm, nodal_diameter=2) as sector:
        tuned = fw.linear_modes(sector, 1, "free")[0].omega
    around = on_wheel(case, case.analyses["mode"])
    with build_model(around, (), comm) as model:
        found = np.array([mode.omega for mode in fw.linear_modes(model, 8, "free")])
    assert len(around.dofs) == 6 * len(case.dofs) and "tip@5" in around.dofs
    assert np.abs(found / (tuned * np.sqrt(1.1)) - 1).min() < SOLVED


#: (text in the case, its replacement, what is said)
WRONG = {
    "no waves": (
        "modes = 80",
        'interface = "modes"',
        r"has no waves to come from(?s:.*)interface_diameters = \[0, 2\]",
    ),
    "no such waves": ("modes = 80", 'interface = "modes"\ninterface_diameters = [4]', "no nodal diameter of the wheel"),
    "waves for nothing": ("modes = 80", "interface_diameters = [2]", "has no effect"),
    "unknown interface": ("modes = 80", 'interface = "some"', "whole"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_reduction_is_said(tmp_path, change):
    old, new, message = change
    with pytest.raises(CaseErrors, match=message):
        load_case(write(tmp_path, (old, new)))


@pytest.mark.ranks(1)
def test_a_whole_structure_has_no_faces(tmp_path):
    shutil.copy(Path(__file__).parents[1] / "models" / "built_chain.py", tmp_path / "model.py")
    text = TEXT.replace("nodal_diameter = 2\n", "").replace("modes = 80", 'interface = "whole"')
    (tmp_path / "case.toml").write_text(text)
    with pytest.raises(CaseErrors, match="is of no sector"):
        load_case(tmp_path / "case.toml")
