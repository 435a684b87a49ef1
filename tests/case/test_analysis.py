"""A kind of analysis owns all that is known of it: what it leaves out has a default, and nobody asks what it is."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Literal

import pytest
from command_line import call

import fretwave as fw
from fretwave import analyses, plots, registry
from fretwave.case.analysis import forget_analysis
from fretwave.case.facts import Facts
from fretwave.case.load import load_case
from fretwave.case.toml.source import Source
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

PACKAGE = Path(fw.__file__).parent
CASE = """
[model]
dofs = ["m1", "m2"]
M = [[1.0, 0.0], [0.0, 0.02]]
K = [[640.0, -40.0], [-40.0, 40.0]]
mass_damping = 0.5

[[analysis]]
name = "least"
type = "least_of_all"
dampers = [{ dof = "m2", c = 3.0 }]
"""


class Least(fw.AnalysisSection):
    """Nothing but what is needed."""

    type: Literal["least_of_all"]

    def run(self, context):
        writer = context.writer([fw.Column("dofs", "1", "dofs of the model", "i")])
        writer.append({"dofs": context.model.n_dof})
        writer.close("done", "counted")
        return fw.Outcome(writer.rows, "counted", True)


@pytest.fixture(autouse=True)
def registered():
    yield fw.register_analysis(Least)
    forget_analysis(Least)


@pytest.fixture
def case(tmp_path: Path) -> Path:
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path / "case.toml"


def test_an_analysis_of_a_name_and_a_run_runs(case: Path, tmp_path: Path) -> None:
    assert call("run", case, "--out", tmp_path / "run") == 0
    assert Run(tmp_path / "run").table("least")["dofs"].tolist() == [2.0]
    assert call("show", tmp_path / "run") == 0


def test_it_has_the_defaults_that_the_recipe_tells(case: Path) -> None:
    loaded = load_case(case)
    least = loaded.analyses["least"]
    facts = Facts(Source(case))
    assert least.needs() == least.compares_with() == least.decided_by() == []
    assert least.kept_dofs() == ["m2"]
    assert least.settings(loaded) is least and least.acting_dampers(loaded) == least.dampers
    assert least.own_preload() is None and least.harmonic() is None and least.integrates() == ""
    assert least.completed(None, facts) is least and least.least_memory(facts) == {}
    assert least.headline() == "least of all" and least.details(None) == ["added dampers: 3 N s/m at m2"]
    assert least.pictures == () and not (least.sweeps or least.wears or least.shown_where_kept)
    assert list(least.figures(None)) == [] and least.view(None, loaded, None, print) is None
    assert least.summary.columns == () and least.summary.words({"points": 3.0}) == "3 points"


def test_its_checks_are_those_of_all(case: Path, tmp_path: Path, capfd) -> None:
    (tmp_path / "bad.toml").write_text(CASE.replace('dof = "m2"', 'dof = "m3"') + 'petsc = "snes_rtol"\n')
    assert call("check", tmp_path / "bad.toml") == 2
    told = capfd.readouterr().err
    assert "unknown dof 'm3'" in told and "least.petsc cannot be used" in told
    assert call("check", case) == 0
    assert "least: least of all\n    added dampers: 3 N s/m at m2" in capfd.readouterr().out


def test_every_kind_of_the_package_is_a_file_of_its_name() -> None:
    files = {path.stem for path in (PACKAGE / "analyses").glob("*.py")} - {"__init__"}
    assert files == set(analyses.KINDS)
    own = {name: kind for name, kind in registry.kinds().items() if name != "least_of_all"}
    assert list(own) == list(analyses.KINDS)
    assert {name: kind.__module__ for name, kind in own.items()} == {name: f"fretwave.analyses.{name}" for name in own}


def test_every_module_of_pictures_is_of_some_kind() -> None:
    modules = {path.stem for path in (PACKAGE / "plots").glob("*.py")} - {"__init__"}
    drawing = {name for name in modules if hasattr(import_module(f"fretwave.plots.{name}"), "figures")}
    assert drawing == {name for kind in registry.kinds().values() for name in kind.pictures} | set(plots.OTHERS)


#: Classes of analyses and tables by which general code may not tell them apart.
SECTIONS = ("Analysis", "Section")


def test_no_module_asks_what_kind_an_analysis_is() -> None:
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
                kinds = [n.id for n in ast.walk(node.args[1]) if isinstance(n, ast.Name)]
                named = [kind for kind in kinds if kind.endswith(SECTIONS)]
                found += [f"{path.relative_to(PACKAGE)}:{node.lineno}: {kind}" for kind in named]
    assert not found


def test_what_stops_it_is_not_told_as_of_a_branch(case: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    """It takes no steps that could be shorter: `step.minimum` is no key of it."""

    def stops(self, context):
        writer = context.writer([fw.Column("dofs", "1", "dofs of the model", "i")])
        writer.append({"dofs": context.model.n_dof})
        writer.close("stopped", "enough")
        return fw.Outcome(writer.rows, "enough", False)

    monkeypatch.setattr(Least, "run", stops)
    assert call("run", case, "--out", tmp_path / "run") == 3
    told = capsys.readouterr().err
    assert "enough" in told and "what its reason names" in told and "step" not in told.replace("steps", "")
