"""What the legends of a figure say."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure


def legend_texts(figure: Figure) -> list[str]:
    """Every entry above the axes, as one reads: row by row (a legend is filled by columns)."""
    found = []
    for legend in figure.legends:
        names = np.array([text.get_text() for text in legend.get_texts()], dtype=object)
        columns = np.array_split(names, min(legend._ncols, len(names)))
        found += [column[row] for row in range(len(columns[0])) for column in columns if row < len(column)]
    return found
