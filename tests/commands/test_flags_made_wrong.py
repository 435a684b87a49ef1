"""`cases/robustness/command_lines.py` makes every flag of every command wrong: a new one is to be put there."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from command_line import call

sys.path.insert(0, str(Path(__file__).parents[2] / "cases" / "robustness"))
from command_lines import COMMANDS  # noqa: E402

pytestmark = pytest.mark.ranks(1)


def test_every_command_is_made_wrong(capfd) -> None:
    assert call("--help") == 0
    named = re.findall(r"^    ([a-z]+) +\S", capfd.readouterr().out, re.MULTILINE)
    assert len(named) > 10 and not set(named) - set(COMMANDS)


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in ("", "nonsense")])
def test_every_flag_is_made_wrong(name: str, capfd) -> None:
    """And none that is there no more, but for one that never was."""
    assert call(name, "--help") == 0
    flags = set(re.findall(r"(?:^  |\[|, )(--[\w-]+)", capfd.readouterr().out, re.MULTILINE))
    known = {flag for flag in COMMANDS[name][1] if flag.startswith("--")}
    assert (flags - {"--help"} - known, known - flags - {"--nonsense"}) == (set(), set())
