"""Run command lines of fretwave in a worker process that may crash, hang or run out of memory.

A worker is one Python process that runs one command after the other (a start with MPI costs ten times a check).
It is limited in memory and, for each command, in processor time, so that a busy machine makes no hang of a slow one.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: Address space of a worker [bytes]: what asks for more gets an error instead of the machine.
MEMORY = 12 << 30
#: A command that sleeps this many times longer than it may compute hangs as well (a deadlock uses no processor).
PATIENCE = 10

WORDS = {0: "done", 1: "other (1)", 2: "refused (2)", 3: "not converged (3)"}
BAD = ("traceback", "PETSc text", "crash", "hang", "other (1)")


@dataclass(frozen=True)
class Ended:
    """What became of a command: its outcome in a word, its code and what it printed on stderr."""

    outcome: str
    code: int
    text: str
    seconds: float

    @property
    def bad(self) -> bool:
        return self.outcome in BAD


class Worker:
    """Runs commands one by one in a process of its own, which is replaced when it dies."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def end(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def run(self, arguments: list[str], folder: Path, limit: float) -> Ended:
        """One command line, which may use `limit` seconds of processor time."""
        process = self._started()
        assert process.stdin is not None and process.stdout is not None
        began, used = time.monotonic(), _processor_time(process.pid)
        process.stdin.write(json.dumps({"arguments": arguments, "folder": str(folder)}) + "\n")
        process.stdin.flush()
        while not select.select([process.stdout], [], [], 0.2)[0]:
            seconds = time.monotonic() - began
            if _processor_time(process.pid) - used > limit or seconds > PATIENCE * limit:
                self.end()
                return Ended("hang", -1, f"more than {limit:g} s of processor time", seconds)
        answer = process.stdout.readline()
        seconds = time.monotonic() - began
        if not answer:
            code = process.wait()
            self._process = None
            return Ended("crash", code, f"the process ended with {code}", seconds)
        told = json.loads(answer)
        ended = Ended(_outcome(told["code"], told["text"]), told["code"], told["text"], seconds)
        if ended.bad:
            self.end()  # an error may leave PETSc in a state that spoils the next command
        return ended

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None:
            pipe = subprocess.PIPE
            command = [sys.executable, __file__]
            self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        return self._process


def _processor_time(pid: int) -> float:
    with contextlib.suppress(OSError, IndexError):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def _outcome(code: int, text: str) -> str:
    if "Traceback (most recent call last)" in text:
        return "traceback"
    if "PETSC ERROR" in text or "MUMPS" in text.split("error:")[0]:
        return "PETSc text"
    return WORDS.get(code, f"code {code}")


def _serve() -> None:
    """Read commands from stdin, answer on stdout, which the commands themselves never see."""
    answers = os.fdopen(os.dup(1), "w")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ["MPLBACKEND"] = "Agg"
    for line in sys.stdin:
        told = json.loads(line)
        answers.write(json.dumps(_answer(told)) + "\n")
        answers.flush()


def _answer(told: dict[str, Any]) -> dict[str, Any]:
    from fretwave import main

    os.chdir(told["folder"])
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as file:
        sys.stdout.flush(), sys.stderr.flush()
        os.dup2(file.fileno(), 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = main(told["arguments"])
        sys.stdout.flush(), sys.stderr.flush()
        file.seek(0)
        return {"code": code, "text": file.read()[-20000:]}


if __name__ == "__main__":
    _serve()
