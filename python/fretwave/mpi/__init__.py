"""Ranks: errors on one of them, groups, PETSc options, interrupts."""
