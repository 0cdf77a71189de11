"""Learning diagrams and the library's own learners, for tests that hold one against the other."""

import jax
import numpy as np
from jax.flatten_util import ravel_pytree

import timlab
from motorgrad import policies
from motorgrad.training import stepper_for
from timlab.gallery import learner

SEEDS = [3, 4, 11]


def flat(policy):
    """Parameters of many seeds as the wires have them, `(seeds, parameters)`."""
    return np.asarray(jax.vmap(lambda each: ravel_pytree(policies.trainable(each))[0])(policy))


def stepper(task, agent, seeds=SEEDS):
    return stepper_for(task, agent, seeds)


def diagram_of(units, world, decay, **settings):
    made = timlab.Diagram(tick=world.instance.period)
    learner(made, units, world, decay, **settings)
    return made


def learned(diagram, decisions, seeds=SEEDS, begin=None):
    """Parameters once so many decisions were learned from: what acts at the tick of that number."""
    run = timlab.Run(diagram, seeds, watch=["policy.parameters"])
    if begin is not None:
        run.restore(begin(run.state))
    return run.advance(decisions + 1)["policy.parameters"][:, -1]
