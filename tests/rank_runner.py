"""Runs pytest once per number of MPI ranks and counts what really ran.

A test that was asked for and did not run to its end on every rank (crash, hang, abort) is counted as a failure, so that
a green last line means: every test, on every number of ranks it asks for. Where there are more cores than ranks,
several pytests share the test files: each takes the next that nobody has begun (``Claims`` in conftest.py).
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EVENTS = ROOT / ".build" / "tests"
#: Test modules as pytest compiles them, from one process to the next: a dozen read the same.
COMPILED = ROOT / ".build" / "compiled_tests"
#: At most so many pytests side by side: tests start programs of their own.
MOST_SHARES = 4
#: An outcome hides those before it: the worst rank speaks for the test.
WORST_LAST = ["passed", "skipped", "started", "failed"]


@dataclass
class Count:
    """Outcome of the tests on one number of ranks."""

    ranks: int
    expected: int
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    not_run: int = 0
    notes: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        text = f"{self.ranks} rank{'s' if self.ranks > 1 else ''}: {self.passed} passed, {self.failed} failed"
        text += f", {self.skipped} skipped" if self.skipped else ""
        text += f", {self.not_run} not run" if self.not_run else ""
        return text + f" (expected {self.expected})"


def read_outcomes(folder: Path, ranks: int) -> dict[str, str]:
    """Outcome of each test over all shares and ranks; a test that a rank did not finish is "started"."""
    return {test: word for share in folder.glob("share_*/") for test, word in read_share(share, ranks).items()}


def read_share(folder: Path, ranks: int) -> dict[str, str]:
    outcomes: dict[str, str] = {}
    per_rank = [read_rank(folder / f"rank_{rank}.jsonl") for rank in range(ranks)]
    for test in {test for outcome in per_rank for test in outcome}:
        outcomes[test] = max((outcome.get(test, "started") for outcome in per_rank), key=WORST_LAST.index)
    return outcomes


def read_rank(path: Path) -> dict[str, str]:
    if not path.exists():
        return {}
    events = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {event["test"]: event["outcome"] for event in events}


def count_outcomes(ranks: int, expected: set[str], outcomes: dict[str, str], ending: str) -> Count:
    """Compare what ran with what was asked for; `ending` says how the processes ended, "" when well."""
    words = [outcomes.get(test, "") for test in sorted(expected)]
    unfinished = sorted(test for test in expected if outcomes.get(test) == "started")
    unasked = sorted(set(outcomes) - expected)
    count = Count(ranks, len(expected), passed=words.count("passed"), skipped=words.count("skipped"))
    count.not_run = words.count("")
    count.failed = words.count("failed") + len(unfinished) + len(unasked)
    count.notes += [f"{test} did not finish ({ending})" for test in unfinished]
    count.notes += [f"{test} ran though it was not collected for {ranks} ranks" for test in unasked]
    if count.not_run:
        reason = ending or "and pytest said nothing"
        count.notes.append(f"{count.not_run} of {count.expected} tests did not run ({reason})")
    if ending and not count.failed and not count.not_run:
        count.notes.append(f"every test passed, but the processes ended with {ending}: counted as one failure")
        count.failed = 1
    return count


def total(counts: list[Count]) -> tuple[str, bool]:
    """Last line, and whether all is well. Tests that did not run are failures."""
    passed = sum(count.passed for count in counts)
    failed = sum(count.failed + count.not_run for count in counts)
    skipped = sum(count.skipped for count in counts)
    line = f"{passed} passed, {failed} failed" + (f", {skipped} skipped" if skipped else "")
    return line, failed == 0 and passed > 0


def pytest_command(arguments: list[str]) -> list[str]:
    config = ["-c", str(ROOT / "python" / "pyproject.toml"), f"--rootdir={ROOT}", "-p", "no:cacheprovider"]
    resolved = absolute_paths(arguments)
    if resolved == arguments:
        resolved = [*arguments, str(ROOT / "tests")]
    return [sys.executable, "-m", "pytest", *config, *resolved]


def absolute_paths(arguments: list[str]) -> list[str]:
    """Test paths are relative to where the caller stands, pytest runs in the root."""
    resolved = []
    for before, argument in zip(["", *arguments], arguments):
        path, separator, test = argument.partition("::")
        is_path = not argument.startswith("-") and before not in {"-k", "-m", "-o", "-p"} and Path(path).exists()
        resolved.append(f"{Path(path).resolve()}{separator}{test}" if is_path else argument)
    return resolved


def collect(arguments: list[str]) -> dict[str, list[int]]:
    """Ask every test for its numbers of ranks, without running any."""
    listing = EVENTS / "collected.json"
    environment = {**compiling(), "FRETWAVE_TEST_COLLECT": str(listing)}
    done = subprocess.run(
        [*pytest_command(arguments), "--collect-only", "-q"],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    if done.returncode == 0:
        return json.loads(listing.read_text(encoding="utf-8"))
    print(done.stdout)
    reason = "no test matches the arguments" if done.returncode == 5 else f"pytest ended with code {done.returncode}"
    print(f"error: collecting the tests failed: {reason}\nfix: correct what is reported above")
    print("0 passed, 1 failed")
    sys.exit(1)


def compiling() -> dict[str, str]:
    """The environment, with what is compiled kept beside the sources, also where they are not to be written to."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPYCACHEPREFIX": str(COMPILED)}


