"""Units that come while a diagram runs, against the library's growing learner."""

import numpy as np
import pytest
from learning_diagrams import flat, stepper

import motorgrad as mg
import timlab
from timlab.gallery import learner

START = {"start": {"x": [0.3, 0.3], "y": [0.6, 0.6]}, "units": 3}


def grown(criterion, **settings):
    made = timlab.Diagram(tick=1.0)
    start = {"centre": 0.0, "width": 1.0, "height": 0.5, "limits": None}
    units = timlab.GrowingGaussians(3, 2, **start, shrink=0.95, criterion=criterion, **settings)
    learner(made, units, timlab.World("particle-orbit", START), 0.9, learning_rate=(1e-3, 5e-3), groups=(6, 6))
    made.connect("world.reward", "policy.reward")
    made.connect("world.valid", "policy.valid")
    return made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("criterion", "settings"),
    [
        ("clock", {"interval": 40}),
        pytest.param("plateau", {"window": 60}, marks=pytest.mark.slow),
    ],
)
def test_a_pool_that_grows_is_the_librarys(criterion, settings):
    task = mg.make("particle-orbit", **START)
    rates = {"centre": 1e-3, "log_width": 5e-3}
    growth = {"criterion": {"kind": criterion, **settings}, "shrink": 0.95}
    policy = {"kind": "growing", "p_max": 0.5}
    theirs = stepper(task, mg.agent_for(task, policy=policy, growth=growth, decay=0.9, learning_rate=rates))
    theirs.advance(150)
    made = grown(criterion, **settings)
    record = timlab.Run(made, [3, 4, 11], watch=["policy.parameters", "policy.units"]).advance(151)
    ours = record["policy.parameters"][:, -1]
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)
    units = record["policy.units"]
    assert (units[:, 0] == 1).all()
    assert (np.diff(units, axis=1) >= 0).all()
    assert units[0, -1] == np.asarray(theirs.policies().active)[0].sum()
    if criterion == "clock":
        np.testing.assert_array_equal(np.flatnonzero(np.diff(units[0])) + 1, [40, 80])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"interval": 40, "shrink": 0.999}, "interval = 40: must be at least"),
        ({"cutoff": 2.0}, "cutoff = 2.0"),
        ({"growth_centre": (0.5, 0.5, 0.5), "observed": 2}, "growth_centre"),
        ({"shrink": "slowly"}, "shrink = 'slowly'"),
        ({"criterion": "never"}, "unknown criterion 'never'"),
    ],
)
def test_growth_that_cannot_be_is_refused(given, told):
    with pytest.raises(ValueError, match=told):
        timlab.GrowingGaussians(3, **given)
