"""Waves of a flutter analysis in which no motion can begin: the others are followed, and it is said why."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from tolerances import SOLVED

import fretwave as fw
from fretwave.analyses import flutter
from fretwave.run.order import RunOptions
from fretwave.run.runner import resume_run, run_case

SECTORS, OMEGA = 5, 1.0
#: Masses of 1 kg, each on a spring of 1 N/m to the next one and none to the ground, with a slider beside it.
FREE = f"""
[model]
dofs = ["a", "b", "na"]
M = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 0]]
K = [[1.0, 0, -1.0], [0, 9.0, 0], [-1.0, 0, 1.0]]
sectors = {SECTORS}
low = ["a"]
high = ["na"]

[[contact]]
name = "between"
law = "jenkins"
pairs = [["a", "na"]]
tangential_stiffness = 0.5
friction_limit = 1.0

[aerodynamics]
frequency = {OMEGA / (2 * np.pi)!r}
influence = {{ 0 = [0.0, 0.01] }}

[[analysis]]
name = "flutter"
type = "flutter"
normalise = "a"
harmonics = 1
amplitude = [0.01, 0.1]
"""
OTHERS = "flutter.nodal_diameters=[-2, -1, 1, 2]"


def written(folder: Path, comm, *changes: tuple[str, str]) -> Path:
    text, path = FREE, folder / "case.toml"
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    if comm.rank == 0:
        path.write_text(text, encoding="utf-8")
    comm.barrier()
    return path


def first_zeta(diameters: int) -> float:
    """Of (lambda^2 - 0.01 lambda / OMEGA + 1.5 * 4 sin^2(theta / 2)) q = 0, pairs stuck."""
    value = max(np.roots([1.0, -0.01 / OMEGA, 6 * np.sin(np.pi * diameters / SECTORS) ** 2]), key=np.imag)
    return float(-value.real / abs(value))


def test_a_rigid_wave_leaves_the_others_their_branches(shared_tmp, comm):
    """All masses alike move as one body (0 nodal diameters): of the others the damping is that of the closed form."""
    out = shared_tmp / "run"
    with pytest.raises(fw.NotConverged) as stopped:
        run_case(written(shared_tmp, comm), RunOptions(out=out, plots=False), comm)
    said = stopped.value.render()
    assert "nodal diameter 0: linear mode 1 is a rigid motion" in said and OTHERS in said
    assert "open at rest" not in said  # a slider is never open
    with open(out / "flutter_waves.csv", newline="") as file:
        found = {int(row["nodal_diameter"]): float(row["zeta"]) for row in csv.DictReader(file)}
    assert found == {d: pytest.approx(first_zeta(d), rel=SOLVED) for d in (-2, -1, 1, 2)}


@pytest.mark.ranks(1)
def test_a_resumed_run_tells_the_same_of_a_wave_before_it(tmp_path, comm, monkeypatch):
    """Killed behind the wave that cannot begin, it told the advice of a branch that breaks off."""
    out, options, row_of = tmp_path / "run", RunOptions(out=tmp_path / "run", plots=False), flutter.record
    with pytest.raises(fw.NotConverged) as whole:
        run_case(written(tmp_path, comm), RunOptions(out=tmp_path / "whole", plots=False), comm)

    def interrupted(*arguments):
        row = row_of(*arguments)
        if row["nodal_diameter"] == 1:
            raise KeyboardInterrupt
        return row

    monkeypatch.setattr(flutter, "record", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_case(written(tmp_path, comm), options, comm)
    monkeypatch.undo()
    with pytest.raises(fw.NotConverged) as resumed:
        resume_run(out, comm, plots=False)
    assert OTHERS in str(whole.value) and resumed.value.fix == whole.value.fix
    assert str(resumed.value).replace(str(out), "") == str(whole.value).replace(str(tmp_path / "whole"), "")


@pytest.mark.ranks(1)
def test_a_rigid_wave_is_told_beforehand(tmp_path, comm, capsys):
    assert call("check", written(tmp_path, comm)) == 0
    told, warned = capsys.readouterr().out.split("warning: ", 1)
    assert "no points in 1 wave\n" in warned and OTHERS in warned
    assert "nodal diameter 2: " in told and "nodal diameter 0: " not in told


@pytest.mark.ranks(1)
@pytest.mark.parametrize("verb", ["check", "run"])
@pytest.mark.parametrize(
    "change, what",
    [
        (("harmonics", "nodal_diameters = [0]\nharmonics"), "rigid motion"),
        (('normalise = "a"', 'normalise = "b"\nnodal_diameters = [1, 2]'), "does not move in the starting mode"),
    ],
)
def test_no_wave_that_can_begin_is_an_error_in_run_as_beforehand(tmp_path, comm, capsys, verb, change, what):
    folder = ("--out", tmp_path / "run") if verb == "run" else ()
    assert call(verb, written(tmp_path, comm, change), *folder) == 2
    assert what in capsys.readouterr().err


def test_waves_without_any_point_are_told(shared_tmp, comm):
    """Negative stiffness of the flow, beyond that of the wheel: nothing oscillates."""
    waves = ("harmonics", "nodal_diameters = [1, 2]\nharmonics")
    path = written(shared_tmp, comm, ("[0.0, 0.01]", "[30.0, 0.0]"), waves)
    with pytest.raises(fw.NotConverged, match="(?s)nothing was solved.*nodal diameter 2: no solution at the start"):
        run_case(path, RunOptions(out=shared_tmp / "run", plots=False), comm)
