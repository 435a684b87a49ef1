"""Tests under MPI: which test runs on how many ranks, one report, and no hang when a rank fails.

A test asks for communicator sizes with ``@pytest.mark.ranks(1, 3)``; without the marker it runs on 1 and on 2 ranks.
``tests/rank_runner.py`` starts pytest once per size and reads the events written here (``FRETWAVE_TEST_EVENTS``).
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

#: Tests take structures from one another by their modules' names, whatever folder they are in.
sys.path[:0] = [str(folder) for folder in sorted(Path(__file__).parent.iterdir()) if folder.is_dir()]

DEFAULT_RANKS = (1, 2)
#: How long a rank that failed waits for the others to reach the end of the same test [s].
GRACE = 3.0

WORLD = MPI.COMM_WORLD
EVENTS = os.environ.get("FRETWAVE_TEST_EVENTS")
COLLECT = os.environ.get("FRETWAVE_TEST_COLLECT")
CLAIMS = os.environ.get("FRETWAVE_TEST_CLAIMS")
#: Lists the files that have tests for this number of ranks; others need not be imported.
FILES = os.environ.get("FRETWAVE_TEST_FILES")


def rank_counts(item: pytest.Item) -> tuple[int, ...]:
    """Communicator sizes a test asks for."""
    marker = item.get_closest_marker("ranks")
    if marker is None:
        return DEFAULT_RANKS
    counts = marker.args
    if not counts or not all(isinstance(n, int) and n >= 1 for n in counts):
        raise pytest.UsageError(f"{item.nodeid}: ranks{counts} expects whole numbers, for example ranks(1, 3)")
    return tuple(counts)


def write_event(**event: object) -> None:
    """Append one line to this rank's event file; it survives a crash of the process."""
    if EVENTS:
        with open(Path(EVENTS) / f"rank_{WORLD.rank}.jsonl", "a", encoding="utf-8") as file:
            file.write(json.dumps(event) + "\n")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "ranks(*counts): numbers of MPI ranks the test runs on (default 1 and 2)")
    claims = Claims(Path(CLAIMS) if CLAIMS else None)
    config.pluginmanager.register(claims, "fretwave-claims")
    config.pluginmanager.register(Lockstep(config, claims), "fretwave-lockstep")
    if EVENTS and not config.option.basetemp:
        config.option.basetemp = str(Path(EVENTS) / f"tmp_{WORLD.rank}")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files without a test for this number of ranks; the runner knows which have one."""
    if not FILES or collection_path.suffix != ".py":
        return None
    wanted = Path(FILES).read_text(encoding="utf-8").splitlines()
    return True if os.path.relpath(collection_path, config.rootpath) not in wanted else None


def pytest_sessionstart(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.getplugin("terminalreporter")
    if WORLD.rank > 0 and reporter is not None:
        reporter._tw._file = open(os.devnull, "w")  # noqa: SIM115 (one rank prints, for as long as it lives)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if EVENTS and WORLD.size > 1 and session.exitstatus == pytest.ExitCode.TESTS_FAILED:
        session.exitstatus = pytest.ExitCode.OK  # the events tell; mpirun would add a page about "abnormal" ranks


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if COLLECT:
        return
    left_out = [item for item in items if WORLD.size not in rank_counts(item)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if WORLD.size in rank_counts(item)]


def pytest_collection_finish(session: pytest.Session) -> None:
    # What tests import was written by them, and may be written anew within the second by which Python tells.
    sys.dont_write_bytecode, sys.pycache_prefix = True, None
    if COLLECT:
        asked = {item.nodeid: rank_counts(item) for item in session.items}
        Path(COLLECT).write_text(json.dumps(asked), encoding="utf-8")
        return
    names = "\n".join(item.nodeid for item in session.items) + f"\n{session.testsfailed}"
    digests = WORLD.allgather(hashlib.sha256(names.encode()).hexdigest())
    if len(set(digests)) > 1:
        # The ranks would wait in different tests for ever.
        abort(f"the ranks collected different tests: {len(session.items)} on rank {WORLD.rank}")


def abort(message: str) -> None:
    """End all ranks with one message from this one."""
    print(f"\n[rank {WORLD.rank} of {WORLD.size}] {message}", file=sys.stderr, flush=True)
    WORLD.Abort(1)


@dataclass
class Outcome:
    """What one test did on this rank, over set-up, call and tear-down."""

    failed: bool = False
    skipped: bool = False
    report: list[str] = field(default_factory=list)

    def add(self, report: pytest.TestReport) -> None:
        self.failed |= report.failed
        self.skipped |= report.skipped
        if report.failed:
            self.report.append(f"{report.nodeid} failed in {report.when}\n{report.longreprtext}")

    @property
    def word(self) -> str:
        return "failed" if self.failed else "skipped" if self.skipped else "passed"


class Claims:
    """Test files are shared with the pytests beside this one: each runs those that it was first to claim."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.mine: dict[str, bool] = {}

    def has(self, item: pytest.Item) -> bool:
        """Whether this pytest runs the test. Collective."""
        file = item.nodeid.partition("::")[0]
        if self.folder is not None and file not in self.mine:
            self.mine[file] = WORLD.bcast(self.claim(file) if WORLD.rank == 0 else None)
        return self.mine.get(file, True)

    def claim(self, file: str) -> bool:
        assert self.folder is not None
        try:
            (self.folder / file.replace("/", "--")).touch(exist_ok=False)
        except FileExistsError:
            return False
        return True

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
        if self.has(item):
            return None
        # the test before was told that this one follows, and left standing what both are in (a package)
        item.session._setupstate.teardown_exact(nextitem)
        return True  # nothing is left to do for it


