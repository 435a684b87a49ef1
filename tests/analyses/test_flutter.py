"""`type = "flutter"` from a case file: limit cycles of every nodal diameter, their verdicts, and what is refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from models.cyclic_models import chain_crossings
from models.flow_chain import OMEGA, SECTORS, wheel_of
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave.analyses import flutter
from fretwave.case.load import load_case
from fretwave.commands.check import check_case
from fretwave.commands.keys import key_lines
from fretwave.errors import CaseErrors
from fretwave.plots import flutter as pictures
from fretwave.results.reader import Run
from fretwave.run.order import RunOptions
from fretwave.run.runner import resume_run, run_case

INFLUENCE = {0: 0.02 - 0.06j, 1: -0.1 + 0.02j, -1: 0.12 + 0.05j, 2: 0.01 - 0.005j}
#: The chain as a case: a mass on its ground spring, a Jenkins element to the next one, and the flow.
TEXT = f"""{wheel_of(INFLUENCE, dof="mass")}
[[analysis]]
name = "flutter"
type = "flutter"
normalise = "mass"
harmonics = 1
samples = 960
amplitude = [0.2, 100.0]
"""


@pytest.fixture
def write(shared_tmp, comm):
    """The case with replacements."""

    def make(*changes: tuple[str, str]) -> Path:
        text = TEXT
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = shared_tmp / "case.toml"
        if comm.rank == 0:
            path.write_text(text, encoding="utf-8")
        comm.barrier()
        return path

    return make


def table(folder: Path, name: str) -> list[dict[str, str]]:
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_every_wave_has_the_limit_cycles_of_the_closed_form(write, shared_tmp, comm, capsys):
    """All nodal diameters, forward and backward, in one run, which says how wrong it may be."""
    out = shared_tmp / "run"
    assert run_case(write(), RunOptions(out=out, plots=False), comm) == 0
    errors = 100 * np.array([float(row["zeta_error"]) for row in table(out, "flutter")])
    told = f"flutter: {len(errors)} points, error of zeta up to {np.nanmax(errors):.2g} %, "
    assert (told in capsys.readouterr().out) == (comm.rank == 0)
    flow, found = fw.Aerodynamics(INFLUENCE, OMEGA), table(out, "flutter_crossings")
    for diameters in range(-2, 3):
        expected = chain_crossings(flow, diameters, SECTORS) if diameters else []
        mine = [row for row in found if int(row["nodal_diameter"]) == diameters]
        values = [(float(row["amplitude"]), 2 * np.pi * float(row["frequency_hz"])) for row in mine]
        assert values == [pytest.approx(pair, rel=1e-5) for pair in expected]
    waves = {int(row["nodal_diameter"]): row for row in table(out, "flutter_waves")}
    verdicts = {diameters: row["verdict"] for diameters, row in waves.items()}
    assert verdicts == {-2: "stable", -1: "stable", 0: "unbounded", 1: "bounded below", 2: "stable below"}
    assert [row["stable"] for row in found] == ["stable", "unstable", "unstable"]
    record = json.loads((out / "run.json").read_text())["analyses"]["flutter"]
    assert [wave["nodal_diameter"] for wave in record["waves"]] == list(range(-2, 3))
    assert any("other nodal diameters" in text for text in record["left_out"])
    with h5py.File(out / "results.h5") as file:
        points = file["flutter/points"]
        events, zeta = points["event"][()], points["zeta"][()]
        assert (np.abs(zeta[events == b"zero_damping"]) < SOLVED).all()


def test_wave_on_the_whole_wheel_from_the_case_file(write, shared_tmp, comm):
    """A mode with `aerodynamics` on all sectors meets the limit cycles of the flutter analysis."""
    mode = '[[analysis]]\nname = "wheel"\ntype = "mode"\nwheel = true\naerodynamics = true\nnodal_diameter = 1\n'
    keys = 'normalise = "mass"\nharmonics = 1\nsamples = 960\namplitude = [0.5, 20.0]\n\n'
    alone = ("amplitude = [0.2, 100.0]", "nodal_diameters = [1]\namplitude = [0.5, 20.0]")
    path = write(alone, ("[[analysis]]", mode + keys + "[[analysis]]"))
    out = shared_tmp / "wheel"
    assert run_case(path, RunOptions(out=out, plots=False), comm) == 0
    whole = [row for row in table(out, "wheel") if "zero_damping" in row["event"]]
    alone = [row for row in table(out, "flutter_crossings") if row["nodal_diameter"] == "1"]
    assert len(whole) == len(alone) == 2
    for one, other in zip(whole, alone):
        for key in ("amplitude", "frequency_hz"):
            assert float(one[key]) == pytest.approx(float(other[key]), rel=REPEATED)


WHEEL = """[[analysis]]
name = "wheel"
type = "mode"
wheel = true
aerodynamics = true
nodal_diameter = 1
normalise = "mass"
harmonics = 1
samples = 960
amplitude = [0.5, 20.0]
"""
#: A second mass on a spring to ground and to that of the next sector, which no contact touches.
SIDE = (
    ('["mass", "next"]\nM', '["mass", "side", "next", "nside"]\nM'),
    ("M = [[1.0, 0.0], [0.0, 0.0]]", f"M = {np.diag([1.0, 1.0, 0, 0]).tolist()}"),
    ("K = [[1.0, 0.0], [0.0, 0.0]]", "K = [[1, 0, 0, 0], [0, 6, 0, -1], [0, 0, 0, 0], [0, -1, 0, 1.0]]"),
    ('low = ["mass"]\nhigh = ["next"]', 'low = ["mass", "side"]\nhigh = ["next", "nside"]'),
)
#: Of the mass and of the side mass alike, and not by the flow: both waves of so many diameters are one.
DAMPER = (("K = [[1.0, 0.0], [0.0, 0.0]]", "K = [[1.0, 0.0], [0.0, 0.0]]\nC = [[-0.05, 0.0], [0.0, 0.0]]"),)
WHEELS = {
    "of the flow on one dof": ((), True),
    "of another family": ((*SIDE, ('dof = "mass"\n', "")), True),
    "of a damper": ((*DAMPER, ("aerodynamics = true\n", "")), False),
    "of a mistuned wheel": (
        (("normalise", 'mistuning = { of = "sector", standard_deviation = 1e-9 }\nnormalise'),),
        True,
    ),
}


@pytest.mark.parametrize("changes, flow", WHEELS.values(), ids=WHEELS)
def test_waves_that_grow_beside_a_cycle_of_the_wheel_are_those_of_the_closed_form(
    write, shared_tmp, comm, changes, flow
):
    flutter_analysis = TEXT[TEXT.index("[[analysis]]") :]
    out = shared_tmp / "wheel"
    assert run_case(write((flutter_analysis, WHEEL), *changes), RunOptions(out=out, plots=False), comm) == 0
    with h5py.File(out / "results.h5") as file:
        stable, *others = json.loads(file["wheel"].attrs["events"])
    assert stable["stable"] is True and not any("fed" in cycle for cycle in others)
    springs = [1.0, 2.0], [5.0, 2.0]
    growing = sorted(
        (diameters, value.imag / (2 * np.pi), -value.real / abs(value))
        for family, (ground, next_one) in enumerate(springs[: 2 if "side" in str(changes) else 1])
        for diameters in range(-2, 3)
        if (value := stuck_wave(diameters, ground, next_one, flow)).real > 0 and (family, diameters) != (0, 1)
    )
    found = sorted(
        (mode["diameters"], mode["frequency_hz"], mode["zeta"]) for mode in stable["fed"] if mode["contact"] == "stuck"
    )
    assert growing and np.allclose(found, growing, rtol=1e-6)
    log = (out / "run.log").read_text()
    assert "nodal diameters, " in log and "all sectors alike" in log


@pytest.mark.parametrize("diameters", [1, -1, 2, -2])
def test_a_mode_of_the_mistuned_wheel_runs_as_the_wave_that_is_asked_for(write, shared_tmp, comm, diameters):
    """Where the flow parts both waves of a nodal diameter further than the deviations do."""
    changes = (
        ("nodal_diameter = 1", f"nodal_diameter = {diameters}\nmistuning = {{ standard_deviation = 1e-5 }}"),
        ("amplitude = [0.5, 20.0]", "amplitude = [0.05, 0.1]"),
    )
    out = shared_tmp / "asked"
    path = write((TEXT[TEXT.index("[[analysis]]") :], WHEEL), *changes)
    assert run_case(path, RunOptions(out=out, plots=False), comm) == 0
    first, expected = table(out, "wheel")[0], stuck_wave(diameters, 1.0, 2.0, True)
    assert int(first["diameters"]) == diameters
    assert complex(-float(first["beta"]), float(first["omega"])) == pytest.approx(expected, rel=1e-4)


def test_double_modes_of_sectors_that_deviate_alike_are_told(write, shared_tmp, comm):
    """Without the flow both waves of a nodal diameter are one mode: no branch begins in a sum of them."""
    alike = ("aerodynamics = true", f"mistuning = {{ deviations = {[0.0] * SECTORS} }}")
    path = write((TEXT[TEXT.index("[[analysis]]") :], WHEEL), alike, ("harmonics = 1", "harmonics = 3"))
    with pytest.raises(fw.NotConverged, match="remove `mistuning`.*differ by 0"):
        run_case(path, RunOptions(out=shared_tmp / "alike", plots=False), comm)


def stuck_wave(diameters, ground, next_one, flow):
    """lambda of a mass while all pairs stick, lambda^2 + c lambda + k = 0: springs to the ground and to both others."""
    theta = 2 * np.pi * diameters / SECTORS
    ahead = {j: np.exp(-1j * j * theta) for j in INFLUENCE}
    damping = -sum(value.imag / OMEGA * ahead[j] for j, value in INFLUENCE.items()) if flow else -0.05
    stiffness = ground + next_one * (1 - np.cos(theta))
    stiffness -= sum(value.real * ahead[j] for j, value in INFLUENCE.items()) if flow else 0.0
    return max(np.roots([1.0, damping, stiffness]), key=lambda one: one.imag)


@pytest.mark.parametrize("flow", [False, True])
def test_pairs_that_the_load_closes_stick_in_the_linear_mode_with_and_without_flow(shared_tmp, comm, flow):
    """A mass pressed on its pad by a load alone: omega^2 = 1 + 0.4 (1 - cos theta) + kt in the wave."""
    zero = [0.0] * 4
    text = f"""
