"""The command line as tests call it."""

from __future__ import annotations

import sys

from fretwave.commands.main import main


def call(*arguments: object) -> int:
    """Exit code of ``fretwave ...``; the hook it sets for uncaught errors is taken back."""
    hook = sys.excepthook
    try:
        return main([str(argument) for argument in arguments])
    finally:
        sys.excepthook = hook
