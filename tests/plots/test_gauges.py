"""Pictures of gauges and stress: what an analysis goes over."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fretwave.plots.gauges import draw
from fretwave.units import SI

pytestmark = pytest.mark.ranks(1)


def analysis(kind: str) -> Any:
    units = {"frequency_hz": "Hz", "cycles": "1", "amplitude": "m", "largest_amplitude": "m"}
    return SimpleNamespace(kind=kind, unit_system=SI, unit=units.__getitem__, observed=lambda: "tip")


def table(**columns: Any) -> dict[str, Any]:
    known = {"stress_amplitude": [1e6, 2e6, 1e6, 3e6], "mean_stress": [0.0] * 4, "goodman": [0.5, 0.8, 0.6, 1.4]}
    return {name: np.array(values, dtype=float) for name, values in {**known, **columns}.items()}


def test_wear_goes_over_its_cycles() -> None:
    """At one amplitude each: over that, a line would be one point."""
    given = table(line=[0, 0, 1, 1], cycles=[0.0, 4.0, 0.0, 4.0], amplitude=[1e-3, 1e-3, 2e-3, 2e-3])
    figure = draw(analysis("wear"), given)
    assert figure.axes[-1].get_xlabel() == "Wear cycles"
    lines = {line.get_label(): list(line.get_xdata()) for line in figure.axes[-1].lines}
    assert lines["1 mm"] == lines["2 mm"] == [0.0, 4.0]
    assert lines["reached after 2 cycles"] == pytest.approx([2.0])


def test_a_driven_wheel_reaches_the_limit_at_the_amplitude_of_any_sector() -> None:
    moved = {"amplitude": [1e-3, 1e-3, 1e-3, 1e-3], "largest_amplitude": [2e-3, 2e-3, 2e-3, 4e-3]}
    figure = draw(analysis("forced"), table(frequency_hz=[1.0, 2.0, 3.0, 4.0], **moved))
    assert "reached at an amplitude of any sector of 3 mm" in [line.get_label() for line in figure.axes[-1].lines]
