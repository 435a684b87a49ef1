"""Whether a scene's answer depends on its steps: what is compared, and that a loop passed over is told."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "cases"))
from scenes.judge import read  # noqa: E402
from scenes.run import all_scenes  # noqa: E402
from scenes.scene import Finished, run  # noqa: E402
from scenes.steps import by_steps, compare, solutions, values  # noqa: E402

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A scene with its verdict and both tables."""
    scene, done = next(s for s in all_scenes() if s.name == "eps_0.01"), []

    def kept(scene, folder):
        done.append(run(scene, folder))
        return done[-1]

    verdict = by_steps(scene, tmp_path_factory.mktemp("steps"), kept)
    return verdict, [read(scene, one) for one in done]


def test_a_scene_is_the_same_by_steps_as_they_come_and_by_short_ones(solved):
    verdict, (long, short) = solved
    assert verdict.word == "right", verdict.reasons
    assert len(solutions(long[0])) == len(solutions(short[0])) >= 7
    assert len(short[0].Q) > 2 * len(long[0].Q)


def test_a_loop_passed_over_and_another_solution_are_told(solved):
    _, (long, short) = solved
    less = {name: column.copy() for name, column in long[0].columns.items()}
    less["event"] = np.array(
        [event.replace("report", "") if k < 40 else event for k, event in enumerate(less["event"])]
    )
    assert "solutions" in compare([dataclasses.replace(long[0], columns=less)], short)[0]
    less["event"] = np.array([event + " fold" if k == 3 else event for k, event in enumerate(long[0].columns["event"])])
    assert "folds" in compare([dataclasses.replace(long[0], columns=less)], short)[0]
    moved = long[0].columns | {"zeta": long[0].columns["zeta"] + 1e-4}
    assert "off by" in compare([dataclasses.replace(long[0], columns=moved)], short)[0]


def test_one_run_that_gives_up_is_no_right_answer(tmp_path):
    scene, codes = next(s for s in all_scenes() if s.name == "eps_0.01"), iter([0, 3, None, 0, 2, 2, 0, 0])
    assert len(values(scene)) == 7

    def ended(scene, folder):
        return Finished(next(codes), 0.1, "text", folder)

    assert [by_steps(scene, tmp_path, ended).word for _ in range(4)] == ["gave up", "hung", "refused", "wrong"]
