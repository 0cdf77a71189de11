"""Units that come while a diagram runs, against the library's growing learner."""

import numpy as np
import pytest
from learning_diagrams import flat, stepper

import motorgrad as mg
from motorgrad import lab
from motorgrad.lab.gallery import learner
from motorgrad.training import AgentSettings

START = {"start": {"x": [0.3, 0.3], "y": [0.6, 0.6]}, "units": 3}


def grown(grows, **settings):
    made = lab.Diagram(tick=1.0)
    units = lab.GrowingGaussians(
        3, 2, centre=0.0, width=1.0, height=0.5, limits=None, interval=40, shrink=0.95, grows=grows, **settings
    )
    learner(made, units, lab.World("particle-orbit", START), 0.9, rate=(1e-3, 5e-3), groups=(6, 6))
    made.connect("world.reward", "policy.reward")
    made.connect("world.valid", "policy.valid")
    return made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grows", "settings"),
    [
        ("clock", {"growth_interval": 40}),
        pytest.param("plateau", {"growth_window": 60}, marks=pytest.mark.slow),
    ],
)
def test_a_pool_that_grows_is_the_librarys(grows, settings):
    task = mg.make("particle-orbit", **START)
    rates = {"centre": 1e-3, "log_width": 5e-3}
    more = {"growth": grows, "growth_shrink": 0.95, "decay": 0.9, "rates": rates, **settings}
    agent = AgentSettings(policy="growing", policy_settings={"p_max": 0.5}, **more).agent(task)
    theirs = stepper(task, agent)
    theirs.advance(150)
    made = grown(grows, window=settings.get("growth_window", 4000))
    record = lab.Run(made, [3, 4, 11], watch=["policy.parameters", "policy.units"]).advance(151)
    ours = record["policy.parameters"][:, -1]
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)
    units = record["policy.units"]
    assert (units[:, 0] == 1).all()
    assert (np.diff(units, axis=1) >= 0).all()
    assert units[0, -1] == np.asarray(theirs.policies().active)[0].sum()
    if grows == "clock":
        np.testing.assert_array_equal(np.flatnonzero(np.diff(units[0])) + 1, [40, 80])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"interval": 40, "shrink": 0.999}, "interval = 40: must be at least"),
        ({"narrow": 2.0}, "cutoff = 2.0"),
        ({"begin": (0.5,), "observed": 2}, "begin"),
        ({"shrink": "slowly"}, "shrink = 'slowly'"),
        ({"grows": "never"}, "unknown grows 'never'"),
    ],
)
def test_growth_that_cannot_be_is_refused(given, told):
    with pytest.raises(ValueError, match=told):
        lab.GrowingGaussians(3, **given)
