"""Batched stepping: determinism, snapshots, divergence."""

import pickle

import jax
import numpy as np
import pytest
from mujoco.batch import SimulationError

from motorgrad.bodies import BodyBatch, Hopper

DECISIONS = 60


def actions(seeds, decisions=DECISIONS):
    return np.random.default_rng(1).random((decisions, seeds, 2)).round()


def run(batch, sequence):
    """Every packed array along the way."""
    out = []
    for action in sequence:
        batch.step(action)
        out.append(batch.packed.copy())
    return np.array(out)


def test_threads_and_the_number_of_seeds_change_nothing():
    sequence = actions(7)
    one = run(BodyBatch(Hopper(), 7, threads=1), sequence)
    np.testing.assert_array_equal(run(BodyBatch(Hopper(), 7, threads=3), sequence), one)
    np.testing.assert_array_equal(run(BodyBatch(Hopper(), 3), sequence[:, :3]), one[:, :3])
    assert len(np.unique(one[-1], axis=0)) == 7


def test_substeps_add_up():
    coarse, fine = BodyBatch(Hopper(), 2, substeps=10), BodyBatch(Hopper(), 2, substeps=5)
    assert coarse.period == pytest.approx(0.01)
    for action in actions(2, 20):
        coarse.step(action)
        fine.step(action)
        fine.step(action)
    np.testing.assert_array_equal(coarse.packed, fine.packed)


def test_sensors_are_current():
    batch = BodyBatch(Hopper(), 3)
    run(batch, actions(3))
    state = batch.unpack(batch.packed)
    np.testing.assert_array_equal(state.sensors["knee_angle"], state.position[:, 2])
    np.testing.assert_array_equal(state.sensors["knee_velocity"], state.velocity[:, 2])
    np.testing.assert_allclose(
        state.sensors["load_height"], state.position[:, 0] + 0.5 * np.sin(np.pi / 4) + 0.03, atol=1e-6
    )


def test_a_wrong_sensor_name_is_told_with_the_nearest():
    batch = BodyBatch(Hopper(), 2)
    sensors = batch.unpack(batch.packed).sensors
    told = "unknown sensor 'foot_hight': did you mean 'foot_height'[?] known are foot_contact, foot_height"
    with pytest.raises(ValueError, match=told):
        sensors["foot_hight"]
    with pytest.raises(ValueError, match=told):
        jax.jit(lambda packed: batch.unpack(packed).sensors["foot_hight"])(batch.packed)
    with pytest.raises(ValueError, match=told):
        jax.tree.map(np.square, sensors)["foot_hight"]
    assert "foot_hight" not in sensors
    assert sensors.get("foot_hight") is None


def test_sensors_are_a_tree_as_a_dict_is():
    batch = BodyBatch(Hopper(), 2)
    sensors = batch.unpack(batch.packed).sensors
    plain = dict(sensors)
    assert [jax.tree_util.keystr(path) for path, _ in jax.tree.leaves_with_path(sensors)] == [
        jax.tree_util.keystr(path) for path, _ in jax.tree.leaves_with_path(plain)
    ]
    jax.tree.map(np.testing.assert_array_equal, jax.tree.leaves(sensors), jax.tree.leaves(plain))
    assert pickle.loads(pickle.dumps(sensors)).keys() == sensors.keys()


@pytest.mark.parametrize(
    ("components", "told"),
    [
        ({"foot_hight": 2}, "unknown sensor in sensor_components 'foot_hight': did you mean 'foot_height'"),
        ({"foot_height": 3}, "sensor_components\\['foot_height'\\] = 3: must be an integer from 0 to 2"),
    ],
)
def test_components_of_sensors_that_a_body_lacks_are_refused(monkeypatch, components, told):
    monkeypatch.setattr(Hopper, "sensor_components", components)
    with pytest.raises(ValueError, match=told):
        BodyBatch(Hopper(), 1)


def test_unpack_is_slicing_and_works_under_jit():
    batch = BodyBatch(Hopper(), 4)
    run(batch, actions(4, 5))
    plain = batch.unpack(batch.packed)
    assert plain.position.shape == (4, 6)
    assert plain.velocity.shape == (4, 6)
    assert {name: value.shape for name, value in plain.sensors.items()} == dict.fromkeys(
        ("knee_angle", "knee_velocity", "foot_height", "foot_contact", "load_height"), (4,)
    )
    assert np.shares_memory(plain.position, batch.packed)
    traced = jax.jit(batch.unpack)(batch.packed.copy())
    jax.tree.map(np.testing.assert_array_equal, tuple(traced), tuple(plain))
    assert batch.unpack(np.zeros((2, 3, batch.packed.shape[1]))).velocity.shape == (2, 3, 6)
    with pytest.raises(ValueError, match=r"packed\.shape"):
        batch.unpack(np.zeros((4, 3)))


def test_packed_is_one_contiguous_array():
    batch = BodyBatch(Hopper(), 3)
    before = batch.packed
    batch.step(np.ones((3, 2)))
    assert batch.packed is before
    assert before.dtype == np.float32
    assert before.flags.c_contiguous
    assert before.flags.owndata