def shares_for(ranks: int) -> int:
    """How many pytests of so many ranks run side by side: one a core."""
    return max(1, min(MOST_SHARES, len(os.sched_getaffinity(0)) // ranks))


def run_ranks(ranks: int, expected: set[str], arguments: list[str], timeout: float) -> str:
    """Run pytest on `ranks` processes, side by side on what cores there are; returns how they ended, "" when well."""
    folder = events_folder(ranks)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "files").write_text("\n".join(sorted({test.partition("::")[0] for test in expected})), encoding="utf-8")
    shares = shares_for(ranks)
    running = [start(ranks, share, folder, arguments, timeout) for share in range(shares)]
    deadline = time.monotonic() + timeout
    try:
        endings = [wait(process, deadline, timeout) for process in running]
    except BaseException:
        for process in running:
            end(process)
        raise
    for share in range(1, shares):
        print((folder / f"share_{share}.log").read_text(encoding="utf-8"), end="", flush=True)
    return next((ending for ending in endings if ending), "")


def start(ranks: int, share: int, folder: Path, arguments: list[str], timeout: float) -> subprocess.Popen:
    """One pytest; the first writes to the terminal, the others to files that are shown when all have ended."""
    events = folder / f"share_{share}"
    events.mkdir(parents=True)
    # mpirun gives every rank a terminal of its own, whatever this one is.
    colour = "--color=yes" if sys.stdout.isatty() else "--color=no"
    command = pytest_command(["-q", colour, f"--override-ini=faulthandler_timeout={0.8 * timeout}", *arguments])
    if shares_for(ranks) > 1:  # a share of the tests has no percentage
        command = [*command, "--override-ini=console_output_style=classic"]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    claims = folder / "claims"
    claims.mkdir(exist_ok=True)
    environment = {**compiling(), "FRETWAVE_TEST_EVENTS": str(events), "FRETWAVE_TEST_CLAIMS": str(claims)}
    environment["FRETWAVE_TEST_FILES"] = str(folder / "files")
    with open(folder / f"share_{share}.log", "wb") as log:
        # Its own session, so that a hanging tree of processes can be ended as a whole.
        return subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=log if share else None,
            stderr=subprocess.STDOUT if share else None,
            start_new_session=True,
        )


def wait(process: subprocess.Popen, deadline: float, timeout: float) -> str:
    """How it ended, "" when well."""
    try:
        code = process.wait(max(deadline - time.monotonic(), 0.0))
    except subprocess.TimeoutExpired:
        end(process)
        return f"no end after {timeout:g} s"
    return f"exit code {code}" if code else ""


def end(process: subprocess.Popen) -> None:
    """mpirun ends its ranks on SIGTERM; what is left after that is killed."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
            process.wait(10)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            continue


def events_folder(ranks: int) -> Path:
    return EVENTS / f"ranks_{ranks}"


def main(arguments: list[str]) -> int:
    timeout = float(os.environ.get("FRETWAVE_TEST_TIMEOUT", "1500"))
    only = os.environ.get("FRETWAVE_TEST_RANKS")
    EVENTS.mkdir(parents=True, exist_ok=True)
    asked = collect(arguments)
    sizes = sorted({n for counts in asked.values() for n in counts})
    if only:
        sizes = [n for n in sizes if n in {int(word) for word in only.replace(",", " ").split()}]
    counts = []
    for ranks in sizes:
        expected = {test for test, sizes_of_test in asked.items() if ranks in sizes_of_test}
        print(f"== {len(expected)} tests on {ranks} rank{'s' if ranks > 1 else ''}", flush=True)
        ending = run_ranks(ranks, expected, arguments, timeout)
        counts.append(count_outcomes(ranks, expected, read_outcomes(events_folder(ranks), ranks), ending))
    return report(counts, only)


def report(counts: list[Count], only: str | None) -> int:
    print(f"== tests per number of ranks{f' (only {only} asked for)' if only else ''}")
    for count in counts:
        for note in count.notes:
            print(f"  {note}")
        print(count)
    line, well = total(counts)
    print(line, flush=True)
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
