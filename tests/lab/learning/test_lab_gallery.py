"""Every diagram of the gallery runs, learns, and can be kept."""

import numpy as np
import pytest

from motorgrad import lab
from motorgrad.lab.gallery import GALLERY, example

SEEDS = 16
GAINS = {
    "motoneuron-pool": (20_000, 0.2),
    "linear-recruitment": (20_000, 0.2),
    "particle": (12_000, 0.05),
    "constructive-pool": (24_000, 0.01),
    "orbit": (20_000, 0.02),
    "chain": (6_000, 0.02),
    "hopper": (6_000, 0.03),
    "network": (6_000, 0.02),
    "leg-controller": (6_000, 0.1),
}
"""For how many ticks, and by how much the reward is to rise from the first eighth of them to the last."""
QUICK = ("motoneuron-pool", "leg-controller")


@pytest.mark.ci
@pytest.mark.representatives("motoneuron-pool", "leg-controller")
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in GALLERY])
def test_it_learns(name):
    ticks, rise = GAINS[name]
    made = example(name)
    reward = "reward.y" if "reward" in made.nodes else "world.reward"
    seen = lab.Run(made, SEEDS, watch=[reward]).advance(ticks)[reward]
    parts = seen.reshape(SEEDS, 8, -1).mean(2)
    gained = parts[:, -1] - parts[:, 0]
    assert gained.mean() > rise
    assert gained.mean() > 3 * gained.std(ddof=1) / np.sqrt(SEEDS)


@pytest.mark.parametrize("name", GALLERY)
def test_it_is_sound_and_lasts(name):
    made = example(name)
    assert lab.problems(made) == []
    assert made.title
    assert len(made.comment) > 100
    assert lab.loads(lab.dumps(made)) == made
    assert example(name) is not made


def test_an_unknown_one_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="did you mean 'hopper'"):
        example("hoper")
