"""``fretwave report``: a page that is whole, closed and true: every number of a table is that of the table."""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.wear_case import write_case
from tolerances import ROUNDING

import fretwave as fw
from fretwave.report import page
from fretwave.report.findings import marked
from fretwave.report.log import log_lines, warnings_of
from fretwave.report.model import translations
from fretwave.results.file import rewritten
from fretwave.results.overview import overviews
from fretwave.results.reader import Run
from fretwave.results.record import read_record, write_record
from fretwave.results.results import AnalysisWriter

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
#: Elements that have no end.
VOID = {"meta", "img", "br", "hr", "link"}


class Page(HTMLParser):
    """Elements that are open, text by element, and where numbers are from."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.numbers: list[tuple[dict[str, str | None], str]] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)

    def handle_data(self, data: str) -> None:
        self.texts.append(data)
        tag, attributes = self.tags[-1] if self.tags else ("", {})
        if tag == "span" and "data-from" in attributes and self.open[-1:] == ["span"]:
            self.numbers.append((attributes, data))

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


def page_of(folder: Path) -> Page:
    assert call("report", folder) == 0
    return Page((folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """Modes, one of them with limit cycles, and a response, with their pictures."""
    folder = tmp_path_factory.mktemp("report") / "run"
    short = ("--quick", "--only", "mode,flutter,forced", "--set", "forced.time_points=0", "-q")
    assert call("run", CASE, *short, "--out", folder) == 0
    return folder


@pytest.fixture(scope="module")
def chain(tmp_path_factory) -> Path:
    """A reduced model with nodes, a preload, wear and a static state."""
    base = tmp_path_factory.mktemp("report")
    case = write_case(base)
    assert call("run", case, "--only", "mode,one", "--no-plots", "-q", "--out", base / "run") == 0
    return base / "run"


def test_a_static_state_has_its_page(tmp_path: Path) -> None:
    """Its table has names of contacts, as that of linear modes has: it is not one."""
    case = write_case(tmp_path)
    with case.open("a", encoding="utf-8") as file:
        file.write('\n[[analysis]]\nname = "rest"\ntype = "static"\n')
    assert call("run", case, "--only", "rest", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    found = page_of(tmp_path / "run")
    assert not found.wrong and not found.open
    assert "largest normal force" in found.text


def test_every_tag_closes_and_nothing_comes_from_elsewhere(run: Path, chain: Path) -> None:
    for folder in (run, chain):
        found = page_of(folder)
        assert not found.wrong and not found.open
        names = {name for name, _ in found.tags}
        assert "script" not in names and "link" not in names and {"table", "figure", "h2"} <= names
        ids = {given["id"] for _, given in found.tags if "id" in given}
        assert all(given["src"].startswith("data:image/") for name, given in found.tags if name == "img")
        links = [given["href"] for name, given in found.tags if name == "a"]
        assert len(links) > 4 and {link[1:] for link in links} <= ids


def test_every_number_is_that_of_its_table(run: Path, chain: Path) -> None:
    for folder, least in ((run, 150), (chain, 40)):
        tables = fw.open_run(folder)
        found = page_of(folder)
        seen = set()
        for given, text in found.numbers:
            name, column, row = given["data-from"].split("/")
            kept = tables.table(name)[column][int(row)]
            scale, digits = float(given.get("data-scale", 1)), int(given.get("data-digits", 6))
            assert text == page.shown(scale * kept, digits), given
            seen.add((name, column))
        assert len(found.numbers) > least
        assert {name for name, _ in seen} == set(tables)
    assert page.shown(100 * 0.0370301407) == "3.70301" and page.shown(float("nan")) == "–"


def test_the_rows_are_those_that_are_asked_for(run: Path) -> None:
    found, tables = page_of(run), fw.open_run(run)
    rows = {name: set() for name in tables}
    for given, _ in found.numbers:
        name, _, row = given["data-from"].split("/")
        rows[name].add(int(row))
    mode, flutter, forced = (tables[name] for name in ("mode", "flutter", "forced"))
    slip = int(np.flatnonzero(mode["slip"] > 0)[0])
    assert {0, len(mode) - 1, slip - 1, slip, int(np.argmax(mode["zeta"])), *mode.met("fold")} <= rows["mode"]
    assert set(flutter.met("zero_damping")) <= rows["flutter"] and len(flutter.met("zero_damping")) == 2
    for level in (2.0, 8.0):
        mine = np.flatnonzero(forced["level"] == level)
        assert int(mine[np.argmax(forced["amplitude"][mine])]) in rows["forced"]
    assert "limit cycle, stable" in found.text and "limit cycle, unstable" in found.text


def test_the_rows_of_a_driven_wheel_are_those_of_its_overview(tmp_path: Path) -> None:
    """Of each level the peak of any sector, not of the one that is observed, whose amplitude is largest elsewhere."""
    columns = ["point", "level", "frequency_hz", "amplitude", "largest_amplitude", "largest_sector"]
    writer = AnalysisWriter(tmp_path, "wheel", columns, {"type": "forced"})
    found = [(1.0, 0.1, 0.2, 3), (1.0, 0.2, 0.9, 14), (1.0, 0.8, 0.81, 5), (1.0, 0.1, 0.1, 0)]
    found += [(2 * level, 2 * own, 2 * largest, sector) for level, own, largest, sector in found]
    for point, (level, own, largest, sector) in enumerate(found):
        writer.append(dict(zip(columns, (point, level, 10.0 + point, own, largest, sector))))
    writer.close("done", "stop value reached")
    (told,), analysis = overviews(tmp_path)[1], Run(tmp_path).analyses["wheel"]
    marks = marked(analysis, told)
    assert [row for row, words in marks.items() if "largest amplitude of any sector" in words] == [1, 5]
    assert told.peak["point"] in marks and not {2, 6} & {*marks}


def test_it_says_what_the_run_is(run: Path, chain: Path) -> None:
    text, record = page_of(run).text, read_record(run)
    for said in (
        "Two-dof oscillator with a friction damper",
        "regularised_coulomb",
        "friction_limit 5 N; regularisation_velocity 0.05 m/s",
        "--quick --set forced.time_points=0",
        "diagonal of M 0.02 to 1 kg",
        "m1, m2",
        "stop value reached",
        "1 MPI rank",
        *(record["versions"][name] for name in ("petsc", "slepc4py", "numpy", "python", "fretwave", "mpi")),
        record["host"],
    ):
        assert said in text, said
    for name in ("results.h5", "case.toml"):
        assert hashlib.sha256((run / name).read_bytes()).hexdigest() in text
    text = page_of(chain).text
    for said in (
        "3 along x, 3 along y, 3 along z kg",
        "18 dofs to 6 kept and 12 component modes",
        "pads coulomb_3d 2 normal_stiffness 1e+07 to 2e+07 N/m",
        "area 0.0004 m^2 in all",
        'loads = ["weight"]',
        "note: K is singular without contact",
        hashlib.sha256((chain.parent / "model.py").read_bytes()).hexdigest(),
    ):
        assert said in text, said


def test_times_are_told_apart(run: Path) -> None:
    """The summary's is the sum over the points; that of the section has the start and the end of the analysis too."""
    text, whole = page_of(run).text, read_record(run)["analyses"]["mode"]["wall_s"]
    points = fw.open_run(run)["mode"]["wall_s"].sum()
    assert points < whole
    assert "time of points" in text and f"{points:.2f} s" in text
    assert f"{whole:g} s, with what is before and after its points" in text


