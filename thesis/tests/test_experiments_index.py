"""The experiment on the spatial index: end to end, and its judgements."""

import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import SpatialIndex
from motorgrad.policies import LocalGaussians
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_6.section_6_5.spatial_index import Index, _moved


def values(dense=80.0, indexed=8.0, gap=0.0, worst=5e-4):
    rng, decision = np.random.default_rng(0), np.arange(1, 201) * 500
    rise = 0.2 * decision / decision[-1]
    sizes = np.array([16, 256, 1024, 4096])
    return {
        "sizes": sizes,
        "dense_cost": dense * sizes[:, None] / 4096 * np.ones(7),
        "indexed_cost": indexed * np.ones((4, 7)),
        "decision": decision,
        "dense_reward": rise + 0.01 * rng.normal(size=(24, 1)),
        "indexed_reward": rise + 0.01 * rng.normal(size=(24, 1)) + gap,
        "worst": np.array(worst),
        "missed": np.array(1e-5),
        "bound": np.array(1e-3),
    }


@pytest.mark.parametrize(
    ("changes", "held"),
    [
        ({}, [True] * 5),
        ({"dense": 60.0}, [False, True, True, True, True]),
        ({"gap": -0.02}, [True, True, True, False, True]),
        ({"gap": 0.3}, [True, True, True, False, True]),
        ({"worst": 0.002}, [True, True, True, True, False]),
    ],
)
def test_claims_hold_what_was_found_against_what_was_said_before(changes, held):
    assert [claim.holds for claim in Index().claims(values(**changes))] == held


def test_units_are_moved_as_far_as_their_margins_let_them():
    before = LocalGaussians(jnp.zeros((3, 2)), jnp.zeros((3, 2)))
    after = LocalGaussians(jnp.array([[0.1, 0], [5, 0], [0, 0]]), jnp.array([[0, 0], [0, 0], [0, 2.0]]))
    strain = np.asarray(SpatialIndex().strain(before, _moved(SpatialIndex(), before, after)))
    np.testing.assert_allclose(strain, [0.1, 1, 1], atol=0.03)
    assert strain.max() <= 1


@pytest.mark.slow
def test_it_is_reproduced(tmp_path):
    assert EXPERIMENTS["sec-6.5.4-index"] is Index
    reproduce(Index.quick(), tmp_path, progress=False)
    assert (tmp_path / "sec-6.5.4-index" / "figure.png").stat().st_size > 10_000


def test_impossible_settings_are_refused():
    for changes in ({"sizes": ()}, {"sizes": (64, 16)}, {"pairs": 0}, {"decisions": 1}, {"units": 2}, {"seeds": 1}):
        with pytest.raises(ValueError, match=next(iter(changes))):
            Index(**changes)
