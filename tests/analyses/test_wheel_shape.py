"""Measures of a wheel's shape and what is noted of its samples and folds; deviations that a seed draws."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import LAST_BIT, LAST_DIGITS

from fretwave.analyses.parts.wheel_shape import one_by_one
from fretwave.analyses.parts.wheel_start import uneven_samples
from fretwave.case.analysis_tables import MistuningSection
from fretwave.case.wheel import deviations_of
from fretwave.cyclic.engine_order import folded
from fretwave.post.wave_content import participation, phases, wave_content


@pytest.mark.ranks(1)
def test_deviations_depend_on_the_seed_alone():
    draw = lambda seed, n=1000: deviations_of(MistuningSection(standard_deviation=0.02, seed=seed), n)  # noqa: E731
    assert np.array_equal(draw(1), draw(1)) and not np.allclose(draw(1), draw(2))
    assert abs(draw(1).mean()) < 1e-17 and draw(1).std() == pytest.approx(0.02, rel=0.1)


@pytest.mark.ranks(1)
def test_measures_of_a_shape():
    """Closed forms of the module's definitions."""
    j = np.arange(12)
    for diameters in (3, -3):
        content = np.abs(wave_content(2.0 * np.exp(-2j * np.pi * diameters * j / 12)))
        assert content[diameters] == pytest.approx(2.0) and np.delete(content, diameters).max() < LAST_BIT
    assert participation(np.exp(1j * j)) == pytest.approx(1.0)
    assert participation(np.cos(2 * np.pi * j / 12) + 0j) == pytest.approx(2 / 3)
    assert participation((j == 4) + 0j) == pytest.approx(1 / 12)
    assert [folded(k, 6) for k in range(6)] == [0, 1, 2, 3, -2, -1] and folded(3, 5) == -2


@pytest.mark.ranks(1)
def test_no_phase_jumps_where_sectors_move_against_each_other():
    """On either side of the cut by rounding, or exactly on it."""
    a = -np.exp(1j * np.array([-1e-15, 0.0, 1e-15, 0.5, -0.5]))
    assert phases(a) == pytest.approx(np.pi + np.array([0.0, 0.0, 0.0, 0.5 - 2.0 * np.pi, -0.5]), abs=LAST_DIGITS)
    assert phases(np.array([1.0, 1j, -1j])) == pytest.approx([0.0, np.pi / 2.0, -np.pi / 2.0])


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    ("samples", "sectors", "diameters", "better"), [(128, 150, 25, 132), (360, 36, 4, None), (64, 7, 2, 70)]
)
def test_samples_that_differ_from_sector_to_sector_are_told(samples, sectors, diameters, better):
    note = uneven_samples(samples, sectors, diameters)
    assert note is None if better is None else f"samples = {better} " in note
    assert better is None or uneven_samples(better, sectors, diameters) is None


@pytest.mark.ranks(1)
def test_folds_at_one_amplitude_are_explained():
    table = {"amplitude": np.array([1e-4, *(2e-4 + 1e-8 * np.arange(9))]), "event": np.array(["start"] + 9 * ["fold"])}
    assert "one after another" in one_by_one(table, "m")
    spread = {**table, "amplitude": np.geomspace(1e-4, 1e-3, 10)}
    assert one_by_one(spread, "m") == "" and one_by_one({k: v[:5] for k, v in table.items()}, "m") == ""
