"""What is written twice has two homes: no function of the package has the body of another."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Union

import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

PACKAGE = Path(fw.__file__).parent
#: Nodes of a syntax tree below which a body is too small to be an idea: a property handed on, a name given back.
SMALL = 24

Function = Union[ast.FunctionDef, ast.AsyncFunctionDef]


class Plain(ast.NodeTransformer):
    """Arguments and local names by the order in which they come, so that other words are no other body."""

    def __init__(self, own: set[str]) -> None:
        self.own, self.numbers = own, dict[str, str]()

    def visit_Name(self, node: ast.Name) -> ast.Name:
        if node.id in self.own:
            node.id = self.numbers.setdefault(node.id, f"_{len(self.numbers)}")
        return node


def own_names(function: Function) -> set[str]:
    """Arguments, and what is assigned to inside."""
    nodes = list(ast.walk(function))
    stored = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return stored | {node.arg for node in nodes if isinstance(node, ast.arg)}


def body_of(function: Function) -> tuple[str, int]:
    """Without docstring and names of its own, and its size in nodes."""
    own, body = own_names(function), function.body[ast.get_docstring(function) is not None :]
    module = ast.Module([Plain(own).visit(statement) for statement in body], [])
    return ast.dump(module), sum(1 for _ in ast.walk(module))


def functions(text: str) -> Iterator[tuple[str, str]]:
    """Name and body of the functions that are not small."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            body, size = body_of(node)
            if size >= SMALL:
                yield f"{node.name} (line {node.lineno})", body


def test_other_words_are_no_other_body() -> None:
    text = '''
def first(group, unit="m"):
    """Of one."""
    found = [value * 2 for value in group["points"] if value > 0]
    return found if len(found) else unit

def second(table, what):
    rows = [x * 2 for x in table["points"] if x > 0]
    return rows if len(rows) else what

def third(table, what):
    rows = [x * 2 for x in table["point"] if x > 0]
    return rows if len(rows) else what
'''
    bodies = [body for _, body in functions(text)]
    assert len(bodies) == 3 and bodies[0] == bodies[1] != bodies[2]


def test_no_body_stands_twice() -> None:
    homes = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        for name, body in functions(path.read_text(encoding="utf-8")):
            homes[body].append(f"{path.relative_to(PACKAGE)}: {name}")
    twice = [" = ".join(places) for places in homes.values() if len(places) > 1]
    assert not twice, "\n".join(twice)


@pytest.mark.parametrize(
    "call, home",
    [("os.replace", "files/whole.py"), ("os.rename", "files/whole.py"), ("operator.index", "given.py")],
)
def test_what_has_one_home_is_called_there_alone(call: str, home: str) -> None:
    """A view took its place beside `files.whole`, and was not brought to the disk; three modules asked for an int."""
    found = {str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if f"{call}(" in path.read_text()}
    assert found <= {home}


def test_no_comment_leans_on_a_document_that_is_not_here() -> None:
    """They cited facts, sections and issues of a plan that is no part of the repository."""
    root = Path(__file__).parents[2]
    cited = re.compile(r"\b(DESIGN|REFERENCE|Issue \d)\b")
    files = [
        path
        for part in ("src", "cases", "python", "tests")
        for end in ("h", "cpp", "py")
        for path in (root / part).rglob(f"*.{end}")
    ]
    files = [path for path in files if path.name != Path(__file__).name]
    assert [str(path) for path in files if cited.search(path.read_text())] == []