def test_pictures_of_the_folder_are_used_and_missing_ones_drawn(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    for path in folder.glob("flutter*.png"):
        path.unlink()
    images = [given["src"] for name, given in page_of(folder).tags if name == "img"]
    kept = base64.b64encode((folder / "mode_backbone.png").read_bytes()).decode()
    assert f"data:image/png;base64,{kept}" in images
    drawn = [image for image in images if image.startswith("data:image/svg")]
    assert drawn and b"<svg" in base64.b64decode(drawn[0].partition(",")[2])
    assert not list(folder.glob("flutter*.png"))
    os.utime(folder / "mode_backbone.png", (1, 1))  # of other results than those that are there
    assert f"data:image/png;base64,{kept}" not in [given.get("src") for _, given in page_of(folder).tags]


def test_a_run_that_was_cut_off_says_so(run: Path, tmp_path: Path) -> None:
    """Its analyses: one done, one in a journal, one that was not begun."""
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    for name in ("flutter", "forced"):
        with rewritten(folder / "results.h5", name):
            pass
    record = read_record(folder)
    record["status"] = "running"
    del record["analyses"]["flutter"], record["analyses"]["forced"]
    write_record(folder, record)
    columns = ["point", "amplitude", "frequency_hz", "omega0", "zeta", "slip", "event"]
    writer = AnalysisWriter(folder, "flutter", columns, {"type": "mode", "run_id": record["run_id"]})
    for point in range(3):
        row = {"point": point, "amplitude": 0.1 + point, "frequency_hz": 4.0, "omega0": 25.0, "zeta": 0.01, "slip": 0.0}
        writer.append({**row, "event": ""})
    writer.abandon()
    found = page_of(folder)
    for said in ("not finished", "NOT FINISHED: flutter", "forced has no results: not begun", ".flutter.rows"):
        assert said in found.text, said
    assert ("status bad" in [given.get("class") for _, given in found.tags]) and not found.wrong
    assert "flutter/amplitude/2" in {given["data-from"] for given, _ in found.numbers}


def test_a_run_without_any_point_has_its_page(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("*.h5", "*.csv", "*.png"))
    text = page_of(tmp_path / "run").text
    assert "mode has no results: stop value reached" in text and "Two-dof" in text


def test_why_a_branch_stopped_stands_first(tmp_path: Path) -> None:
    few = ["--set", "mode.step.max_points=5", "--only", "mode", "--quick", "-q", "--no-plots"]
    assert call("run", CASE, *few, "--out", tmp_path / "run") == 3
    text = page_of(tmp_path / "run").text
    reason = read_record(tmp_path / "run")["analyses"]["mode"]["reason"]
    assert f"mode stopped early after 5 points: {reason}" in text and "number of points" in reason


def test_a_model_that_is_gone_is_told(chain: Path, tmp_path: Path) -> None:
    shutil.copytree(chain, tmp_path / "run")
    record = read_record(tmp_path / "run")
    record["case"]["path"] = str(tmp_path / "nowhere" / "case.toml")
    write_record(tmp_path / "run", record)
    text = page_of(tmp_path / "run").text
    assert "the model cannot be read again" in text and "coulomb_3d" in text and "not there" in text


def test_a_sweep_has_its_page(tmp_path: Path) -> None:
    short = ["--quick", "--only", "mode", "--set", "mode.amplitude=[0.02,0.3]", "--set", "mode.report_at=[]", "-q"]
    over = ["--over", "contact.damper.friction_limit=4,5"]
    assert call("sweep", CASE, *short, *over, "--no-plots", "--out", tmp_path / "sweep") == 0
    found = page_of(tmp_path / "sweep")
    assert "contact.damper.friction_limit = [4, 5]" in found.text and "friction_limit 4 N" in found.text
    assert not found.wrong and len(found.numbers) > 50


def test_what_is_no_run_is_refused(tmp_path: Path, capsys) -> None:
    assert call("report", tmp_path) == 2
    assert capsys.readouterr().err.count("fix:") == 1


def test_it_goes_where_it_is_told(run: Path, tmp_path: Path, capsys) -> None:
    capsys.readouterr()
    assert call("report", run, "--out", tmp_path / "page.html") == 0
    assert "page.html" in capsys.readouterr().out and (tmp_path / "page.html").stat().st_size > 1e5


@pytest.mark.parametrize("out", [".", ""])
def test_a_folder_is_no_file(run: Path, capsys, out: str) -> None:
    for words in (["report", run], ["probe", run, "--pairs"]):
        assert call(*words, f"--out={out}") == 2
        assert "fix:      --out " in capsys.readouterr().err


def test_text_is_no_markup() -> None:
    odd = '<b>&"</td>'
    made = page.page(
        odd, odd, [page.table([odd], [[odd]]), page.facts([(odd, odd)]), page.lines([odd]), page.box([odd])]
    )
    found = Page(made)
    assert not found.wrong and not found.open and found.text.count(odd) == 8 - 1


def test_mass_is_along_what_moves() -> None:
    """Three nodes, of which one is held in x; M with entries between dofs."""
    places = np.array([[-1, 0, 1], [2, 3, 4], [5, 6, 7]])
    M = np.diag(np.arange(1.0, 9.0)) + 0.5 * (np.eye(8, k=3) + np.eye(8, k=-3))
    built = fw.Structure(M=M, K=np.eye(8), coordinates=np.zeros((3, 3)), displacements=places)
    moved = translations(built)
    assert moved is not None and moved.sum() == 8
    x = np.isin(np.arange(8), [2, 5]).astype(float)
    assert moved[:, 0] @ M @ moved[:, 0] == pytest.approx(x @ M @ x, rel=ROUNDING)
    assert translations(fw.Structure(M=np.eye(2), K=np.eye(2))) is None


def test_lines_of_points_are_left_out(tmp_path: Path) -> None:
    kept = ["note: beware", "mode: 3 points, newton 3", "wear: settings"]
    points = ["mode    0  a  2e-07 m  zeta 1 %  newton  2  0.001 s  start", "wear a 1 m  0 cycles  newton  1  0.00 s"]
    points.append("flutter ND  -4    0  a  2e-05 m  newton  3  0.001 s")
    (tmp_path / "run.log").write_text("\n".join([*kept, *points]))
    assert log_lines(tmp_path, ["mode", "wear", "flutter"]) == kept
    assert warnings_of(kept) == kept[:1]
    assert log_lines(tmp_path / "none", []) == []
