"""What a stranger types first: nothing, ``--version``, ``--help`` of each command; said once, whatever the ranks."""

from __future__ import annotations

from importlib.metadata import version

import pytest
from command_line import call

from fretwave.run.at_rest import MOST_DOFS

pytestmark = pytest.mark.ranks(1)

COMMANDS = ("init", "run", "check", "sweep", "resume", "show", "report", "plot", "probe", "view", "import", "study")
COMMANDS = (*COMMANDS, "doctor")


def test_nothing_is_the_help(capfd) -> None:
    assert call() == 0
    said = capfd.readouterr()
    assert said.out.startswith("usage: fretwave") and said.err == ""
    for name in COMMANDS:
        assert f"\n    {name}" in said.out


def test_version(capfd) -> None:
    assert call("--version") == 0
    assert capfd.readouterr().out == f"fretwave {version('fretwave')}\n"


@pytest.mark.parametrize("name", (*COMMANDS, "stress"))
def test_every_command_has_its_help(name: str, capfd) -> None:
    assert call(name, "--help") == 0
    said = capfd.readouterr().out
    assert f"usage: fretwave {name}" in said and "``" not in said


def test_the_help_of_check_says_which_wheels_it_leaves(capfd) -> None:
    assert call("check", "--help") == 0
    assert f"more than {MOST_DOFS:,} dofs" in " ".join(capfd.readouterr().out.split())


def test_two_ranks_say_it_once(launch) -> None:
    for words, said in (([], "usage: fretwave "), (["--version"], "fretwave 0"), (["doctor", "--help"], "usage: ")):
        done = launch(2, "-m", "fretwave", *words)
        assert done.returncode == 0, done.stderr
        assert done.stdout.count(said) == 1


@pytest.mark.parametrize("what", ["--keys", "--schema"])
def test_two_ranks_list_the_keys_once(launch, what: str) -> None:
    one, two = (launch(ranks, "-m", "fretwave", "check", what) for ranks in (1, 2))
    assert two.returncode == 0, two.stderr
    assert two.stdout == one.stdout and len(one.stdout) > 1000
