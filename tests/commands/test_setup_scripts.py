"""cases/run and tests/run: messages for wrong calls, and the counting of what ran on each number of ranks.

The scripts are started on a small copy of the tree, so that no test sets anything up.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import rank_runner

pytestmark = pytest.mark.ranks(1)

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Scripts and one case, with nothing installed."""
    for name in (".ci/setup", ".ci/constraints.txt", "cases/run"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy2(ROOT / name, tmp_path / name)
    (tmp_path / "cases" / "beam").mkdir()
    (tmp_path / "cases" / "beam" / "case.toml").write_text('title = "A beam on friction"\n', encoding="utf-8")
    return tmp_path


def call(clone: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = ["bash", *(str(clone / argument) if i == 0 else argument for i, argument in enumerate(arguments))]
    inherited = {key: value for key, value in os.environ.items() if key != "FRETWAVE_BUILD_TYPE"}
    return subprocess.run(command, env={**inherited, **environment}, capture_output=True, text=True, timeout=60)


def setup_function_call(clone: Path, code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run shell code after sourcing the set-up."""
    script = clone / "script"
    script.write_text(f'source "{clone}/.ci/setup"\n{code}\n', encoding="utf-8")
    return call(clone, "script", **environment)


def test_no_case_prints_usage_and_titles(clone: Path) -> None:
    done = call(clone, "cases/run")
    assert done.returncode == 2 and not (clone / ".venv").exists()
    assert "usage: cases/run NAME" in done.stderr
    assert "beam" in done.stderr and "A beam on friction" in done.stderr


def test_help_is_no_error(clone: Path) -> None:
    done = call(clone, "cases/run", "--help")
    assert done.returncode == 0 and "usage: cases/run NAME" in done.stdout


def test_unknown_case_names_the_known_ones(clone: Path) -> None:
    done = call(clone, "cases/run", "baem")
    assert done.returncode == 2 and not (clone / ".venv").exists()
    assert "no case named 'baem'" in done.stderr and "fix: choose one of: beam" in done.stderr


@pytest.mark.parametrize("ranks", ["0", "-1", "two", "1.5", ""])
def test_wrong_number_of_ranks(clone: Path, ranks: str) -> None:
    done = call(clone, "cases/run", "beam", "-n", ranks)
    assert done.returncode == 2 and not (clone / ".venv").exists()
    assert f"error: -n {ranks}" in done.stderr and "fix: cases/run beam -n 2" in done.stderr


def test_missing_number_of_ranks(clone: Path) -> None:
    done = call(clone, "cases/run", "beam", "-n")
    assert done.returncode == 2 and "fix: cases/run NAME -n 2" in done.stderr


def test_unknown_build_type(clone: Path) -> None:
    done = call(clone, "cases/run", "beam", FRETWAVE_BUILD_TYPE="Fast")
    assert done.returncode == 2 and not (clone / ".venv").exists()
    assert "FRETWAVE_BUILD_TYPE=Fast" in done.stderr and "expected Release or Developer" in done.stderr


def test_without_root_one_command_is_printed(clone: Path) -> None:
    code = "APT_PACKAGES+=(no-such-package-here)\nid() { echo 1000; }\nfretwave_setup run"
    done = setup_function_call(clone, code)
    assert done.returncode == 2
    assert done.stderr.count("fix: ") == 1
    assert 'fix: sudo sh -c "apt-get update && apt-get install' in done.stderr and "no-such-package-here" in done.stderr


def test_long_step_that_fails_shows_its_end(clone: Path) -> None:
    done = setup_function_call(clone, "logged step 'mend it' bash -c 'seq 100; exit 3'\necho never")
    assert done.returncode == 2 and "never" not in done.stdout
    assert "\n100\n" in done.stderr and "\n50\n" not in done.stderr
    assert "fix: mend it" in done.stderr and str(clone / ".build" / "step.log") in done.stderr


def test_fingerprint_follows_sources_and_build_type(clone: Path) -> None:
    for name in ("src/a.cpp", "python/b.py", "CMakeLists.txt"):
        (clone / name).parent.mkdir(exist_ok=True)
        (clone / name).write_text("1", encoding="utf-8")

    def fingerprint(**environment: str) -> str:
        return setup_function_call(clone, "build_fingerprint", **environment).stdout

    first = fingerprint()
    (clone / "python" / "__pycache__").mkdir()
    (clone / "python" / "__pycache__" / "b.pyc").write_text("1", encoding="utf-8")
    assert all(name in first for name in ("src/a.cpp", "python/b.py", "CMakeLists.txt")) and fingerprint() == first
    assert fingerprint(FRETWAVE_BUILD_TYPE="Developer") != first
    (clone / "src" / "a.cpp").write_text("2", encoding="utf-8")
    assert fingerprint() != first


def test_changed_source_with_an_old_time_stamp_is_compiled(clone: Path) -> None:
    """rsync, cp -p and archives bring time stamps older than the object files, and ninja looks at nothing else."""
    for name in ("src/same.cpp", "src/changed.cpp", "python/b.py", "CMakeLists.txt"):
        (clone / name).parent.mkdir(exist_ok=True)
        (clone / name).write_text("1", encoding="utf-8")
    setup_function_call(clone, "touch_changed_sources")
    (clone / "src" / "changed.cpp").write_text("2", encoding="utf-8")
    for name in ("src/same.cpp", "src/changed.cpp"):
        os.utime(clone / name, (1e9, 1e9))
    done = setup_function_call(clone, "touch_changed_sources")
    assert done.returncode == 0, done.stderr
    assert (clone / "src" / "same.cpp").stat().st_mtime == 1e9
    assert (clone / "src" / "changed.cpp").stat().st_mtime > 1e9


def test_root_may_start_ranks(clone: Path) -> None:
    code = 'id() { echo 0; }\nexport_runtime\necho "$OMP_NUM_THREADS $OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"'
    assert setup_function_call(clone, code).stdout == "1 1\n"


def prepared(clone: Path, script: str) -> subprocess.CompletedProcess[str]:
    """The case with a script prepare, in a clone where all is set up and fretwave only says its arguments."""
    with (clone / ".ci" / "setup").open("a", encoding="utf-8") as file:
        file.write("fretwave_setup() { :; }\n")
    binaries = clone / ".venv" / "bin"
    binaries.mkdir(parents=True)
    (binaries / "fretwave").write_text('#!/bin/sh\necho fretwave "$@"\n', encoding="utf-8")
    (binaries / "fretwave").chmod(0o755)
    (clone / "cases" / "beam" / "prepare").write_text(script, encoding="utf-8")
    return call(clone, "cases/run", "beam", "--quick")


def test_a_case_makes_its_model_first(clone: Path) -> None:
    """With the fretwave of the environment on its path; what it says is kept, the run's own words are shown."""
    done = prepared(clone, f'fretwave import >"{clone}/model"\necho made\n')
    assert done.returncode == 0, done.stderr
    assert (clone / "model").read_text(encoding="utf-8") == "fretwave import\n"
    assert done.stdout.startswith("fretwave run ") and done.stdout.endswith("--quick\n")
    assert (clone / ".build" / "prepare-beam.log").read_text(encoding="utf-8") == "made\n"


def test_a_case_whose_model_cannot_be_made_is_not_run(clone: Path) -> None:
    done = prepared(clone, "echo no such deck >&2\nexit 201\n")
    assert done.returncode == 2 and done.stdout == ""
    assert "no such deck" in done.stderr and done.stderr.count("fix: ") == 1


def events(folder: Path, *ranks: dict[str, str], share: int = 0) -> dict[str, str]:
    folder = folder / f"share_{share}"
    folder.mkdir()
    for rank, outcomes in enumerate(ranks):
        lines = [json.dumps({"test": test, "outcome": outcome}) for test, outcome in outcomes.items()]
        (folder / f"rank_{rank}.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return rank_runner.read_outcomes(folder.parent, len(ranks))


def test_worst_rank_speaks(tmp_path: Path) -> None:
    outcomes = events(tmp_path, {"a": "passed", "b": "passed", "c": "skipped"}, {"a": "passed", "b": "failed"})
    assert outcomes == {"a": "passed", "b": "failed", "c": "started"}


def test_shares_add_up(tmp_path: Path) -> None:
    events(tmp_path, {"a": "passed"}, share=0)
    assert events(tmp_path, {"b": "failed"}, share=1) == {"a": "passed", "b": "failed"}


@pytest.mark.parametrize(
    "outcomes, ending, last, well",
    [
        ({"a": "passed", "b": "passed"}, "", "2 passed, 0 failed", True),
        ({"a": "passed", "b": "skipped"}, "", "1 passed, 0 failed, 1 skipped", True),
        ({"a": "passed", "b": "failed"}, "exit code 1", "1 passed, 1 failed", False),
        ({"a": "passed", "b": "started"}, "exit code 139", "1 passed, 1 failed", False),
        ({"a": "passed"}, "", "1 passed, 1 failed", False),
        ({}, "no end after 600 s", "0 passed, 2 failed", False),
        ({"a": "passed", "b": "passed"}, "exit code 7", "2 passed, 1 failed", False),
        ({"a": "passed", "b": "passed", "c": "passed"}, "", "2 passed, 1 failed", False),
    ],
)
def test_what_did_not_run_is_a_failure(outcomes: dict[str, str], ending: str, last: str, well: bool) -> None:
    count = rank_runner.count_outcomes(2, {"a", "b"}, outcomes, ending)
    assert rank_runner.total([count]) == (last, well)
    assert well or count.notes or "failed" in outcomes.values()


def test_no_tests_is_no_success() -> None:
    assert rank_runner.total([]) == ("0 passed, 0 failed", False)


INNER = """
import pytest

@pytest.mark.ranks(2)
def test_inner(comm):
    {body}
"""


@pytest.mark.parametrize(
    "body, line",
    [
        ("comm.barrier()", "2 ranks: 1 passed, 0 failed"),
        ("assert comm.rank == 0; comm.barrier()", "2 ranks: 0 passed, 1 failed"),
        ("if comm.rank == 1: raise ValueError('only here')\n    comm.barrier()", "2 ranks: 0 passed, 1 failed"),
        ("import os; comm.rank == 1 and os.abort()\n    comm.barrier()", "2 ranks: 0 passed, 1 failed"),
    ],
)
def test_one_rank_that_fails_ends_the_run(tmp_path: Path, launch, body: str, line: str) -> None:
    """No hang: each of these would otherwise wait in the barrier until the timeout."""
    done = run_inner(tmp_path, launch, test_inner=INNER.format(body=body))
    assert line in done.stdout, done.stdout + done.stderr
    assert done.returncode == (0 if "1 passed" in line else 1)


def run_inner(folder: Path, launch, **files: str):
    """The runner in a root of its own that has these test files."""
    tests = folder / "tests"
    tests.mkdir()
    (folder / "python").mkdir()
    shutil.copy2(ROOT / "python" / "pyproject.toml", folder / "python")
    for name in ("conftest.py", "rank_runner.py"):
        shutil.copy2(ROOT / "tests" / name, tests)
    for name, text in files.items():
        (tests / f"{name}.py").write_text(text, encoding="utf-8")
    return launch(1, str(tests / "rank_runner.py"), cwd=folder)


SHARED = """
import pathlib, pytest

@pytest.mark.ranks(1)
@pytest.mark.parametrize("k", range(3))
def test_shared(k):
    with open({log!r}, "a") as file:
        file.write(f"{name} {{k}}\\n")
    assert {fine}
"""


@pytest.mark.skipif(rank_runner.shares_for(1) < 2, reason="one core: the tests are not shared")
def test_every_file_runs_once_however_many_share_them(tmp_path: Path, launch) -> None:
    """And what fails in one that does not write to the terminal is shown and counted."""
    log = tmp_path / "ran.txt"
    texts = {f"test_{k}": SHARED.format(log=str(log), name=k, fine=k != 4 and "True" or "k < 2") for k in range(6)}
    done = run_inner(tmp_path, launch, **texts)
    assert sorted(log.read_text().splitlines()) == sorted(f"{k} {test}" for k in range(6) for test in range(3))
    assert "1 rank: 17 passed, 1 failed (expected 18)" in done.stdout, done.stdout + done.stderr
    assert "assert 2 < 2" in done.stdout, done.stdout
    assert done.stdout.splitlines()[-1] == "17 passed, 1 failed"


def test_a_package_whose_other_file_is_run_elsewhere_is_torn_down(tmp_path: Path) -> None:
    """The first file's last test is told that the second follows, which stands in the same package; the third does."""
    shutil.copy2(ROOT / "tests" / "conftest.py", tmp_path)
    (tmp_path / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    claims = tmp_path / "claims"
    claims.mkdir()
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__init__.py").touch()
    for name in ("package/test_a.py", "package/test_b.py", "test_c.py"):
        (tmp_path / name).write_text("def test_it():\n    pass\n", encoding="utf-8")
    (claims / "package--test_b.py").touch()
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "package", "test_c.py"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("FRETWAVE_TEST_")}
    environment["FRETWAVE_TEST_CLAIMS"] = str(claims)
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "2 passed" in done.stdout, done.stdout
