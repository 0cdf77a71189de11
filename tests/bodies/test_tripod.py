"""The fixed controller by its rules, and the walk that comes of it."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import (
    LEGS,
    TRIPODS,
    BodyBatch,
    Hexapod,
    HexapodReading,
    LegState,
    OnTerrain,
    Terrain,
    TripodController,
    biomimetic_hexapod,
    debounced,
    measure_gait,
    read_hexapod,
    walk,
)

STANCE, WAIT, SWING, DROP = LegState
FIRST, SECOND = ([LEGS.index(leg) for leg in tripod] for tripod in TRIPODS)
LOWEST = np.radians(np.full(6, -15.0))
SERVOS = Hexapod(drive="servos")


def feeling(lateral=0.0, vertical=0.0, contact=0.0, legs=6):
    """A reading in which every leg feels the same, angles in degrees, or each what is given."""
    full = {name: np.broadcast_to(np.asarray(value, float), (legs,)) for name, value in
            (("lateral", np.radians(lateral)), ("vertical", np.radians(vertical)), ("contact", contact))}  # fmt: skip
    rest = np.zeros(())
    return HexapodReading(full["lateral"], rest, full["vertical"], rest, full["contact"], *[rest] * 6)


def states(first, second):
    out = np.empty(6, int)
    out[FIRST], out[SECOND] = first, second
    return out


def test_tripods_are_front_and_rear_of_one_side_with_the_middle_of_the_other():
    assert sorted(FIRST + SECOND) == list(range(6))
    for tripod in TRIPODS:
        sides = {leg.split("_")[1]: leg.split("_")[0] for leg in tripod}
        assert sides["front"] == sides["rear"] != sides["middle"]


@pytest.mark.parametrize("tripod", [FIRST, SECOND])
@pytest.mark.parametrize(
    ("before", "after", "holds", "fails"),
    [
        (STANCE, WAIT, {"lateral": -20.1}, {"lateral": -19.9, "contact": 9.0}),
        (SWING, DROP, {"lateral": 20.1}, {"lateral": 19.9, "contact": 9.0}),
        (DROP, STANCE, {"contact": 0.6}, {"contact": 0.4, "lateral": 25.0}),
        (DROP, STANCE, {"vertical": -14.1}, {"vertical": -13.9}),
    ],
)
def test_each_leg_leaves_its_state_where_its_condition_holds(tripod, before, after, holds, fails):
    controller = TripodController()
    for leg in tripod:
        now = np.full(6, int(before))
        now[[other for other in range(6) if other != leg]] = int(SWING if before is not SWING else DROP)
        assert controller.decide(now, feeling(**fails), LOWEST)[leg] == before
        assert controller.decide(now, feeling(**holds), LOWEST)[leg] == after


@pytest.mark.parametrize("opposing", list(itertools.product(LegState, repeat=3)))
def test_a_leg_waits_for_more_than_one_opposing_leg_on_the_ground(opposing):
    """In the thesis's stance phase, that is in one of the two states in which a leg stands."""
    ready = opposing.count(STANCE) + opposing.count(WAIT) > 1
    for now, legs in ((states(WAIT, opposing), FIRST), (states(opposing, WAIT), SECOND)):
        after = TripodController().decide(now, feeling(vertical=20.0), LOWEST)
        assert set(after[legs]) == {int(SWING if ready else WAIT)}


def test_without_the_mending_a_leg_over_a_hollow_drops_for_ever():
    now, hanging = states(SWING, (STANCE, DROP, DROP)), feeling(vertical=-15.0)
    worded, mended = TripodController(mended=False), TripodController()
    np.testing.assert_array_equal(worded.decide(now, hanging, LOWEST), now)
    np.testing.assert_array_equal(mended.decide(now, hanging, LOWEST), states(SWING, STANCE))


@pytest.mark.parametrize("mended", [False, True])
def test_no_legs_wait_for_each_other_for_ever(mended):
    """Of legs on the ground beyond their rear angle, some leave it at the next decision but one."""
    controller, behind = TripodController(mended=mended), feeling(lateral=-21.0, vertical=20.0, contact=9.0)
    for now in map(np.array, itertools.product((STANCE, WAIT), repeat=6)):
        after = controller.decide(controller.decide(now, behind, LOWEST), behind, LOWEST)
        assert (after == SWING).any()


def test_rows_of_legs_do_not_see_each_other():
    rows = np.stack([states(WAIT, WAIT), states(WAIT, (WAIT, DROP, DROP))])
    felt = HexapodReading(*(np.stack([part, part]) for part in feeling(vertical=20.0)))
    expected = np.stack([states(SWING, SWING), states(WAIT, (SWING, DROP, DROP))])
    np.testing.assert_array_equal(TripodController().decide(rows, felt, LOWEST), expected)


