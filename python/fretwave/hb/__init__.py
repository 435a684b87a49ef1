"""Harmonic balance: nonlinear modes and forced responses, and what stops them."""
