"""Functions with a known optimum, and the methods under test."""

import importlib.util

import numpy as np
import pytest

from motorgrad.search import (
    Annealing,
    BayesianOptimisation,
    Boltzmann,
    CmaEs,
    EvolutionStrategy,
    Genetic,
    Pulled,
    Range,
    Space,
    Uniform,
)

needs_evosax, needs_tinygp = (
    pytest.mark.skipif(importlib.util.find_spec(name) is None, reason="needs the extra motorgrad[search]")
    for name in ("evosax", "tinygp")
)
SIZE = 5
SPACE = Space({name: Range(-5.0, 5.0, start=3.0) for name in "abcde"})
TURN = np.linalg.qr(np.random.default_rng(7).standard_normal((SIZE, SIZE)))[0]
AXES = np.logspace(0, 3, SIZE)

METHODS = [
    pytest.param(Uniform, id="uniform"),
    pytest.param(Boltzmann, id="boltzmann"),
    pytest.param(Pulled, id="pulled"),
    pytest.param(Annealing, id="annealing"),
    pytest.param(Genetic, id="genetic"),
    pytest.param(CmaEs, id="cma-es", marks=needs_evosax),
    pytest.param(lambda: EvolutionStrategy(population=12), id="evolution-strategy", marks=needs_evosax),
    pytest.param(lambda: BayesianOptimisation(candidates=12), id="bayesian-optimisation", marks=needs_tinygp),
]


def _rows(candidates):
    return np.array([list(each.values()) for each in candidates])


def sphere(candidates, random):
    """Greatest, 0, at 1."""
    return -((_rows(candidates) - 1.0) ** 2).sum(axis=1)


def noisy_sphere(candidates, random):
    """The same with noise, of 1/40 of what the start loses."""
    return sphere(candidates, random) + 0.5 * random.standard_normal(len(candidates))


def ellipsoid(candidates, random):
    """Greatest, 0, at 1; a thousand times as steep along one direction as along another, none of them a number's."""
    return -(((_rows(candidates) - 1.0) @ TURN) ** 2 @ AXES)
