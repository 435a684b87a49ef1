"""The package as a user meets it: its names are listed, and every public object says what it is in one line."""

from __future__ import annotations

from importlib import resources
from importlib.metadata import version

import numpy as np
import pytest

import fretwave as fw

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
