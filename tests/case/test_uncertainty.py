"""``[uncertainty]``: the laws that values are drawn from, a stream for each key, what is refused and shown."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.swept_case import CASE as SWEPT
from scipy.stats import kstest, lognorm, norm, uniform

import fretwave as fw
from fretwave.case.load import load_case
from fretwave.case.schema import DistributionSection
from fretwave.case.uncertainty import draw, draws_of

pytestmark = pytest.mark.ranks(1)

CASES = Path(__file__).parents[2] / "cases"
#: Without the sweep over what is drawn here.
CASE = SWEPT[: SWEPT.index('[[analysis]]\nname = "limits"')]
SEEDS = 4000
EVEN = '{ distribution = "uniform", low = 0.1, high = 0.2 }'
LIMIT = 'values.contact.slider.friction_limit = { distribution = "lognormal", mean = 2.0, standard_deviation = 0.5 }'
STIFFNESS = 'factors.contact.slider.tangential_stiffness = { distribution = "uniform", low = 0.8, high = 1.2 }'


def drawn(count: int = SEEDS, key: str = "contact.slider.friction_limit", **given: object) -> np.ndarray:
    return np.array([draw(DistributionSection(**given), key, seed) for seed in range(count)])


def case_file(folder: Path, *lines: str, text: str = CASE) -> Path:
    path = folder / "case.toml"
    path.write_text("\n".join([*("[uncertainty]" for _ in lines[:1]), *lines]) + "\n" + text)
    return path


# The laws


def test_lognormal_values_have_the_moments_that_are_given() -> None:
    """Within four standard errors: that of the variance from the fourth moment of the law."""
    mean, deviation = 2.0, 0.5
    values = drawn(distribution="lognormal", mean=mean, standard_deviation=deviation)
    sigma = np.sqrt(np.log(1 + (deviation / mean) ** 2))
    law = lognorm(sigma, scale=mean * np.exp(-(sigma**2) / 2))
    assert (law.mean(), law.std()) == (pytest.approx(mean), pytest.approx(deviation))
    kurtosis = float(law.stats(moments="k")) + 3
    assert abs(values.mean() - mean) < 4 * deviation / np.sqrt(SEEDS)
    assert abs(values.var() - deviation**2) < 4 * deviation**2 * np.sqrt((kurtosis - 1) / SEEDS)
    assert kstest(values, law.cdf).pvalue > 1e-3


def test_normal_and_uniform_values() -> None:
    normal = drawn(distribution="normal", mean=-1.0, standard_deviation=0.2)
    assert kstest(normal, norm(-1.0, 0.2).cdf).pvalue > 1e-3
    even = drawn(distribution="uniform", low=-2.0, high=3.0)
    assert kstest(even, uniform(-2.0, 5.0).cdf).pvalue > 1e-3


@pytest.mark.parametrize(("mean", "deviation"), [(2.0, 1e-9), (1.0, 1e9), (1e-200, 1e-195)])
def test_lognormal_values_of_any_width(mean: float, deviation: float) -> None:
    """Logarithms are normal: of next to no width, and of a median a thousand millionth of the mean."""
    sigma = math.sqrt(math.log1p((deviation / mean) ** 2))
    values = np.log(drawn(400, distribution="lognormal", mean=mean, standard_deviation=deviation) / mean)
    assert kstest(values, norm(-(sigma**2) / 2, sigma).cdf).pvalue > 1e-3


def test_keys_have_streams_of_their_own() -> None:
    one, other = (drawn(key=key, distribution="normal", mean=0.0, standard_deviation=1.0) for key in ("a.x", "a.y"))
    assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(SEEDS)


# In a case


def test_another_key_changes_no_draw_and_the_seed_decides(tmp_path: Path) -> None:
    load = lambda *lines, seed=7: load_case(case_file(tmp_path, *lines), [f"uncertainty.seed={seed}"])  # noqa: E731
    alone, both, other = load(LIMIT), load(STIFFNESS, LIMIT), load(LIMIT, seed=8)
    limit = alone.contacts[0].parameters["friction_limit"]
    assert both.contacts[0].parameters["friction_limit"] == limit != other.contacts[0].parameters["friction_limit"]
    draws = draws_of(both.resolved)
    assert draws["contact.slider.friction_limit"] == limit == both.resolved["contact.slider.friction_limit"]
    factor = draws["factors.contact.slider.tangential_stiffness"]
    assert 0.8 < factor < 1.2 and both.contacts[0].parameters["tangential_stiffness"] == factor
    assert both.digest != alone.digest != other.digest


def test_keys_named_like_those_of_a_distribution_are_drawn(tmp_path: Path) -> None:
    """A mistuning's own standard deviation, and options of a builder by these names."""
    text = (CASES / "blisk_lumped" / "case.toml").read_text() + "\n[uncertainty]\nseed = 1\n"
    text += f"factors.mode_mistuned.mistuning.standard_deviation = {EVEN}\nvalues.model.options.friction = {EVEN}\n"
    (tmp_path / "case.toml").write_text(text)
    (tmp_path / "model.py").write_text((CASES / "blisk_lumped" / "model.py").read_text())
    found = load_case(tmp_path / "case.toml")
    share = draws_of(found.resolved)["factors.mode_mistuned.mistuning.standard_deviation"]
    assert found.analyses["mode_mistuned"].mistuning.standard_deviation == 0.02 * share and 0.1 < share < 0.2


