"""A study's table as CSV, as Markdown and on the terminal."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from ..post.calibration import FACTORS, JUDGED, LEAST_ERROR

Row = Mapping[str, "float | int | str"]

WITHIN = {"judged": "{judged}", **{f"within {factor}": f"{{within_{factor}:.0%}}" for factor in FACTORS}}
#: what the tables of modes and of responses begin with
RUN = {
    "sweep": "{sweep}",
    "H": "{harmonics}",
    "N_t": "{samples}",
    "tolerance": "{tolerance:.0e}",
    "modes": "{component_modes}",
    "accuracy": "{accuracy:.0e}",
    "kept": "{kept:.0%}",
    "best fixed [s]": "{best_fixed_s:.3f}",
    "points": "{points}",
    "Newton": "{newton}",
    "time [s]": "{cpu_s:.3f}",
}
#: heading of the printed table -> how a row fills it
PRINTED = {
    **RUN,
    "peak zeta": "{peak_zeta:.6f}",
    "error of peak": "{peak_zeta_error:.1e}",
    "error of zeta": "{zeta_error:.1e}",
    "error of omega": "{omega_error:.1e}",
    "estimated": "{zeta_error_estimate:.1e}",
    **WITHIN,
}
#: the same of a forced response
PRINTED_OF_RESPONSE = {
    **RUN,
    "peak": "{peak_amplitude:.6g}",
    "error of peak": "{peak_amplitude_error:.1e}",
    "error of amplitude": "{amplitude_error:.1e}",
    "estimated": "{amplitude_error_estimate:.1e}",
    **WITHIN,
}

NOT_A_NUMBER = re.compile("^nan%?$")

_LEAST = f"{LEAST_ERROR:.0e}".replace("e-0", "e-")

LEGEND = (
    "Errors are against the finest run (marked): of peak zeta relative; of zeta the largest over the amplitudes that "
    "all runs meet exactly once, divided by the peak (where there is no damping as they are); of omega the largest "
    "relative one over the same. Estimated is "
    "the error of zeta by what the sweep changes, of the finest run by all, as the run itself says; within "
    f"{' and '.join(map(str, FACTORS))}: the share of the amplitudes at which the estimated error of lambda is within "
    f"that factor of the error, of those judged: where this is above {_LEAST} 1/s and {JUDGED:g} times what the finest "
    "run states of its own there."
)
LEGEND_OF_RESPONSE = (
    "Errors are against the finest run (marked): of the peak relative; of the complex amplitude the largest over the "
    "frequencies that all runs meet exactly once, divided by the peak. Estimated is that error by what the sweep "
    "changes, of the finest run by all, as the run itself says; within "
    f"{' and '.join(map(str, FACTORS))}: the share of the frequencies at which it is within that factor of the error, "
    f"of those judged: where this is above {_LEAST} of the peak and {JUDGED:g} times what the finest run states of its "
    "own there."
)
LEGEND_OF_ACCURACY = (
    "Times are the processor's. Of a run that chooses its harmonics and samples, the most it took; its time is with "
    "that of the estimates. Kept: the share of these places at which lambda, over zeta omega0, or the complex "
    "amplitude is that accurate; best fixed: the time of the quickest run with one set that keeps it at 95 % of them "
    "(its estimates not counted)."
)


#: the same of a study of wear
PRINTED_OF_WEAR = {
    "sweep": "{sweep}",
    "H": "{harmonics}",
    "tolerance": "{tolerance:.0e}",
    "pressure change": "{pressure_change:g}",
    "steps": "{steps}",
    "Newton": "{newton}",
    "time [s]": "{wall_s:.3f}",
    "frequency [Hz]": "{frequency_hz:.5f}",
    "zeta [%]": "{zeta_percent:.5f}",
    "worn [mm^3]": "{worn_mm3:.5f}",
    "error of omega": "{omega_error:.1e}",
    "error of zeta": "{zeta_error:.1e}",
    "error of worn": "{worn_error:.1e}",
}

LEGEND_OF_WEAR = (
    "Values are those after the last cycle, errors of them are relative to the finest run of each sweep (marked)."
)


def markdown(
    rows: Sequence[Row], notes: Sequence[str] = (), printed: Mapping[str, str] = PRINTED, legend: str = LEGEND
) -> str:
    """Aligned Markdown table with its legend; readable as plain text too."""
    reduced = any(row.get("component_modes", -1) != -1 for row in rows)
    asked = any(row.get("accuracy", math.nan) == row.get("accuracy") for row in rows)
    hidden = set() if reduced else {"modes"}
    hidden |= set() if asked else {"accuracy", "kept", "best fixed [s]"}
    shown = {name: form for name, form in printed.items() if name not in hidden}
    body = [[NOT_A_NUMBER.sub("-", form.format(**row)) for form in shown.values()] for row in rows]
    for cells, row in zip(body, rows):
        cells[0] += " (finest)" if row["reference"] else ""
    widths = [max(len(line[i]) for line in (list(shown), *body)) for i in range(len(shown))]
    lines = [_line(shown, widths), "|" + "|".join("-" * (width + 1) + ":" for width in widths) + "|"]
    lines += [_line(cells, widths) for cells in body]
    return "\n".join([*lines, "", legend, *([LEGEND_OF_ACCURACY] if asked else []), *notes, ""])


def _line(cells: Sequence[str] | Mapping[str, str], widths: Sequence[int]) -> str:
    return "|" + "|".join(f" {cell:>{width}} " for cell, width in zip(cells, widths)) + "|"
