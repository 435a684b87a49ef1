"""Numbers from results; NumPy and SciPy only."""
