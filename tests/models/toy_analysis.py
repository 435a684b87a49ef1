"""An analysis in one file, as a case names it under `plugins`: the linear response with the contact stuck."""

from __future__ import annotations

from typing import Literal, Optional

import numpy as np

import fretwave as fw

COLUMNS = (
    fw.Column("point", "1", "number of the point", "i"),
    fw.Column("frequency_hz", "Hz", "frequency of the force"),
    fw.Column("amplitude", "length", "amplitude of the observed dof"),
)


@fw.register_analysis
class Receptance(fw.AnalysisSection):
    """``type = "receptance"``: response to a force of 1 N on one dof, by superposition of stuck modes."""

    type: Literal["receptance"]
    dof: str = fw.key("dof that the force acts on, and that is observed", example='"tip"')
    frequency: list[float] = fw.key("frequencies of the force", "Hz", "[100.0, 200.0]", min_length=1)
    loss: float = fw.key("loss factor of all modes", "-", "0.01", default=0.01, gt=0)
    modes: int = fw.key("modes that are superposed", example="3", default=1, ge=1)
    after: Optional[str] = fw.key("static analysis whose pairs are counted", example='"rest"', default=None)

    def needs(self):
        return [self.after] if self.after else []

    def kept_dofs(self):
        return [*super().kept_dofs(), self.dof]

    def check(self, report, facts):
        super().check(report, facts)
        report.dof(("dof",), self.dof, facts.named)
        if self.frequency != sorted(self.frequency):
            report.wrong(("frequency",), "is out of order", "ascending frequencies", "sort them")

    def headline(self):
        return f"receptance of {self.dof} at {len(self.frequency)} frequencies"

    def run(self, context):
        modes, dof = context.linear_mode("stuck", self.modes), context.case.dof(self.dof)
        writer = context.writer(COLUMNS, labels=["1c", "1s"], samples=16)
        for frequency in self.frequency:
            omega = 2 * np.pi * frequency
            gains = [mode.shape[dof] / (mode.omega**2 * (1 + 1j * self.loss) - omega**2) for mode in modes]
            x = sum(gain * mode.shape for gain, mode in zip(gains, modes))
            row = {"point": writer.rows, "frequency_hz": frequency, "amplitude": abs(x[dof])}
            writer.append(row, np.column_stack([x.real, -x.imag]))
        writer.close("done", "all frequencies")
        pairs = len(context.table(self.after)["pair"]) if self.after else 0
        lines = [f"{self.name}: {writer.rows} frequencies" + (f", {pairs} pairs at rest" if self.after else "")]
        return fw.Outcome(writer.rows, "all frequencies", True, lines)

    @classmethod
    def figures(cls, run):
        from matplotlib.figure import Figure

        for analysis in run.of_kind("receptance"):
            figure = Figure(layout="constrained")
            axes = figure.add_subplot()
            axes.semilogy(analysis["frequency_hz"], analysis["amplitude"], "o-")
            axes.set(xlabel="Frequency [Hz]", ylabel="Amplitude [m]")
            yield f"{analysis.name}_receptance", figure
