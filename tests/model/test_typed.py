"""Functions say what they take: an argument annotated `Any` is one that no checker looks at."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

PACKAGE = Path(fw.__file__).parent
#: Values of case files before they are checked, and keywords that are handed on to another library as they are.
MOST = 7


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[ast.arg]:
    """Of all kinds."""
    given = function.args
    starred = [one for one in (given.vararg, given.kwarg) if one is not None]
    return [*given.posonlyargs, *given.args, *given.kwonlyargs, *starred]


def untyped(text: str) -> Iterator[tuple[int, str]]:
    """Line and name of each argument of a module that is annotated `Any`."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            for one in arguments(node):
                if one.annotation is not None and ast.unparse(one.annotation) in ("Any", "typing.Any"):
                    yield one.lineno, f"{one.arg} of {node.name}"


def test_arguments_of_every_kind_are_counted() -> None:
    text = """
def f(a: Any, /, b: typing.Any, *c: Any, d: Any = 1, **e: Any): ...
class K:
    async def g(self, x: list[Any], y: 'int', z):
        def h(inner: Any): ...
"""
    assert [name for _, name in untyped(text)] == ["a of f", "b of f", "d of f", "c of f", "e of f", "inner of h"]


def test_few_arguments_are_of_any_type() -> None:
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: {name}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for line, name in untyped(path.read_text(encoding="utf-8"))
    ]
    listed = "\n".join(found)
    assert len(found) <= MOST, f"{len(found)} arguments are annotated Any, at most {MOST} may be:\n{listed}"
