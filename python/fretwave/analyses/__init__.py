"""One module per kind of analysis."""
