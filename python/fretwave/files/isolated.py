"""Read files of other programs in a process of its own: a damaged one can crash, hang or fill the memory of a reader.

Only readers that need no MPI. What is read comes back as a pickle, from our own child alone.
"""

from __future__ import annotations

import importlib
import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from ..errors import FretwaveError, InputError

#: Longest time for one file, in seconds: a hundred times what a file of 10 GB takes to be read.
PATIENCE = 3600.0
#: Memory that a reader may use: what it needs itself, and this many times the size of its files.
MEMORY = 4 << 30
MEMORY_TIMES = 64


def call_isolated(module: str, function: str, *arguments: object, size: int = 0) -> Any:
    """``module.function(*arguments)``, run in a child process.

    Parameters
    ----------
    size : int
        Bytes of the files it reads, which bound its memory.

    Raises
    ------
    FretwaveError
        As the function did.
    InputError
        It ended without an answer, or in another error.
    """
    with tempfile.TemporaryDirectory(prefix="fretwave-") as folder:
        answer = Path(folder) / "answer"
        order = pickle.dumps((module, function, arguments, str(answer), MEMORY + MEMORY_TIMES * size))
        told = _run(order)
        if told or not answer.exists():
            raise InputError(
                "a file cannot be read", measured=told or "its reader gave no answer", fix="is the file complete?"
            )
        error, result = pickle.loads(answer.read_bytes())
    if error is not None:
        raise error
    return result


def _run(order: bytes) -> str:
    """Why the child did not end well, "" when it did."""
    # The child of a rank is no rank: it must not find what mpirun told its parent.
    plain = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PMI_", "PRTE_", "SLURM_"))}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "fretwave.files.isolated"],
            input=order,
            env={**plain, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return f"it could not be read in {PATIENCE:.0f} s"
    if done.returncode < 0:
        return f"its reader crashed ({signal.Signals(-done.returncode).name})"
    last = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
    return "" if done.returncode == 0 else f"its reader failed: {''.join(last)}"


def main() -> int:
    """The child: do what standard input says, leave the answer in a file."""
    module, function, arguments, answer, memory = pickle.load(sys.stdin.buffer)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY:
        resource.setrlimit(resource.RLIMIT_AS, (memory if hard == resource.RLIM_INFINITY else min(memory, hard), hard))
    result: tuple[FretwaveError | None, Any] = (None, None)
    try:
        result = (None, getattr(importlib.import_module(module), function)(*arguments))
    except FretwaveError as error:
        result = (error, None)
    except Exception as error:  # a damaged file makes the readers of NumPy, SciPy and h5py raise anything
        text = " ".join(str(error).split()) or "no memory for what the file says it holds" * (
            isinstance(error, MemoryError)
        )
        fix = "is the file complete? write or export it again"
        result = (InputError("a file cannot be read", None, f"{type(error).__name__}: {text}", None, fix), None)
    Path(answer).write_bytes(pickle.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
