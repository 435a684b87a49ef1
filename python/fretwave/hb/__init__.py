"""Harmonic balance: what its unknowns are and mean."""