@pytest.mark.ci
@pytest.mark.representatives("0-native", "25-thesis")
@pytest.mark.parametrize("muscle_model", ["thesis", "native"])
@pytest.mark.parametrize("at", [0, 1, 25])
def test_continuing_after_restore_changes_no_bit(at, muscle_model):
    sequence, body = actions(5), Hopper(muscle_model=muscle_model)
    batch = BodyBatch(body, 5)
    run(batch, sequence[:at])
    saved = batch.snapshot()
    frozen = {name: value.copy() for name, value in saved.items()}
    rest = run(batch, sequence[at:])
    np.testing.assert_array_equal(saved["state"], frozen["state"])  # a copy, not a view
    batch.restore(saved)
    np.testing.assert_array_equal(batch.packed, saved["packed"])
    np.testing.assert_array_equal(run(batch, sequence[at:]), rest)
    fresh = BodyBatch(body, 5, threads=2)
    run(fresh, sequence[:3])
    fresh.restore(saved)
    np.testing.assert_array_equal(run(fresh, sequence[at:]), rest)


def test_restore_refuses_another_shape():
    saved = BodyBatch(Hopper(), 3).snapshot()
    with pytest.raises(ValueError, match=r"snapshot\['state'\].shape"):
        BodyBatch(Hopper(), 2).restore(saved)
    with pytest.raises(ValueError, match="snapshot = "):
        BodyBatch(Hopper(), 3).restore({"state": saved["state"]})


@pytest.mark.ci
@pytest.mark.representatives("column_value0", "column_value3")
@pytest.mark.parametrize("column_value", [("qpos", np.nan), ("qvel", np.inf), ("qvel", 1e12), ("ctrl", np.nan)])
def test_divergence_is_flagged_counted_and_harms_no_other_seed(column_value):
    column, value = column_value
    sequence = actions(5)
    healthy, hurt = BodyBatch(Hopper(), 5), BodyBatch(Hopper(), 5)
    start = healthy.packed[0].copy()
    for i, action in enumerate(sequence):
        healthy.step(action)
        if i == 20:
            if column == "ctrl":
                action = action.copy()
                action[2] = value
            else:
                hurt._batch.bind(column)[2] = value
        hurt.step(action)
        others = [0, 1, 3, 4]
        np.testing.assert_array_equal(hurt.packed[others], healthy.packed[others])
        assert hurt.packed[2, -1] == (i == 20)
        assert np.isfinite(hurt.packed).all()
        if i == 20:
            np.testing.assert_array_equal(hurt.packed[2, :-1], start[:-1])
    np.testing.assert_array_equal(hurt.diverged, [0, 0, 1, 0, 0])
    np.testing.assert_array_equal(healthy.diverged, 0)
    # a seed that diverged goes on as a fresh one does
    fresh = BodyBatch(Hopper(), 1)
    np.testing.assert_array_equal(run(fresh, sequence[21:, 2:3])[-1, 0], hurt.packed[2])


def test_an_error_raised_by_mujoco_counts_as_divergence(monkeypatch):
    batch, healthy = BodyBatch(Hopper(), 3), BodyBatch(Hopper(), 3)
    start = batch.packed.copy()
    sequence = actions(3, 5)
    run(batch, sequence)
    real = batch._batch.step

    def step(*arguments):
        real(*arguments)
        raise SimulationError(np.array([1]), "arena is full")

    with monkeypatch.context() as patched:
        patched.setattr(batch._batch, "step", step)
        batch.step(sequence[0])
    np.testing.assert_array_equal(batch.packed[:, -1], [0, 1, 0])
    np.testing.assert_array_equal(batch.packed[1, :-1], start[1, :-1])
    np.testing.assert_array_equal(batch.diverged, [0, 1, 0])
    run(healthy, [*sequence, sequence[0]])
    np.testing.assert_array_equal(batch.packed[[0, 2]], healthy.packed[[0, 2]])


def test_reset_of_some_rows():
    batch = BodyBatch(Hopper(), 4)
    start = batch.packed.copy()
    sequence = actions(4, 10)
    run(batch, sequence)
    moved = batch.packed.copy()
    batch.reset(np.array([2, 0]))
    np.testing.assert_array_equal(batch.packed[[0, 2]], start[[0, 2]])
    np.testing.assert_array_equal(batch.packed[[1, 3]], moved[[1, 3]])
    batch.reset(np.array([False, True, False, False]))
    np.testing.assert_array_equal(batch.packed[1], start[1])
    batch.reset(np.array([], int))
    batch.reset()
    np.testing.assert_array_equal(batch.packed, start)
    np.testing.assert_array_equal(run(batch, sequence)[-1], moved)
    for rows in ([4], [-1], [0.5]):
        with pytest.raises(ValueError, match="rows"):
            batch.reset(np.array(rows))


@pytest.mark.parametrize("shape", [(2,), (3, 4), (2, 2), (3, 1)])
def test_activation_of_wrong_shape_is_refused(shape):
    batch = BodyBatch(Hopper(), 3)
    with pytest.raises(ValueError, match=r"control.shape = .*\(seeds, groups\) = \(3, 2\)"):
        batch.step(np.zeros(shape))


@pytest.mark.parametrize(
    "changes", [{"seeds": 0}, {"seeds": 1.5}, {"seeds": 1, "substeps": 0}, {"seeds": 1, "threads": -1}]
)
def test_bad_sizes_are_refused(changes):
    with pytest.raises(ValueError, match="must be an integer"):
        BodyBatch(Hopper(), **changes)
