"""Conditions, switches and events."""

import operator

import numpy as np
import pytest
from block_driver import drive, of

RNG = np.random.default_rng(0)
A, B = RNG.integers(0, 3, (2, 40)).astype(float)
P, Q, R = RNG.uniform(size=(3, 60)) < 0.4


@pytest.mark.parametrize(
    ("relation", "function"),
    [
        ("<", operator.lt),
        ("<=", operator.le),
        pytest.param(">", operator.gt, marks=pytest.mark.ci),
        pytest.param(">=", operator.ge, marks=pytest.mark.ci),
        ("==", operator.eq),
        pytest.param("!=", operator.ne, marks=pytest.mark.ci),
    ],
)
def test_compare(relation, function):
    np.testing.assert_array_equal(drive(of("compare", relation), 40, u1=A, u2=B)["y"], function(A, B))
    np.testing.assert_array_equal(drive(of("compare", relation, 1.0), 40, u1=A)["y"], function(A, 1.0))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("and", P & Q & R),
        ("or", P | Q | R),
        ("xor", P ^ Q ^ R),
        ("nand", ~(P & Q & R)),
        ("nor", ~(P | Q | R)),
    ],
)
def test_logic(name, expected):
    np.testing.assert_array_equal(drive(of("logic", name, 3), 60, u1=P, u2=Q, u3=R)["y"], expected)


def test_not():
    np.testing.assert_array_equal(drive(of("not"), 60, u=P)["y"], ~P)


def test_switch_and_multi_switch():
    on, off = RNG.normal(size=(2, 60)).astype(np.float32)
    np.testing.assert_array_equal(drive(of("switch"), 60, condition=P, on=on, off=off)["y"], np.where(P, on, off))
    index = RNG.integers(-2, 5, 60)
    chosen = np.where(np.clip(index, 0, 1) == 0, on, off)
    np.testing.assert_array_equal(drive(of("multi-switch", 2), 60, index=index, u0=on, u1=off)["y"], chosen)
    with pytest.raises(ValueError, match="count = 0: must be an integer from 1"):
        of("multi-switch", 0)


def events(edge, condition):
    before = np.concatenate([[False], condition[:-1]])
    return {
        "rising": condition & ~before,
        "falling": before & ~condition,
        "either": before != condition,
        "true": condition,
    }[edge]


@pytest.mark.ci
@pytest.mark.representatives("rising", "either")  # a sample is taken at all of them below
@pytest.mark.parametrize("edge", ["rising", "falling", "either", "true"])
def test_counter_counts_events(edge):
    expected = np.cumsum(events(edge, P))
    np.testing.assert_array_equal(drive(of("counter", edge=edge), 60, u=P)["count"], expected)
    np.testing.assert_array_equal(drive(of("counter", 5, edge), 60, u=P)["count"], expected % 5)
    count, counts = 0, []
    for happened, reset in zip(events(edge, P), Q, strict=True):
        count = 0 if reset else count + happened
        counts.append(count)
    np.testing.assert_array_equal(drive(of("counter", edge=edge), 60, u=P, reset=Q)["count"], counts)


@pytest.mark.parametrize("edge", ["rising", "falling", "either", "true"])
def test_sample_and_hold(edge):
    u = RNG.normal(size=60).astype(np.float32)
    held, expected = np.float32(-7), []
    for happened, value in zip(events(edge, P), u, strict=True):
        held = value if happened else held
        expected.append(held)
    np.testing.assert_array_equal(drive(of("sample and hold", -7.0, edge), 60, u=u, sample=P)["y"], expected)