class Lockstep:
    """Ranks end every test together; one that failed on some ranks only ends the run, as the ranks are out of step."""

    def __init__(self, config: pytest.Config, claims: Claims) -> None:
        self.config = config
        self.claims = claims
        self.comm = WORLD.Dup()
        self.outcome = Outcome()

    @pytest.hookimpl(hookwrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item):
        self.outcome = Outcome()
        if not self.claims.has(item):
            yield
            return
        write_event(test=item.nodeid, outcome="started")
        yield
        write_event(test=item.nodeid, outcome=self.outcome.word)
        if WORLD.size > 1:
            self.meet(item)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.outcome.add(report)

    def pytest_exception_interact(self, node: pytest.Collector, report: object) -> None:
        # Failed tests speak in `meet`; a file that cannot be collected on this rank would stay silent.
        if WORLD.rank > 0 and isinstance(report, pytest.CollectReport):
            self.say(f"[rank {WORLD.rank}] {node.nodeid}\n{report.longreprtext}")

    def meet(self, item: pytest.Item) -> None:
        """Wait for the other ranks at the end of a test; a failed rank does not wait for long."""
        failures = np.zeros(1, dtype="i")
        request = self.comm.Iallreduce(np.array([self.outcome.failed], dtype="i"), failures)
        deadline = time.monotonic() + GRACE if self.outcome.failed else float("inf")
        while not request.Test():
            if time.monotonic() > deadline:
                self.stop(f"{item.nodeid} failed here while other ranks wait in it")
            time.sleep(5e-4)
        if 0 < failures[0] < WORLD.size:
            if not self.outcome.failed:
                time.sleep(GRACE)  # the failed rank speaks first
            self.stop(f"{item.nodeid} failed on {failures[0]} of {WORLD.size} ranks")

    def stop(self, why: str) -> None:
        self.say("\n".join([f"\n[rank {WORLD.rank}] {why}; stopping all ranks", *self.outcome.report]))
        WORLD.Abort(1)

    def say(self, text: str) -> None:
        capture = self.config.pluginmanager.getplugin("capturemanager")
        with capture.global_and_fixture_disabled():
            print(text, file=sys.stderr, flush=True)


@dataclass(frozen=True)
class TwoDof:
    """The paper's two-dof oscillator (GT2008-50860, section 2) as plain matrices [kg, N/m, N s/m, N, m/s]."""

    M: np.ndarray
    K: np.ndarray
    B: np.ndarray  #: relative displacement u = B x of the friction damper, on m2
    law: str
    parameters: dict[str, float]
    dof: int  #: observed and normalised dof, m1
    omega_stuck: float  #: [rad/s]
    omega_free: float  #: [rad/s]

    def negative_damping(self, share: float = 0.02) -> np.ndarray:
        """Viscous matrix with c1 = -2 share sqrt(640) on m1, the paper's flutter case."""
        return np.diag([-2.0 * share * np.sqrt(640.0), 0.0])


@pytest.fixture(scope="session")
def comm() -> MPI.Comm:
    """World communicator."""
    return WORLD


@pytest.fixture(autouse=True)
def petsc_options_of_one_test() -> Iterator[None]:
    """What a test puts into PETSc's database goes with it: a run tells what of it nothing reads."""
    from petsc4py import PETSc

    before = set(PETSc.Options().getAll())
    yield
    for name in set(PETSc.Options().getAll()) - before:
        PETSc.Options().delValue(name)


@pytest.fixture
def two_dof() -> TwoDof:
    """The paper's two-dof oscillator; the paper prints no values, these reproduce its statements."""
    return TwoDof(
        M=np.diag([1.0, 0.02]),
        K=np.array([[640.0, -40.0], [-40.0, 40.0]]),
        B=np.array([[0.0, 1.0]]),
        law="regularised_coulomb",
        parameters={"friction_limit": 5.0, "regularisation_velocity": 0.05},
        dof=0,
        omega_stuck=np.sqrt(640.0),
        omega_free=np.sqrt(1320.0 - np.sqrt(1320.0**2 - 1.2e6)),
    )


@pytest.fixture
def shared_tmp(comm: MPI.Comm, tmp_path: Path) -> Path:
    """One temporary folder that all ranks see."""
    return Path(comm.bcast(str(tmp_path)))


def own_environment(**changes: str) -> dict[str, str]:
    """Environment for an mpirun started by a test: the marks of the MPI that runs the tests would mislead it."""
    allowed = ("OMPI_ALLOW", "OMPI_MCA_rmaps", "OMPI_MCA_pml")
    marks = ("OMPI_", "PMIX_", "PMI_", "FRETWAVE_TEST_", "PYTHONPYCACHEPREFIX")
    kept = {k: v for k, v in os.environ.items() if k.startswith(allowed) or not k.startswith(marks)}
    return {**kept, "PYTHONDONTWRITEBYTECODE": "1", **changes}


@pytest.fixture
def launch() -> Callable[..., subprocess.CompletedProcess[str]]:
    """``launch(2, "-m", "fretwave", ...)``: this Python on n ranks in a process of its own. For tests on 1 rank."""

    def run(ranks: int, *arguments: str, timeout: float = 60.0, **options: Any) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, *arguments]
        command = ["mpirun", "-n", str(ranks), *command] if ranks > 1 else command
        options = {"env": own_environment(), "capture_output": True, "text": True, **options}
        return subprocess.run(command, timeout=timeout, stdin=subprocess.DEVNULL, **options)

    return run
