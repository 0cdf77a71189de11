"""Searches whose candidates are scored by jobs: the same scores here and in other processes, whatever fails."""

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Hopper, compile_model
from motorgrad.search import Boltzmann, Range, Space, search
from motorgrad.studies import ScoreEach

SPACE = Space({"height": Range(0.1, 1.0), "push": Range(0.0, 1.0)})
METHOD = Boltzmann(candidates=6)


def landing_speed(numbers, random):
    """How fast the body of a hopper arrives at the ground, pushed a little; a candidate that is pushed hard fails."""
    if numbers["push"] > 0.9:
        raise ValueError("pushed too hard")
    model = compile_model(Hopper())
    data = mujoco.MjData(model)
    data.qvel[-1] = -numbers["push"] + 1e-3 * random.standard_normal()
    mujoco.mj_step(model, data, nstep=round(100 * numbers["height"]))
    return float(-data.qvel[-1])


def found(out, **how):
    return search(ScoreEach(landing_speed, out, **how), SPACE, METHOD, evaluations=12, seed=5, progress=False)


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    return found(tmp_path_factory.mktemp("here"))


def test_scores_are_kept(here, tmp_path, monkeypatch):
    assert np.isfinite(here.scores).any()
    first = found(tmp_path)
    np.testing.assert_array_equal(first.scores, here.scores)
    files = sorted(tmp_path.glob("*/*/score.json"))
    assert len(files) == np.isfinite(here.scores).sum()
    monkeypatch.setattr(mujoco, "mj_step", None)  # everything is known
    np.testing.assert_array_equal(found(tmp_path).scores, here.scores)


@pytest.mark.slow
@pytest.mark.ci
def test_other_processes_find_the_same(here, tmp_path):
    other = found(tmp_path, on="processes", workers=2)
    np.testing.assert_array_equal(other.candidates, here.candidates)
    np.testing.assert_array_equal(other.scores, here.scores)


def test_a_candidate_that_fails_is_set_aside_with_its_reason(tmp_path):
    def failing(numbers, random):
        if numbers["height"] > 0.5:
            raise RuntimeError("too high")
        return numbers["height"]

    made = search(ScoreEach(failing, tmp_path, attempts=2), SPACE, METHOD, evaluations=12, progress=False)
    high = made.candidates[:, 0] > 0.5
    assert high.any()
    np.testing.assert_array_equal(np.isnan(made.scores), high)
    np.testing.assert_array_equal(made.scores[~high], made.candidates[~high, 0])
    assert len(list(tmp_path.glob("*/failures/*.json"))) == high.sum()
