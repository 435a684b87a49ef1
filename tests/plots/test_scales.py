"""Prefixes on axes: values and label change together, in every system of units, and the tables do not."""

from __future__ import annotations

import numpy as np
import pytest
from models.table_rows import SHARED

from fretwave.columns import FORCED, MODE
from fretwave.plots import backbone, forced, scales
from fretwave.results.reader import Run
from fretwave.results.results import AnalysisWriter
from fretwave.units import IN_LBF_S, MM_KG_S, MM_T_S, SI, SYSTEMS

pytestmark = pytest.mark.ranks(1)


@pytest.mark.parametrize(
    ("units", "symbol", "size", "factor", "shown"),
    [
        (SI, "m", 2e-5, 1e6, "µm"),
        (SI, "m", 3e-3, 1e3, "mm"),
        (SI, "m", 0.9e-6, 1e6, "µm"),
        (SI, "m", 0.3, 1.0, "m"),
        (SI, "N", 42e3, 1e-3, "kN"),
        (SI, "Pa", 2e8, 1e-6, "MPa"),
        (SI, "s", 0.004, 1e3, "ms"),
        (SI, "m/s", 0.004, 1e3, "mm/s"),
        (SI, "N/m", 1e8, 1.0, "N/m"),
        (SI, "sqrt(kg) m", 1e-5, 1.0, "sqrt(kg) m"),
        (SI, "", 1e-5, 1.0, ""),
        (SI, "m", 0.0, 1.0, "m"),
        (SI, "m", float("nan"), 1.0, "m"),
        (SI, "m", 1e-15, 1e9, "nm"),
        (MM_T_S, "mm", 0.03, 1e3, "µm"),
        (MM_T_S, "mm", 0.3, 1.0, "mm"),
        (MM_T_S, "mm", 0.13, 1e3, "µm"),
        (SI, "m", 0.13e-3, 1e6, "µm"),
        (MM_T_S, "N", 420.0, 1.0, "N"),
        (MM_T_S, "mm", 4e3, 1e-3, "m"),
        (MM_T_S, "MPa", 0.02, 1e3, "kPa"),
        (MM_T_S, "mJ", 2e4, 1e-3, "J"),
        (MM_KG_S, "mN", 5e6, 1e-6, "kN"),
        (IN_LBF_S, "in", 0.004, 1e3, "mil"),
        (IN_LBF_S, "lbf", 4200.0, 1.0, "lbf"),
        (IN_LBF_S, "psi", 4200.0, 1.0, "psi"),
    ],
)
def test_a_prefix_suits_the_size(units, symbol, size, factor, shown):
    found, text = units.shown(symbol, size)
    assert (found, text) == (pytest.approx(factor), shown)


@pytest.mark.parametrize("units", SYSTEMS.values(), ids=list(SYSTEMS))
@pytest.mark.parametrize("quantity", ["length", "force", "energy", "pressure"])
@pytest.mark.parametrize("size", np.geomspace(1e-7, 1e7, 15))
def test_shown_numbers_mean_the_same(units, quantity, size):
    """The factor is what the symbols differ by; no number that takes a prefix is beyond 1 to 1000."""
    factor, shown = units.shown(units(quantity), size)
    powers = {"n": -9, "µ": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9}
    base = {"length": "m", "force": "N", "energy": "J", "pressure": "Pa"}[quantity]
    was = units(quantity)
    if was.endswith(base) and was[: -len(base)] in powers:
        between = powers[was[: -len(base)]] - powers[shown[: -len(base)]]
        assert factor == pytest.approx(10.0**between)
        at_the_end = shown[: -len(base)] in ("n", "G")
        assert 0.1 <= factor * size < 1000.0 * (1 + 1e-9) or at_the_end
    else:
        assert shown == was and factor == 1.0 or quantity == "length"


def test_a_logarithmic_axis_goes_by_its_middle_and_a_linear_one_by_its_end():
    values = np.array([2e-7, 1e-3])
    assert scales.logarithmic(SI, "m", values).unit == "µm"
    assert scales.linear(SI, "m", values).unit == "mm"
    assert scales.linear(SI, "m", np.array([-4e-5, np.nan]), np.array([1e-6])).unit == "µm"
    assert scales.logarithmic(SI, "m", np.zeros(3)) == scales.Scale(1.0, "m")


def write(folder, system, factor):
    """A mode from 0.01 to 0.5 mm and a response to 4 mm, with lengths in a unit of so many to the metre."""
    folder.mkdir()
    told = {"unit_system": system.name}
    writer = AnalysisWriter(folder, "mode", MODE, {"type": "mode", "normalise": "tip", **told}, ["tip"], ["1c"])
    for point, a in enumerate(np.geomspace(1e-5, 5e-4, 5)):
        row = {"point": point, "amplitude": factor * a, "omega": 6.0, "omega0": 6.0, "frequency_hz": 1.0, "beta": 0.0}
        writer.append({**row, **SHARED, "zeta": 0.01, "wall_s": 0.0, "event": ""}, np.zeros((1, 1)))
    writer.close("done", "")
    writer = AnalysisWriter(folder, "forced", FORCED, {"type": "forced", "observe": "tip", **told}, ["tip"], ["1c"])
    for point, a in enumerate((1e-3, 4e-3, 2e-3)):
        row = {"point": point, "level": 0.1, "omega": 6.0 + point, "frequency_hz": 1.0 + point, "phase": 0.0}
        writer.append({**row, **SHARED, "amplitude": factor * a, "wall_s": 0.0, "event": ""}, np.zeros((1, 1)))
    writer.close("done", "")
    return Run(folder)


def test_pictures_of_two_systems_are_the_same_and_their_tables_are_not(tmp_path):
    runs = write(tmp_path / "si", SI, 1.0), write(tmp_path / "mm", MM_T_S, 1e3)
    assert [run["mode"]["amplitude"].max() for run in runs] == pytest.approx([5e-4, 0.5])
    for run in runs:
        _, lower = backbone.draw([run["mode"]]).axes
        assert lower.get_xlabel() == "Modal amplitude of tip [µm]"
        assert lower.get_xlim() == pytest.approx((10.0, 500.0))
        left, right = forced.draw(run["forced"], [run["mode"]], None).axes
        assert (left.get_ylabel(), right.get_ylabel()) == ("Amplitude of tip [mm]", "Amplitude / level [mm]")
        np.testing.assert_allclose(left.lines[0].get_ydata().max(), 4.0)
        np.testing.assert_allclose(right.lines[0].get_ydata().max(), 40.0)
        (line,) = [line for line in left.lines if str(line.get_label()).startswith("backbone")]
        np.testing.assert_allclose(line.get_ydata().max(), 0.5)
