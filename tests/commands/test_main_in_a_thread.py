"""The command line called from another thread than the main one, as a program with a window does."""

from __future__ import annotations

import signal
from concurrent.futures import ThreadPoolExecutor

import pytest
from command_line import call

from fretwave.commands import main

pytestmark = pytest.mark.ranks(1)


def mask() -> set[int]:
    return set(signal.pthread_sigmask(signal.SIG_BLOCK, set()))


@pytest.mark.parametrize("words", ["doctor --help", "doctor --constants", "check --keys"])
def test_a_command_in_a_thread(words: str) -> None:
    """Only the main thread may set a handler: ValueError, and the thread's signals stayed blocked."""

    def work() -> tuple[int, bool]:
        before = mask()
        return call(*words.split()), mask() == before

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(work).result() == (0, True)


def test_a_signal_that_waits_is_forgotten() -> None:
    """Of a reader who has left while PETSc was not to hear of it."""
    heard: list[int] = []

    def work() -> bool:
        with main._pipes_break_in_python():
            signal.raise_signal(signal.SIGPIPE)
        return signal.SIGPIPE in signal.sigpending() | mask()

    before = signal.signal(signal.SIGPIPE, lambda number, _: heard.append(number))
    try:
        with ThreadPoolExecutor(1) as pool:
            assert not pool.submit(work).result()
        assert not heard
    finally:
        signal.signal(signal.SIGPIPE, before)
