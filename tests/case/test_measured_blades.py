"""Deviations of a wheel's sectors from a CSV file: the same case as with the numbers written in it, errors by line."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call
from test_engine_order import SECTORS, TEXT

from fretwave.case.load import load_case

pytestmark = pytest.mark.ranks(1)

MEASURED = "sector,deviation\n" + "\n".join(f"{k},{0.01 * (k - 2)}" for k in range(SECTORS)) + "\n"


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (MEASURED.replace("5,0.03\n", ""), ("lacks sectors", "none for sector 5", "6 lines, one for each sector")),
        (MEASURED + "6,0.0\n", ("is of no sector", "blades.csv:8", "sector 6", "0 to 5")),
        (MEASURED.replace(".", ","), ("of more columns", "blades.csv:2", "0,-0,02", "decimal points")),
        (MEASURED.replace("0.03", "-1.0"), ("has no such value", "a number > -1")),
        (MEASURED.replace("sector", "blade"), ("has other headings", "sector,deviation")),
    ],
)
def test_measured_deviations_that_do_not_fit(tmp_path: Path, table: str, words: tuple[str, ...], capsys) -> None:
    path = measured_case(tmp_path, table)
    assert call("check", path) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in (*words, "case.toml", "forced.mistuning.deviations", "fix:")), said


def test_deviations_that_look_like_ratios_are_warned_of(tmp_path: Path, capsys) -> None:
    ratios = "sector,deviation\n" + "\n".join(f"{k},{1 + 0.01 * (k - 2)}" for k in range(SECTORS)) + "\n"
    for table, odd in ((ratios, True), (MEASURED, False)):
        assert call("check", measured_case(tmp_path, table), "--no-solve") == 0
        said = capsys.readouterr().out
        assert ("'forced' look like ratios" in said and "0.98 to 1.03" in said and "take 1 off each" in said) == odd


def measured_case(folder: Path, table: str) -> Path:
    own = 'engine_order = 8\nwheel = true\nmistuning = { deviations = "blades.csv" }'
    (folder / "case.toml").write_text(TEXT.replace("engine_order = 8", own))
    (folder / "blades.csv").write_text(table)
    return folder / "case.toml"


def test_measured_deviations_are_those_written_in_the_case(tmp_path: Path) -> None:
    path = measured_case(tmp_path, MEASURED)
    given = [0.01 * (k - 2) for k in range(SECTORS)]
    of_file = load_case(path)
    path.write_text(path.read_text().replace('"blades.csv"', str(given)))
    written = load_case(path)
    assert of_file.digest == written.digest
    assert of_file.analyses["forced"].mistuning.deviations == given