def test_states_set_the_velocities():
    now = np.array([STANCE, WAIT, SWING, DROP, STANCE, DROP])
    lateral, vertical = np.split(TripodController().velocities(now), 2)
    np.testing.assert_array_equal(lateral, [-3, 0, 6, 0, -3, 0])
    np.testing.assert_array_equal(vertical, [-1, -1, 6, -6, -1, -6])


def test_begins_with_one_tripod_in_stance():
    np.testing.assert_array_equal(TripodController().begin(feeling()), states(STANCE, SWING))


def test_jax_and_numpy_decide_alike():
    rng, controller = np.random.default_rng(0), TripodController()
    now = rng.integers(0, 4, (50, 6))
    felt = HexapodReading(
        *(rng.uniform(-1, 1, (50, 6)).astype(np.float32) for _ in range(4)), rng.random((50, 6)).astype(np.float32),
        *[np.zeros(50)] * 6,
    )  # fmt: skip

    @jax.jit
    def compiled(now, felt):
        after = controller.decide(now, felt, jnp.asarray(LOWEST))
        return after, controller.velocities(after)

    after = controller.decide(now, felt, LOWEST)
    assert len(np.unique(after)) == 4
    again, velocities = compiled(now, felt)
    np.testing.assert_array_equal(again, after)
    np.testing.assert_allclose(velocities, controller.velocities(after))


def test_walks_in_a_tripod_gait():
    """Near the values of the body that the numbers come from: .505 m/s, 2 Hz, duty .44, tripods half a cycle apart."""
    found = walk(SERVOS, seconds=10.0)
    gait = found.gait()
    assert gait.kind[0] == "tripod"
    assert gait.speed[0] == pytest.approx(0.505, abs=0.05)
    assert gait.net[0] == pytest.approx(0.505, abs=0.06)
    assert gait.speed[0] / SERVOS.length == pytest.approx(0.68, abs=0.06)
    assert gait.frequency[0] == pytest.approx(2.0, abs=0.1)
    assert gait.duty[0] == pytest.approx(0.44, abs=0.04)
    assert gait.phase[0] > 0.45
    assert gait.correlation[0] < -0.8
    assert not found.reading.belly[found.time > 2.0].any()
    # each leg goes round its four states in their order
    for leg in range(6):
        path = found.states[:, 0, leg]
        changes = path[1:][path[1:] != path[:-1]], path[:-1][path[1:] != path[:-1]]
        assert len(changes[0]) > 60
        np.testing.assert_array_equal(changes[0], (changes[1] + 1) % 4)


@pytest.mark.ci
def test_walks_over_bumps_of_16_cm_and_deadlocks_there_as_the_source_words_it():
    grounds = [OnTerrain(SERVOS, Terrain("bumps", height=0.16, seed=seed)) for seed in range(4)]
    mended = walk(grounds, seconds=20.0)
    assert not mended.diverged.any()
    assert mended.gait().net.min() > 0.4
    worded = walk(grounds, TripodController(mended=False), seconds=20.0)
    stuck = worded.gait(since=17.0).net < 0.03
    assert stuck.any()
    # one tripod waits, as two legs of the other never reach the ground
    last = worded.states[worded.time > 18.0][:, stuck]
    hang = [(last[..., tripod] == DROP).sum(-1) >= 2 for tripod in (FIRST, SECOND)]
    assert np.any(hang, axis=0).all()


@pytest.mark.ci
def test_the_biomimetic_body_walks_too():
    gait = walk(biomimetic_hexapod("servos"), seconds=8.0).gait()
    assert gait.kind[0] == "tripod"
    assert gait.net[0] > 0.4


def test_one_by_one_and_in_a_batch_they_walk_alike():
    grounds = [OnTerrain(SERVOS, Terrain(kind, height=0.1, seed=1)) for kind in ("bumps", "waves")]
    together, again = walk(grounds, seconds=1.0), walk(grounds, seconds=1.0, threads=1)
    np.testing.assert_array_equal(together.posture, again.posture)
    for row, ground in enumerate(grounds):
        alone = walk(ground, seconds=1.0)
        np.testing.assert_array_equal(alone.posture[:, 0], together.posture[:, row])
        np.testing.assert_array_equal(alone.states[:, 0], together.states[:, row])


def test_a_body_that_diverged_begins_again():
    sick = dataclasses.replace(SERVOS, timestep=0.2)
    found = walk(sick, seconds=60.0, substeps=1)
    assert found.diverged[0] > 0
    assert np.isfinite(found.posture).all()


def test_a_walk_is_what_its_commands_say():
    """The recorded states, sent again as velocities, move the body in the same way."""
    found = walk(SERVOS, seconds=2.0)
    batch, controller = BodyBatch(SERVOS, 1, substeps=4), TripodController()
    for moment in range(len(found.time)):
        batch.step(controller.velocities(found.states[moment]))
        np.testing.assert_array_equal(batch.unpack(batch.packed).position, found.posture[moment])
    np.testing.assert_array_equal(read_hexapod(batch.unpack(batch.packed)).lateral, found.reading.lateral[-1])


