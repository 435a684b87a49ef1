"""How far a number may be from what it should be, by name: relative, times a scale a test writes, or of order one.

Literals that stay in tests are what a method errs by, or where its round-off lies between two of these.
"""

from __future__ import annotations

LAST_BIT = 1e-15  #: one or two roundings
LAST_DIGITS = 1e-14  #: a closed form, evaluated twice
ROUNDING = 1e-12  #: rounding of many operations, or of few with cancellation
TIGHT = 1e-10  #: solved to less than the tolerance asked for, as Newton's last step does
SOLVED = 1e-9  #: solved to the tolerance that results have
REPEATED = 1e-8  #: solved in two ways, each to its own tolerance
