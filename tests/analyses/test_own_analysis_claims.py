"""What an analysis of a user's own gives back is held to what it must be, in words of its own and not of h5py."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import call

from fretwave.case import plugins
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

CASE = """
plugins = ["own.py"]

[model]
dofs = ["a", "b"]
M = [[1.0, 0.0], [0.0, 1.0]]
K = [[2.0, -1.0], [-1.0, 2.0]]

[[analysis]]
name = "x"
type = "own"
"""
OWN = """
from typing import Literal

import numpy as np

import fretwave as fw


@fw.register_analysis
class Own(fw.AnalysisSection):
    type: Literal["own"]
    top: float = fw.key("largest", default=1.0)

    def run(self, context):
        writer = context.writer([fw.Column(name, "1", "a number") for name in {names}], labels=["1c", "1s"])
        writer.append({{name: self.top for name in {names}}}, {coefficients})
        {close}
        return {outcome}
"""
CLOSE = 'writer.close("done", "all")'
GOOD = {
    "close": CLOSE,
    "names": ["one", "two"],
    "coefficients": "np.ones((2, 2))",
    "outcome": 'fw.Outcome(1, "all", True)',
}
WRONG = {
    "nothing": ({"outcome": "None"}, "`run` of the analysis 'x' returned no outcome"),
    "words": ({"outcome": "'done'"}, "returned no outcome"),
    "spread": ({"coefficients": "np.ones((1, 2))"}, "coefficients do not fit the table"),
    "turned": ({"coefficients": "np.ones((2, 3))"}, "coefficients do not fit the table"),
    "complex": ({"coefficients": "1j * np.ones((2, 2))"}, "coefficients do not fit the table"),
    "twice": ({"names": ["one", "one"]}, "two columns of a table have one name"),
    "number": ({"names": ["one", "value"]}, "a column of a table cannot have this name"),
    "second": ({"close": 'context.writer(["amplitude"])'}, "the analysis 'x' asks for a second table"),
    "folder": ({"names": ["one/two"]}, "a column of a table cannot have this name"),
}


@pytest.fixture(autouse=True)
def forgotten():
    yield
    for plugin in plugins.loaded():
        plugins.forget(plugin.path)


def write(folder, **given):
    (folder / "own.py").write_text(OWN.format(**{**GOOD, **given}))
    (folder / "case.toml").write_text(CASE)
    return folder / "case.toml"


@pytest.mark.parametrize("name", WRONG)
def test_what_does_not_fit_is_refused(name, tmp_path, capsys):
    """One row of coefficients would stand for all dofs, complex ones lose their imaginary part."""
    given, words = WRONG[name]
    assert call("run", write(tmp_path, **given), "--no-plots") == 2
    assert words in capsys.readouterr().err


def test_what_fits_is_taken_also_in_a_sweep(tmp_path):
    assert call("run", write(tmp_path), "--no-plots", "--out", tmp_path / "run") == 0
    assert call("sweep", write(tmp_path), "--over", "x.top=1,2", "--no-plots", "--out", tmp_path / "sweep") == 0
    table = np.genfromtxt(tmp_path / "sweep" / "x.csv", delimiter=",", names=True)
    assert table["two"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("converged", [True, False], ids=["done", "stopped"])
def test_a_table_that_is_not_closed_ends_as_the_analysis_does(converged, tmp_path):
    """And not as one that is still running."""
    outcome = f'fw.Outcome(1, "all", {converged})'
    assert call("run", write(tmp_path, close="pass", outcome=outcome), "--no-plots", "--out", tmp_path / "run") in (
        0,
        3,
    )
    attributes = Run(tmp_path / "run")["x"].attributes
    assert attributes["status"] == ("done" if converged else "stopped") and attributes["reason"] == "all"


LAW = """

@fw.register_law
class {name}(fw.PythonLaw):
    name = "stiffer"

    def force(self, u, v):
        return u
"""
READER = """

@fw.register_format(".own")
def {name}(path, letter, variable):
    return np.eye(2)
"""


@pytest.mark.parametrize("kind", ["analysis", "law", "reader"])
def test_a_file_that_registers_a_name_twice_is_refused(kind, tmp_path, capsys):
    """One of them would be taken without a word."""
    path = write(tmp_path)
    text = (tmp_path / "own.py").read_text()
    analysis = text[text.index("@fw") :].replace("class Own", "class Other")
    more = {"analysis": f"\n\n{analysis}", "law": LAW, "reader": READER}[kind]
    twice = more if kind == "analysis" else more.format(name="One") + more.format(name="Two")
    (tmp_path / "own.py").write_text(text + twice)
    assert call("check", path) == 2
    assert "twice" in capsys.readouterr().err