def synthetic(shift, frequency=2.0, speed=1.0, duty=0.4, period=0.01, seconds=6.0, lag=0.0):
    """A made-up walk, one seed: the second tripod a part `shift` of a cycle behind the first."""
    time = period * np.arange(round(seconds / period))
    cycle = frequency * time[:, None, None] - np.where(np.isin(np.arange(6), SECOND), shift, 0.0)
    lateral = 0.3 * np.sin(2 * np.pi * (cycle - lag))
    contact = 9.0 * (cycle % 1.0 < duty)
    position = np.stack([speed * time, 0 * time, 0 * time], -1)[:, None]
    zero = np.zeros((len(time), 1))
    six = np.zeros_like(lateral)
    return HexapodReading(lateral, six, six, six, contact, zero, position, zero, zero, zero + speed, zero + 1), period


@pytest.mark.parametrize(
    ("shift", "speed", "kind"),
    [(0.5, 1.0, "tripod"), (0.42, 1.0, "tripod"), (0.0, 1.0, "pronk"), (0.1, 1.0, "pronk"), (0.25, 1.0, "intermediate"),
     (0.5, 0.02, "stalled")],
)  # fmt: skip
def test_gaits_of_known_phase_are_measured(shift, speed, kind):
    for sign in (1, -1):
        gait = measure_gait(*synthetic(sign * shift, frequency=1.87, speed=speed))
        assert gait.phase[0] == pytest.approx(shift, abs=5e-3)
        assert gait.frequency[0] == pytest.approx(1.87, abs=0.02)
        assert gait.duty[0] == pytest.approx(0.4, abs=0.02)
        assert gait.correlation[0] == pytest.approx(np.cos(2 * np.pi * shift), abs=0.05)
        assert gait.speed[0] == pytest.approx(speed)
        assert gait.net[0] == pytest.approx(speed)
        assert gait.kind[0] == kind


def test_a_standing_body_is_stalled():
    reading, period = synthetic(0.0, speed=0.0)
    gait = measure_gait(reading._replace(lateral=np.zeros_like(reading.lateral)), period)
    assert gait.kind[0] == "stalled"
    assert np.isnan([gait.phase[0], gait.correlation[0], gait.frequency[0]]).all()


def test_of_one_tripod_that_moves_only_the_frequency_is_known():
    reading, period = synthetic(0.5, frequency=1.87)
    still = reading.lateral.copy()
    still[..., [LEGS.index(leg) for leg in TRIPODS[1]]] = 0.1
    gait = measure_gait(reading._replace(lateral=still), period)
    assert gait.kind[0] == "intermediate"
    assert np.isnan([gait.phase[0], gait.correlation[0]]).all()
    assert gait.frequency[0] == pytest.approx(1.87, abs=0.02)


@pytest.mark.parametrize(("shift", "correlation"), [(0.0, 1.0), (0.5, -2 / 3), (0.4, -2 / 3), (0.1, 7 / 12)])
def test_the_contacts_of_the_tripods_are_correlated(shift, correlation):
    # on the ground for 0.4 of a cycle, both for `both` of it: (both − 0.16)/(0.4 · 0.6)
    assert correlation == pytest.approx((max(0.4 - shift, 0) - 0.16) / 0.24)
    gait = measure_gait(*synthetic(shift, duty=0.4))
    assert gait.contact_correlation[0] == pytest.approx(correlation, abs=0.02)


@pytest.mark.parametrize("force", [0.0, 9.0])
def test_contacts_that_never_change_have_no_correlation(force):
    reading, period = synthetic(0.5)
    gait = measure_gait(reading._replace(contact=np.full_like(reading.contact, force)), period)
    assert np.isnan(gait.contact_correlation[0])


def test_short_touches_and_gaps_do_not_count():
    touch = np.zeros((60, 1), bool)
    touch[10] = touch[30:50] = True
    touch[40] = False
    found = debounced(touch, 0.01)
    assert not found[:28].any()
    assert found[30:50].all()
    assert not found[52:].any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"back": 30.0}, "back = 30.0"),
        ({"stance": 0.0}, "stance = 0.0"),
        ({"press": -1.0}, "press = -1.0"),
        ({"margin": float("nan")}, "margin = nan"),
    ],
)
def test_bad_numbers_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        TripodController(**changes)


def test_only_servos_can_be_walked():
    with pytest.raises(ValueError, match="actuators of the body"):
        walk(Hexapod())
    with pytest.raises(ValueError, match="seconds = 0"):
        walk(SERVOS, seconds=0.0)
    reading, period = synthetic(0.5)
    short = HexapodReading(*(part[:3] for part in reading))
    with pytest.raises(ValueError, match=r"reading.lateral.shape = \(3, 1, 6\)"):
        measure_gait(short, period)
