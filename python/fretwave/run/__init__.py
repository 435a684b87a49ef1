"""Runs of cases: all analyses of one, sweeps, studies."""