def test_without_a_seed_the_case_is_as_it_is_written(tmp_path: Path) -> None:
    plain = load_case(case_file(tmp_path))
    assert load_case(case_file(tmp_path, LIMIT, STIFFNESS)).digest == plain.digest


def test_a_draw_is_the_run_with_that_value(tmp_path: Path) -> None:
    """What decides the results beside [uncertainty] itself."""
    found = load_case(case_file(tmp_path, LIMIT), ["uncertainty.seed=3"])
    limit = found.contacts[0].parameters["friction_limit"]
    given = load_case(case_file(tmp_path), [f"contact.slider.friction_limit={limit!r}"])
    own = {key: value for key, value in found.resolved.items() if not key.startswith("uncertainty.")}
    assert own == given.resolved


def test_factors_on_numbers_of_the_case_and_on_parameters_from_a_table(tmp_path: Path) -> None:
    (tmp_path / "k.csv").write_text("pair,tangential_stiffness\n0,5.0\n")
    text = CASE.replace("tangential_stiffness = 1.0", 'tangential_stiffness = "k.csv"')
    damping = 'factors.model.mass_damping = { distribution = "normal", mean = 1.0, standard_deviation = 0.1 }'
    text = text.replace("K = [[1.0]]", "K = [[1.0]]\nmass_damping = 0.3")
    found = load_case(case_file(tmp_path, STIFFNESS, damping, text=text), ["uncertainty.seed=5"])
    draws = draws_of(found.resolved)
    assert found.structure.mass_damping == 0.3 * draws["factors.model.mass_damping"]
    stiffness = found.contacts[0].parameters["tangential_stiffness"]
    assert stiffness == [5.0 * draws["factors.contact.slider.tangential_stiffness"]]


def test_check_says_what_is_drawn(tmp_path: Path, capfd) -> None:
    path = case_file(tmp_path, LIMIT, STIFFNESS)
    assert call("check", path) == 0
    said = capfd.readouterr().out
    assert "no seed, nothing is drawn" in said
    assert "contact.slider.friction_limit: lognormal, mean 2 N, standard deviation 0.5 N\n" in said
    assert call("check", path, "--set", "contact.slider.friction_limit=3.0") == 0
    assert "friction_limit = 3" in capfd.readouterr().out
    assert call("check", path, "--set", "uncertainty.seed=4") == 0
    said = capfd.readouterr().out
    value = load_case(path, ["uncertainty.seed=4"]).contacts[0].parameters["friction_limit"]
    assert "uncertainty (seed 4): factor on contact.slider.tangential_stiffness: uniform, 0.8 to 1.2; drawn" in said
    assert f"drawn: {value:.6g} N\n" in said
    assert re.search(r"0.8 to 1.2; drawn: [0-9.]+\n", said), "a factor has no unit"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["values.contact.slider.friction_limit = 3.0"], ("is no distribution", "case.toml:2")),
        (
            ['values.contact.slider.friction_limit = { distribution = "weibull", mean = 1.0 }'],
            ("has a wrong value", "'normal', 'lognormal' or 'uniform'"),
        ),
        (
            ['values.contact.slider.friction_limit = { distribution = "normal", low = 1.0, high = 2.0 }'],
            ("is normal and has low and high", "mean and standard_deviation"),
        ),
        (
            ['values.contact.slider.friction_limit = { distribution = "uniform", low = 2.0, high = 2.0 }'],
            ("is no range", "low < high"),
        ),
        (
            ['values.contact.slider.friction_limit = { distribution = "uniform", low = -1e308, high = 1e308 }'],
            ("is no range", "by a finite number"),
        ),
        ([LIMIT, LIMIT.replace("values", "factors")], ("is drawn twice", "case.toml:3", "also", "case.toml:2")),
        (
            [f"values.{name}.step.maximum = {EVEN}" for name in ("mode", "analysis.mode")],
            ("'analysis.mode.step.maximum' is drawn twice", "case.toml:3", "case.toml:2"),
        ),
        (
            ['values.contact.slider.friction_limit = { distribution = "lognormal", mean = 0, standard_deviation = 1 }'],
            ("has mean 0", "> 0"),
        ),
        (
            ['values.model.mass_damping = { distribution = "lognormal", mean = 1e-200, standard_deviation = 1.0 }'],
            ("has standard_deviation 1 at a mean of 1e-200", "at most 1e+09 times the mean"),
        ),
        (
            ['factors.contact.slider.friction_limit = { distribution = "uniform", low = -0.1, high = 2.0 }'],
            ("has low -0.1", "> 0"),
        ),
        (
            ['factors.contact.slider.frictoin_limit = { distribution = "uniform", low = 0.1, high = 2.0 }'],
            ("no parameter of contact.slider", "did you mean `friction_limit`?"),
        ),
        (
            ['values.contact.slidr.friction_limit = { distribution = "uniform", low = 0.1, high = 2.0 }'],
            ("addresses nothing", "did you mean `contact.slider.friction_limit`?"),
        ),
        (
            ['factors.model.mass_damping = { distribution = "uniform", low = 0.1, high = 2.0 }'],
            ("a factor is drawn on model.mass_damping", "no such key in the case", "uncertainty.values.model"),
        ),
        (["seed = 1"], ("there is nothing to draw",)),
        (["seed = -1", LIMIT], ("uncertainty.seed", "a value >= 0")),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, lines: list[str], words: tuple[str, ...]) -> None:
    with pytest.raises(fw.FretwaveError) as error:
        load_case(case_file(tmp_path, *lines))
    said = str(error.value)
    assert all(word in said for word in (*words, "fix:", "case.toml")), said


