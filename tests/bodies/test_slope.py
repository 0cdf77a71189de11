"""A plane that rises under a body, and the clock of an open-loop tripod gait."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import BodyBatch, Hexapod, Hopper, SlopeBatch, TripodClock, read_hexapod
from motorgrad.tasks import TRIPOD_SYNERGIES, synergy_matrix


def on(slope, ahead, activation):
    """The activation of one decision on a plane that rises by `slope` degrees in the direction `ahead` (degrees)."""
    ground = np.broadcast_to(np.radians([slope, ahead]), (len(activation), 2))
    return np.concatenate([activation, ground], axis=1)


def standing(batch):
    return np.tile([float(name.startswith("depressor")) for name in batch.groups], (batch.seeds, 1))


def test_a_level_plane_is_the_body_s_own_ground_to_the_last_bit():
    plain, tilted = BodyBatch(Hexapod(), 2, 4, 1), SlopeBatch(Hexapod(), 2, 4, 1)
    random = np.random.default_rng(0)
    for _ in range(20):
        activation = random.random((2, 24)).round()
        plain.step(activation)
        tilted.step(on(0.0, 70.0, activation))
        np.testing.assert_array_equal(tilted.packed, plain.packed)


@pytest.mark.parametrize("ahead", [0.0, 90.0, 200.0])
def test_a_slippery_body_slides_down_as_fast_as_the_slope_says(ahead):
    """Without friction a body on a slope of 30° accelerates by g sin 30° downhill, whatever it does."""
    slippery = Hexapod().map_sections(lambda s: dataclasses.replace(s, leg=dataclasses.replace(s.leg, friction=1e-5)))
    batch = SlopeBatch(slippery, 1, 4, 1)
    for _ in range(10):
        batch.step(on(30.0, ahead, standing(batch)))
    before = batch.unpack(batch.packed.copy()).sensors["velocity"][0]
    for _ in range(10):
        batch.step(on(30.0, ahead, standing(batch)))
    gained = batch.unpack(batch.packed).sensors["velocity"][0] - before
    down = -np.array([np.cos(np.radians(ahead)), np.sin(np.radians(ahead))])
    np.testing.assert_allclose(gained[:2], 9.81 * 0.5 * 0.1 * down, atol=0.05)


def test_every_seed_has_a_slope_of_its_own_that_changes():
    batch = SlopeBatch(Hexapod(), 2, 4, 1)
    for slopes in ([20.0, -20.0], [-20.0, 20.0]):
        batch.reset()
        for _ in range(60):
            ground = np.stack([np.radians(slopes), np.zeros(2)], axis=1)
            batch.step(np.concatenate([np.zeros((2, 24)), ground], axis=1))
        # limp legs give way downhill
        shift = read_hexapod(batch.unpack(batch.packed)).position[:, 0]
        assert shift[int(np.argmax(slopes))] < shift[int(np.argmin(slopes))]


def test_a_snapshot_goes_on_to_the_last_bit_also_over_a_reset():
    one, other = SlopeBatch(Hexapod(), 2, 4, 1), SlopeBatch(Hexapod(), 2, 4, 1)
    for _ in range(10):
        one.step(on(15.0, 0.0, standing(one)))
    other.restore(one.snapshot())
    for batch in (one, other):
        batch.reset([1])
        for _ in range(10):
            batch.step(on(-5.0, 40.0, standing(batch)))
    np.testing.assert_array_equal(one.packed, other.packed)


def test_another_length_of_command_is_refused():
    batch = SlopeBatch(Hopper(), 1, 1, 1)
    with pytest.raises(ValueError, match=r"control.shape = \(1, 2\): must be \(seeds, groups \+ 2\) = \(1, 4\)"):
        batch.step(np.zeros((1, 2)))
    with pytest.raises(ValueError, match="body = "):
        SlopeBatch([Hopper()], 1)


def test_the_tripods_take_turns():
    clock = TripodClock()
    np.testing.assert_array_equal(clock.activation(np.array([0.1, 0.6])), [[0, 1, 1, 0], [1, 0, 0, 1]])
    muscles = synergy_matrix(TRIPOD_SYNERGIES, Hexapod().groups)
    firing = dict(zip(Hexapod().groups, clock.activation(np.array(0.1)) @ muscles, strict=True))
    assert firing["retractor_left_front"] == firing["protractor_right_front"] == 1
    assert firing["protractor_left_front"] == firing["retractor_right_front"] == 0


@pytest.mark.parametrize("duty", [0.3, 0.5, 0.8])
def test_each_tripod_stands_for_its_part_of_a_stride(duty):
    phases = np.linspace(0, 1, 1000, endpoint=False)
    swing_a, stance_a, swing_b, stance_b = TripodClock(duty).activation(phases).T
    np.testing.assert_array_equal(swing_a + stance_a, 1)
    np.testing.assert_array_equal(swing_b + stance_b, 1)
    assert stance_a.mean() == pytest.approx(duty, abs=2e-3)
    np.testing.assert_array_equal(np.roll(stance_a, 500), stance_b)


def test_a_phase_goes_round_once_in_a_period():
    clock = TripodClock()
    assert clock.advance(np.array(0.75), 0.4, 0.1) == pytest.approx(0.0, abs=1e-12)
    assert float(jax.jit(clock.advance, static_argnums=2)(jnp.array(0.2), 0.5, 0.1)) == pytest.approx(0.4)
    np.testing.assert_array_equal(clock.activation(jnp.array([0.1])), clock.activation(np.array([0.1])))


@pytest.mark.parametrize("duty", [0.0, 1.0, float("nan")])
def test_an_impossible_duty_is_refused(duty):
    with pytest.raises(ValueError, match=r"duty = .*: must be (in \(0, 1\)|a finite number)"):
        TripodClock(duty)