[model]
dofs = ["x", "y", "nx", "ny"]
M = {[[1.0, 0, 0, 0], [0, 1.0, 0, 0], zero, zero]}
K = {[[1.2, 0, -0.2, 0], [0, 1.0, 0, 0], [-0.2, 0, 0.2, 0], zero]}
sectors = {SECTORS}
low = ["x", "y"]
high = ["nx", "ny"]
speed_rpm = 60.0
loads_at_speed = {{ f = {{ 60 = [0.0, 11.0, 0.0, 0.0] }} }}

[preload]
loads = ["f"]
pair_loads = false

[[contact]]
name = "pad"
law = "coulomb_2d"
pairs = ["y"]
tangents = ["x"]
normal_stiffness = 10.0
tangential_stiffness = 3.0
friction_coefficient = 0.05

[aerodynamics]
frequency = 0.3
dof = "x"
influence = {{ 0 = [0.0, 0.06] }}
""" + WHEEL.replace('"mass"', '"x"').replace("aerodynamics = true", f"aerodynamics = {str(flow).lower()}")
    path, out = shared_tmp / "pad.toml", shared_tmp / "pad"
    if comm.rank == 0:
        path.write_text(text.replace("[0.5, 20.0]", "[0.1, 0.12]").replace("wheel = true\n", ""))
    comm.barrier()
    assert run_case(path, RunOptions(out=out, plots=False), comm) == 0
    with h5py.File(out / "results.h5") as file:
        stuck = file["wheel"].attrs["stuck_omega"]
    assert stuck == pytest.approx(np.sqrt(1.0 + 0.4 * (1 - np.cos(2 * np.pi / SECTORS)) + 3.0), rel=SOLVED)


@pytest.mark.ranks(1)
def test_an_interrupted_run_goes_on_in_the_wave_where_it_was(write, tmp_path, comm, monkeypatch):
    """Same points, same limit cycles as without the interruption in the third wave."""
    path = write(("amplitude = [0.2, 100.0]", "amplitude = [0.5, 10.0]"))
    assert run_case(path, RunOptions(out=tmp_path / "whole", plots=False), comm) == 0
    write_row = flutter.record

    def interrupted(writer, *arguments):
        if writer.rows == 40:
            raise KeyboardInterrupt
        return write_row(writer, *arguments)

    monkeypatch.setattr(flutter, "record", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_case(path, RunOptions(out=tmp_path / "joined", plots=False), comm)
    assert int(table(tmp_path / "joined", "flutter")[-1]["nodal_diameter"]) == 0
    monkeypatch.setattr(flutter, "record", write_row)
    assert resume_run(tmp_path / "joined", comm, plots=False) == 0
    for name in ("flutter", "flutter_waves", "flutter_crossings"):
        rows = [
            [{k: v for k, v in row.items() if k != "wall_s"} for row in table(tmp_path / folder, name)]
            for folder in ("whole", "joined")
        ]
        assert rows[0] == rows[1], name


@pytest.mark.ranks(1)
def test_pictures_show_every_wave(write, tmp_path, comm):
    out = tmp_path / "run"
    changes = [("amplitude = [0.2, 100.0]", "amplitude = [0.5, 10.0]")]
    assert run_case(write(*changes), RunOptions(out=out), comm) == 0
    assert {path.name for path in out.glob("*.png")} == {"flutter_damping.png", "flutter_limits.png"}
    (run,) = Run(out).of_kind("flutter")
    upper = pictures.damping(run).axes[0]
    assert {"ND -2", "ND 0", "ND +1", "limit cycle, stable in its own amplitude"} <= set(
        upper.get_legend_handles_labels()[1]
    )
    amplitude, zeta = pictures.wave(run, 1)
    spans = pictures.spans(amplitude, zeta)
    assert [sign for *_, sign in spans] == [-1, 1, -1]
    cycles = [cycle["amplitude"] for cycle in run.attributes["events"] if cycle["nodal_diameter"] == 1]
    assert [high for _, high, _ in spans[:2]] == pytest.approx(cycles, rel=ROUNDING)


@pytest.mark.ranks(1)
def test_spans_end_where_a_limit_cycle_was_located():
    """A located damping ratio of 1.7e-12, that is 1.7e-10 %, is zero."""
    zeta = 100.0 * np.array([-0.03, -1.7e-12, 0.08, 6e-13, -0.02])
    found = pictures.spans(np.arange(1.0, 6.0), zeta)
    assert found == [(1.0, 2.0, -1.0), (2.0, 4.0, 1.0), (4.0, 5.0, -1.0)]


def test_other_families_of_a_wave_that_the_flow_feeds_are_named(write, shared_tmp, comm):
    """A second mass on a spring k to ground, which the flow feeds too: one complex equation in a wave."""
    k, other = 9.0, ", 0.0], [0.0, {k}, 0.0], [0.0, 0.0, 0.0]]"
    path = write(
        ('["mass", "next"]\nM', '["mass", "other", "next"]\nM'),
        ("M = [[1.0, 0.0], [0.0, 0.0]]", "M = [[1.0, 0.0" + other.format(k=1.0)),
        ("K = [[1.0, 0.0], [0.0, 0.0]]", "K = [[1.0, 0.0" + other.format(k=k)),
        ('dof = "mass"\n', ""),
        ("samples = 960", "samples = 960\nnodal_diameters = [1, 2]"),
    )
    out = shared_tmp / "families"
    assert run_case(path, RunOptions(out=out, plots=False), comm) == 0
    record = json.loads((out / "run.json").read_text())["analyses"]["flutter"]
    cycles = {wave["nodal_diameter"]: wave["limit_cycles"] for wave in record["waves"]}
    (stable, unstable), (alone,) = cycles[1], cycles[2]
    ahead = {j: np.exp(-2j * np.pi * j / SECTORS) for j in INFLUENCE}
    damping = -sum(value.imag / OMEGA * ahead[j] for j, value in INFLUENCE.items())
    stiffness = k - sum(value.real * ahead[j] for j, value in INFLUENCE.items())
    value = max(np.roots([1.0, damping, stiffness]), key=lambda one: one.imag)
    assert value.real > 0 and "fed" not in unstable and "fed" not in alone
    assert [(mode["mode"], mode["contact"]) for mode in stable["fed"]] == [(2, "stuck"), (2, "contact free")]
    for mode in stable["fed"]:
        assert mode["zeta"] == pytest.approx(-value.real / abs(value), rel=SOLVED)
        assert mode["frequency_hz"] == pytest.approx(value.imag / (2 * np.pi), rel=SOLVED)
    said = f"but linear mode 2, {value.imag / (2 * np.pi):.4g} Hz, gains energy by itself"
    assert said in (out / "run.log").read_text()
    assert any("of other families" in text for text in record["left_out"])


@pytest.mark.ranks(1)
def test_check_and_the_list_of_keys_know_flutter(write, capsys, comm):
    assert check_case(write(("harmonics = 1", "harmonics = 1\nnodal_diameters = [-1, 2]")), (), (), False, comm) == 0
    assert "flutter (CNM), nodal diameters -1, 2, linear mode 1, a = 0.2 to 100 m" in capsys.readouterr().out
    keys = "\n".join(key_lines())
    assert "[aerodynamics]" in keys and "engine_order" in keys and "nodal_diameters" in keys


@pytest.mark.ranks(1)
def test_the_flow_can_be_set_from_the_command_line(write):
    case = load_case(write(), ["aerodynamics.influence.1=[0.0,0.25]", "aerodynamics.frequency=2"])
    assert case.aerodynamics.influence["1"] == [0.0, 0.25] and case.aerodynamics.frequency == 2
    assert case.resolved["aerodynamics.influence"]["-1"] == [INFLUENCE[-1].real, INFLUENCE[-1].imag]


#: (text in the case, its replacement, what is said)
WRONG = {
    "no flow": (TEXT[TEXT.index("[aero") : TEXT.index("[[analysis]]")], "", "needs forces of the flow"),
    "one wave": ("harmonics = 1", "harmonics = 1\nnodal_diameter = 1", r"nodal_diameters = \[1\]"),
    "too many": (
        "harmonics = 1",
        "harmonics = 1\nnodal_diameters = [1, 3]",
        "(?s)no wave of this wheel.*write -2, the same",
    ),
    "no flow wanted": ("harmonics = 1", "harmonics = 1\naerodynamics = false", "flutter is of the flow"),
    "wheel": ("harmonics = 1", "harmonics = 1\nwheel = true", "follows waves on one sector"),
    "no coefficients": ("influence =", "damping =", "wrong value"),
    "both": ('dof = "mass"', 'dof = "mass"\ndamping = { 1 = 0.01 }', "given beside each other"),
    "neither": (TEXT[TEXT.index("influence") : TEXT.index("[[analysis]]")], "", "are both missing"),
    "far blade": ("-1 = [", "3 = [", "is not of this wheel"),
    "no number": ("-1 = [", "left = [", "is not of this wheel"),
    "twice": ("-1 = [", "-3 = [0.0, 0.0], -1 = [", "is not of this wheel"),
    "real": ("[0.02, -0.06]", "[0.02]", r"\[real, imaginary\]"),
    "unknown dof": ('dof = "mass"', 'dof = "mas"', "unknown dof 'mas'"),
    "no frequency": (TEXT[TEXT.index("frequency") : TEXT.index("dof = ")], "", "'frequency' is missing"),
    "no sectors": (f'sectors = {SECTORS}\nlow = ["mass"]\nhigh = ["next"]\n', "", "is of no sector of a wheel"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_flutter_is_said(write, change):
    old, new, message = change
    with pytest.raises(CaseErrors, match=message):
        load_case(write((old, new)))


@pytest.mark.ranks(1)
def test_a_wave_without_damping_is_asked_for(write):
    given = TEXT[TEXT.index("dof = ") : TEXT.index("[[analysis]]")].split("\n", 1)[1]
    path = write((given, "damping = { 1 = -0.01, -1 = 0.02 }\n"), ('dof = "mass"\n', ""))
    with pytest.raises(CaseErrors, match="damping of nodal diameters -2, 0, 2"):
        load_case(path)
    path.write_text(path.read_text().replace("harmonics", "nodal_diameters = [1, -1]\nharmonics"))
    assert load_case(path).aerodynamics.damping == {"1": -0.01, "-1": 0.02}
