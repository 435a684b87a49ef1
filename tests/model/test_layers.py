"""The physics stands without the case files: scripts load neither TOML's layer nor pydantic. Rooms of the core include
in one direction."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "src"
#: What each room of the core includes of others: equations (hb) know no preconditioner, and those no wheel.
ROOMS = {
    "contact": set(),
    "solve": set(),
    "model": {"contact"},
    "transient": {"model"},
    "hb": {"contact", "model", "solve"},
    "precondition": {"hb", "model", "solve"},
    "wheel": {"hb", "model", "precondition", "solve"},
}

IMPORT = """
import pkgutil, importlib, sys
import fretwave.{folder} as folder
names = [name for _, name, _ in pkgutil.iter_modules(folder.__path__)]
for name in names:
    importlib.import_module(f"fretwave.{folder}.{{name}}")
wrong = [name for name in sys.modules if name.startswith(("fretwave.case", "fretwave.analyses", "pydantic"))]
print(len(names), wrong)
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize("folder", ["model", "hb", "cyclic", "solve"])
def test_physics_loads_no_case_layer(folder: str) -> None:
    code = IMPORT.format(folder=folder)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    count, _, wrong = done.stdout.partition(" ")
    assert int(count) > 1 and wrong.strip() == "[]"


@pytest.mark.ranks(1)
def test_structures_pairs_and_files_need_no_parallel_library() -> None:
    """What builders and readers of results use: NumPy and SciPy alone."""
    code = "import sys; from fretwave import Contact, Pairs, Structure, read_model; " + (
        "print([name for name in ('mpi4py', 'petsc4py', 'pydantic', 'importlib.metadata') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr


def included(file: Path) -> set[str]:
    """Headers of the core, as they stand in its quotes."""
    return {name for name in re.findall(r'#include "([^"]+)"', file.read_text(encoding="utf-8"))}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("room", sorted(ROOMS))
def test_rooms_of_the_core_include_in_one_direction(room: str) -> None:
    others = {name.split("/")[0] for file in (SOURCES / room).iterdir() for name in included(file) if "/" in name}
    assert others - {room} == ROOMS[room]


@pytest.mark.ranks(1)
def test_no_header_of_the_core_includes_itself() -> None:
    assert {folder.name for folder in SOURCES.iterdir() if folder.is_dir()} == set(ROOMS)
    known: dict[str, set[str]] = {}

    def reached(name: str, way: tuple[str, ...] = ()) -> set[str]:
        assert name not in way, " -> ".join([*way, name])
        if name not in known:
            direct = included(SOURCES / name)
            known[name] = direct.union(*(reached(one, (*way, name)) for one in direct))
        return known[name]

    for header in SOURCES.rglob("*.h"):
        reached(str(header.relative_to(SOURCES)))
    assert "hb/residual.h" in known["wheel/wheel_pc.h"]


def public_members(header: str, name: str) -> set[str]:
    """Names that a class makes public itself, its constructor among them; what overrides its base's is not its own."""
    text = re.sub(r"//.*", "", (SOURCES / header).read_text(encoding="utf-8"))
    body = re.search(rf"class {name} : .*?\{{(.*?)\n\}};", text, re.S)
    assert body
    sections = re.split(r"^ (public|protected|private):$", body[1], flags=re.M)
    public = "".join(text for word, text in zip(sections[1::2], sections[2::2]) if word == "public")
    while "{" in public:  # bodies of functions, from the innermost out
        public = re.sub(r"\{[^{}]*\}", ";", public)
    declared = [one for one in public.split(";") if one.strip() and " override" not in one]
    return {re.search(r"(\w+)(?=\(|\s*$|\s*=)", one)[1] for one in declared}


@pytest.mark.ranks(1)
def test_a_harmonic_problem_stays_small() -> None:
    """Diagnostics are functions of their own, the unfolding and what stands at rest classes of their own."""
    found = public_members("hb/harmonic_problem.h", "HarmonicProblem")
    assert {"HarmonicProblem", "row", "terms", "unfolding", "on"} <= found and "residual" not in found
    assert len(found) <= 15, sorted(found)
