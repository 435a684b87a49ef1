"""The package as a user meets it: its names are listed, and every public object says what it is in one line."""

from __future__ import annotations

import re
from dataclasses import fields
from importlib import resources
from importlib.metadata import version

import numpy as np
import pytest

import fretwave as fw
from fretwave import _core

LONGEST = 300


def test_every_public_name_is_listed_and_there():
    assert set(fw.__all__) <= set(dir(fw))
    assert all(getattr(fw, name) is not None for name in fw.__all__)
    assert fw.__version__ == version("fretwave") and "__version__" in dir(fw)
    assert (resources.files("fretwave") / "py.typed").is_file()


def objects():
    B, parameters = np.eye(2), {"tangential_stiffness": [5.0, 6.0], "friction_limit": 1.0}
    contact = fw.Contact("jenkins", B, parameters, name="ring")
    model = fw.Model(np.eye(2), np.diag([4.0, 9.0]), contacts=[contact])
    harmonics, start = fw.choose_harmonics(model, 7), fw.linear_modes(model, 1)[0]
    mode = fw.NonlinearMode(model, harmonics, start=start)
    response = fw.ForcedResponse(model, harmonics, {1: [1.0, 0.0]}, 2.0, 0, start)
    branch = fw.Continuation(mode, mode.initial(0.1), (0.1, 1.0))
    sector = fw.Sector({0: np.eye(2), 1: np.zeros((2, 2)), -1: np.zeros((2, 2))}, np.eye(2), 12, contacts=[contact])
    yield from [contact, model, harmonics, start, mode, response, branch, next(iter(branch)), sector]
    yield from [
        fw.reduce(np.eye(3), np.diag([4.0, 9.0, 16.0]), keep=[0], modes=1),
        fw.Transient(fw.Model([[1.0]], [[4.0]])),
        fw.PythonLaw(),
    ]
    built = fw.Pairs(B, 1, parameters)
    yield from [built, fw.Structure(np.eye(2), np.eye(2), pairs={"ring": built})]


def test_every_object_says_what_it_is():
    for one in objects():
        text = repr(one)
        assert text.startswith(type(one).__name__) and " at 0x" not in text and "\n" not in text, text
        assert len(text) < LONGEST and "array(" not in text, text


@pytest.mark.parametrize(
    "index, words", [(0, "jenkins 2 rows 5 to 6"), (1, "2 dofs ring"), (4, "CNM dof 0 1, 3, ..., 7"), (8, "12 sectors")]
)
def test_they_say_what_matters(index, words):
    text = repr(list(objects())[index])
    assert all(word in text for word in words.split()), text


def test_every_public_class_has_words_of_its_own():
    """No address, and no array written out: a generated text is for plain numbers and words alone."""
    plain = {"int", "float", "str", "list[str]", "bool", "None", "Role", "Limit", "Optional[int]"}
    for name in fw.__all__:
        kind = getattr(fw, name)
        if not isinstance(kind, type) or kind is fw.LawInfo:
            continue
        assert kind.__repr__ is not object.__repr__, name
        if hasattr(kind.__repr__, "__wrapped__"):  # as dataclasses write it
            types = {part for field in fields(kind) for part in str(field.type).split(" | ")}
            assert types <= plain, f"{name}: {types - plain}"


def test_the_core_has_stubs_of_all_its_names():
    text = (resources.files("fretwave") / "_core.pyi").read_text(encoding="utf-8")
    names = [name for name in dir(_core) if not name.startswith("_")]
    assert len(names) > 20
    assert [name for name in names if not re.search(rf"^(class |def )?{name}\b", text, re.MULTILINE)] == []
    assert "petsc4py.PETSc.Vec" in text


def test_dir_lists_what_is_public_and_nothing_else():
    assert {name for name in dir(fw) if not name.startswith("__")} == set(fw.__all__)