def wide(table: str, key: str, mean: float) -> str:
    return f'{table}.{key} = {{ distribution = "normal", mean = {mean}, standard_deviation = 3.0 }}'


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            wide("values", "contact.slider.tangential_stiffness", 1.0),
            ("contact.slider.tangential_stiffness is out of range", "> 0"),
        ),
        (wide("factors", "contact.slider.friction_limit", 1.0), ("is not positive", "> 0")),
        (wide("values", "model.mass_damping", 1.0), ("model.mass_damping has a wrong value", ">= 0")),
    ],
)
def test_values_drawn_beyond_their_bounds_are_refused(tmp_path: Path, line: str, words: tuple[str, ...], capfd) -> None:
    path = case_file(tmp_path, line)
    bad = []
    for seed in range(40):
        try:
            load_case(path, [f"uncertainty.seed={seed}"])
        except fw.FretwaveError as error:
            bad.append(seed)
            expected = (*words, f"drawn with seed {seed}", "case.toml:2", "lognormal")
            assert all(word in str(error) for word in expected), str(error)
    assert 8 <= len(bad) <= 22, "a normal value lies below - mean / deviation with 37 %"
    assert call("sweep", path, "--over", "uncertainty.seed=0:39", "--out", tmp_path / "run") == 2
    said = capfd.readouterr().err
    assert f"and with {len(bad) - 1} more values" in said and "lognormal" in said, said
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("line", "fix"),
    [
        ('{ distribution = "uniform", low = -3.0, high = -1.0 }', "take low and high within its bounds"),
        ('{ distribution = "normal", mean = -9.0, standard_deviation = 1.0 }', 'take `distribution = "lognormal"`'),
        (
            '{ distribution = "lognormal", mean = 1e308, standard_deviation = 1e308 }',
            "take a smaller standard_deviation",
        ),
    ],
)
def test_what_to_do_about_a_draw_fits_its_distribution(tmp_path: Path, line: str, fix: str) -> None:
    with pytest.raises(fw.FretwaveError) as error:
        load_case(case_file(tmp_path, f"values.contact.slider.friction_limit = {line}"), ["uncertainty.seed=1"])
    assert f"fix:      {fix}" in str(error.value)


def test_whole_numbers_are_swept_not_drawn(tmp_path: Path) -> None:
    line = 'values.mode.harmonics = { distribution = "lognormal", mean = 5.0, standard_deviation = 1.0 }'
    with pytest.raises(fw.FretwaveError) as error:
        load_case(case_file(tmp_path, line), ["uncertainty.seed=1"])
    assert "an integer" in str(error.value) and "--over mode.harmonics=3,5` goes through" in str(error.value)


def test_check_looks_whether_the_draws_fit(tmp_path: Path, capfd) -> None:
    path = case_file(tmp_path, LIMIT.replace("friction_limit", "friktion_limit"))
    assert load_case(path).uncertainty is not None
    assert call("check", path) == 2
    said = capfd.readouterr().err
    assert "unknown key 'friktion_limit'" in said and "drawn with seed 1" in said and "did you mean" in said, said


def test_what_is_drawn_is_not_given_too(tmp_path: Path) -> None:
    path = case_file(tmp_path, LIMIT)
    with pytest.raises(fw.FretwaveError, match="is drawn, and given on the command line"):
        load_case(path, ["contact.slider.friction_limit=3.0", "uncertainty.seed=1"])
