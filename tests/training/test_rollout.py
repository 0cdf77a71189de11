"""Rollouts: every value is of its moment, and all that happens is what `evaluate` sees."""

import dataclasses
import json

import gymnasium
import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest
from pyarrow import csv

import motorgrad as mg
from motorgrad.tasks import Composed
from motorgrad.training.rollouts._rows import Rows
from timsim import read_motion

LIGHT = {"estimator": "olgarb", "metric": None, "averaging": None}  # a learner that is compiled quickly
ARM = dataclasses.replace(Composed(), time_limit=0.1, action_period=0.01, actions="binary")


@pytest.fixture(scope="module")
def arm():
    return mg.train(ARM, LIGHT, steps=40, seeds=2, window=20, progress=False)


@pytest.fixture(scope="module")
def steps(arm):
    """Twelve decisions at every physics step: an episode of ten, and the beginning of the next."""
    return mg.rollout(arm, steps=12, every="step")


@pytest.fixture(scope="module")
def maze():
    return mg.train("t-maze", steps=400, seeds=3, window=100, progress=False)


def test_rows_are_the_moments_of_decisions_and_the_ends_of_episodes():
    rows = Rows(np.array([False, True, False]), readings=2)
    moments = rows.moments(period=0.1, step=0.05)
    # an episode of two decisions with two readings each and its end, then one decision and the end of the rollout
    assert moments["episode"].tolist() == [0, 0, 0, 0, 0, 1, 1, 1]
    assert moments["decision"].tolist() == [0, 0, 1, 1, 2, 0, 0, 1]
    np.testing.assert_allclose(moments["time"], [0, 0.05, 0.1, 0.15, 0.2, 0, 0.05, 0.1])
    nan = np.nan
    np.testing.assert_array_equal(rows.starting(np.array([1.0, 2, 3])), [1, nan, 2, nan, nan, 3, nan, nan])
    np.testing.assert_array_equal(
        rows.starting(np.array([1.0, 2, 3]), np.array([7.0, 8, 9])), [1, nan, 2, nan, 8, 3, nan, 9]
    )
    np.testing.assert_array_equal(rows.led(np.array([4.0, 5, 6])), [nan, nan, 4, nan, 5, nan, nan, 6])
    assert rows.led(np.array([True, True, True])).tolist() == [False, False, True, False, True, False, False, True]
    read = np.array([[[1.0], [2]], [[3], [4]], [[5], [6]]])
    np.testing.assert_array_equal(rows.read(read, np.array([[8.0], [9]]))[:, 0], [1, 2, 3, 4, 8, 5, 6, 9])


def test_every_value_of_a_body_is_of_its_time(steps):
    """From the first row on, MuJoCo alone, with the controls of the table, makes all the others."""
    table = steps.of(seed=1, episode=0)
    model = mg.bodies.compile_model(ARM.dynamics)
    data, read = mujoco.MjData(model), mujoco.MjData(model)
    data.qpos[:] = table["joint angle"][0]
    names = [model.actuator(i).name for i in range(model.nu)]
    assert table.names("muscle force") == names
    period, substeps = model.opt.timestep, ARM.substeps
    np.testing.assert_allclose(table["time"], period * np.arange(10 * substeps + 1), atol=1e-12)
    for row in range(len(table)):
        data.ctrl[:] = table["muscle control"][row]
        mujoco.mj_copyData(read, model, data)
        mujoco.mj_forward(model, read)
        for family, wanted in {
            "joint angle": read.qpos,
            "joint velocity": read.qvel,
            "joint torque": read.qfrc_actuator,
            "muscle length": read.actuator_length,
            "muscle velocity": read.actuator_velocity,
            "muscle force": -read.actuator_force,
            "muscle activation": read.act,
        }.items():
            np.testing.assert_allclose(table[family][row], wanted, rtol=1e-9, atol=1e-12, err_msg=f"{family} {row}")
        mujoco.mj_step(model, data)


def test_a_decision_has_its_observation_and_its_action_and_a_moment_its_reward(steps):
    table = steps.of(seed=0)
    starts = np.isfinite(table["action"]).all(axis=1)
    assert starts.sum() == 12
    at = np.isfinite(table["observation"]).all(axis=1)
    assert at.sum() == 12 + 2  # and at the ends of both episodes
    # what is observed are the angles and velocities of the same row, which the engine has in single precision
    observed = np.column_stack([table[f"observation: {name}"][at] for name in ("shoulder", "elbow", "elbow velocity")])
    moved = np.column_stack([*table["joint angle"][at].T, table["joint velocity: elbow"][at]])
    np.testing.assert_allclose(observed, moved, rtol=1e-5, atol=1e-6)
    # the controls of a decision are its action, until the next
    np.testing.assert_array_equal(table["muscle control"][starts], table["action"][starts])
    np.testing.assert_array_equal(table["muscle control"][:-1][starts[:-1]], table["muscle control"][1:][starts[:-1]])
    # the first reward comes with the end of the first decision
    rewarded = np.flatnonzero(np.isfinite(table["reward"]))
    assert rewarded[0] == ARM.substeps
    np.testing.assert_allclose(table["time"][rewarded[:10]], 0.01 * np.arange(1, 11))
    assert table["truncated"].sum() == 1
    assert table["truncated"][rewarded[9]]
    hand = table["sensor"][rewarded]
    aim = table["mark"][rewarded]
    np.testing.assert_allclose(table["metric: distance"][rewarded], np.linalg.norm(hand - aim, axis=1), rtol=1e-4)


def test_terms_make_up_the_reward(steps):
    terms = steps["reward: distance"] + steps["reward: closeness"] + steps["reward: effort"]
    np.testing.assert_allclose(steps["reward"], terms, rtol=1e-6, atol=1e-7)
    assert steps.names("reward") == ["distance", "closeness", "effort"]
    known = np.isfinite(steps["reward"])
    np.testing.assert_allclose(steps["reward: distance"][known], -steps["metric: distance"][known], rtol=1e-6)


def test_physics_steps_and_decisions_tell_the_same(arm, steps):
    decisions = mg.rollout(arm, steps=12)
    at = np.isfinite(steps["observation"]).all(axis=1)
    assert decisions.columns == steps.columns
    assert at.sum() == len(decisions) == 2 * 14
    np.testing.assert_array_equal(decisions.to_numpy(), steps.to_numpy()[at])
    np.testing.assert_array_equal(mg.rollout(arm, seconds=0.115).to_numpy(), decisions.to_numpy())  # rounded up


@pytest.mark.parametrize("mode", ["sample", pytest.param("mode", marks=pytest.mark.ci)])
def test_rewards_are_those_of_an_evaluation(arm, maze, mode):
    for run, count in ((arm, 12), (maze, 150)):
        found = mg.evaluate(run, count, mode=mode)
        table = mg.rollout(run, steps=count, mode=mode)
        for row, seed in enumerate(run.seeds):
            mean = np.nansum(table.of(seed=seed)["reward"], dtype=float) / count
            assert mean == pytest.approx(found.reward[row], rel=1e-5)
    last = [table.of(seed=seed)["observation"][-1] for seed in run.seeds]
    assert np.shape(last) == (3, maze.task.observation_size)


@pytest.mark.ci
def test_episodes_are_those_of_an_evaluation(arm):
    found = mg.evaluate(arm, episodes=2, seed=3)
    table = mg.rollout(arm, episodes=2, seed=3)
    assert table.episodes() == [(seed, episode) for seed in arm.seeds for episode in range(2)]
    for seed, episode in table.episodes():
        part = table.of(seed=seed, episode=episode)
        assert len(part) == found.lengths[seed, episode] + 1 == 11
        assert np.nansum(part["reward"], dtype=float) == pytest.approx(found.returns[seed, episode], rel=1e-5)
        assert part["truncated"].tolist() == [False] * 10 + [True]
        np.testing.assert_array_equal(part["decision"], np.arange(11))


BASELINE = {"baseline": {"kind": "linear", "rate": 0.01}}


@pytest.fixture(scope="module")
def ring():
    return mg.train("three-state", BASELINE, steps=200, seeds=3, window=100, progress=False)


def test_the_value_is_that_of_the_learner(ring):
    table = mg.rollout(ring, steps=40)
    for row, seed in enumerate(ring.seeds):
        part = table.of(seed=seed)
        slope, level = np.split(ring.critic["weights"][row], [-1])
        acting = np.isfinite(part["action"]).reshape(len(part), -1).all(axis=1)
        wanted = part["observation"][acting] @ slope + level
        np.testing.assert_allclose(part["value"][acting], wanted, rtol=1e-5, atol=1e-6)
        assert np.isnan(part["value"][~acting]).all()  # of the next reward, and there is none
    assert "value" not in mg.rollout(ring, steps=4, untrained=True).columns


def test_a_stored_run_tells_the_same(ring, tmp_path):
    mg.train("three-state", BASELINE, steps=200, seeds=3, window=100, out=tmp_path / "run", progress=False)
    loaded = mg.rollout(tmp_path / "run", steps=40)
    np.testing.assert_array_equal(loaded.to_numpy(), mg.rollout(ring, steps=40).to_numpy())


def test_the_states_of_a_world_are_its_own(ring):
    table = mg.rollout(ring, steps=60)
    assert table.names("state") == ["number"]
    assert set(table["state: number"]) <= {0, 1, 2}
    # the task shows each state by one observation, at the same moment
    for state in range(3):
        assert len(np.unique(table["observation"][table["state: number"] == state], axis=0)) <= 1
    assert len(np.unique(table["observation"], axis=0)) == len(set(table["state: number"])) > 1


@pytest.fixture(scope="module")
def pendulum():
    task = mg.tasks.from_gymnasium("InvertedPendulum-v5")
    return mg.rollout(task, LIGHT, steps=30, seeds=[4])


def test_an_environment_is_recorded_as_it_is(pendulum):
    """Gymnasium alone, with the controls of the table, gives the same observations, rewards, positions and info."""
    environment = gymnasium.make("InvertedPendulum-v5")
    first = pendulum.of(episode=0)
    seed = (4 + 1_000_000_000) % 2**31
    seen = [environment.reset(seed=seed)[0]]
    inner, told, rewards = environment.unwrapped, [], []
    moved = [np.concatenate([inner.data.qpos, inner.data.qvel])]
    for action in first["control"][:-1]:
        observation, reward, terminated, _, info = environment.step(np.array([action], np.float32))
        seen.append(observation)
        rewards.append(reward)
        told.append(info["reward_survive"])
        moved.append(np.concatenate([inner.data.qpos, inner.data.qvel]))
    assert first["terminated"][-1] == terminated
    np.testing.assert_allclose(first["observation"], seen, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(
        np.column_stack([first["joint position"], first["joint angle"]]), np.array(moved)[:, :2]
    )
    np.testing.assert_array_equal(first["joint velocity"], np.array(moved)[:, 2:])
    np.testing.assert_allclose(first["reward"][1:], rewards)
    np.testing.assert_allclose(first["info: reward_survive"][1:], told)
    assert np.isnan(first["control"][-1])
    np.testing.assert_allclose(first["time"], 0.04 * np.arange(len(first)))


@pytest.mark.ci
def test_a_policy_acts_for_all_seeds(ring):
    table = mg.rollout("three-state", ring.policy(1), steps=30, seeds=[1])
    np.testing.assert_array_equal(table["action"], mg.rollout(ring, steps=30, seeds=[1])["action"])


def test_demonstrations_are_the_decisions_with_what_was_seen(steps, maze):
    table = mg.rollout(maze, steps=50)
    shown = table.demonstrations()
    assert len(shown) == 3 * 50
    acted = np.isfinite(table["action"])
    np.testing.assert_array_equal(shown.actions, table["action"][acted])
    assert np.issubdtype(shown.actions.dtype, np.integer)
    np.testing.assert_array_equal(shown.observations, table["observation"][acted])
    lengths = [np.isfinite(table.of(*each)["action"]).sum() for each in table.episodes()]
    assert [len(seen) for seen, _ in shown.by_episode()] == lengths
    shown = steps.demonstrations()  # of two seeds; of the physics' steps those in which it decides
    assert shown.actions.shape == (24, len(steps.names("action")))
    np.testing.assert_array_equal(np.bincount(shown.episodes), [10, 2, 10, 2])
    family = "input" if any(name.startswith("input: ") for name in steps.columns) else "observation"
    assert shown.observations.shape == (24, len(steps.names(family)))
    assert np.isfinite(shown.observations).all()


def test_files_give_back_the_same_numbers(steps, tmp_path):
    table = steps.of(seed=1, episode=0)
    table.save(tmp_path / "new" / "reach.parquet")
    stored = pq.read_table(tmp_path / "new" / "reach.parquet")
    assert stored.schema.equals(table.arrow.schema, check_metadata=True)
    for name in table.columns:
        np.testing.assert_array_equal(stored[name].to_numpy(), table[name])
    assert stored.schema.field("muscle force: elbow flexor").metadata == {b"unit": b"N"}
    assert stored.schema.metadata[b"task"] == b"composed"
    table.save(tmp_path / "reach.csv")
    text = csv.read_csv(tmp_path / "reach.csv")
    assert text.column_names == table.columns
    numbers = np.column_stack([np.asarray(text[name].to_numpy(), float) for name in text.column_names])
    np.testing.assert_array_equal(numbers, table.to_numpy())
    assert not list(tmp_path.glob(".*"))


def opensim_table(path):
    """A table as OpenSim reads it: keys with values, then named columns between tabs, of which time is the first."""
    head, _, body = path.read_text().partition("\nendheader\n")
    keys = dict(line.rsplit("=", 1) for line in head.splitlines() if "=" in line)
    names, *rows = [line.split("\t") for line in body.splitlines()]
    assert names[0] == "time"
    return keys, names, np.array([[float(word) for word in row] for row in rows])


def test_opensim_reads_an_episode(steps, tmp_path):
    table = steps.of(seed=1, episode=0)
    path = table.save(tmp_path / "reach.sto")
    keys, names, numbers = opensim_table(path)
    assert (keys["DataType"], keys["inDegrees"], keys["seed"]) == ("double", "no", "1")
    assert (int(keys["nRows"]), int(keys["nColumns"])) == numbers.shape
    assert np.all(np.diff(numbers[:, 0]) > 0)
    units = json.loads(keys["units"])
    assert (units["time"], units["muscle force: elbow flexor"]) == ("s", "N")
    place = names.index("muscle force: elbow flexor")
    np.testing.assert_array_equal(numbers[:, place], table["muscle force: elbow flexor"])
    model = mg.bodies.compile_model(ARM.dynamics)
    motion = read_motion(path, model, partial=True)
    np.testing.assert_array_equal(motion.position, table["joint angle"])
    np.testing.assert_array_equal(motion.activation, table["muscle activation"])
    np.testing.assert_array_equal(motion.time, table["time"])


def test_opensim_itself_reads_an_episode(steps, tmp_path):
    opensim = pytest.importorskip("opensim")
    table = steps.of(seed=1, episode=0)
    found = opensim.TimeSeriesTable(str(table.save(tmp_path / "reach.sto")))
    column = found.getDependentColumn("muscle force: elbow flexor").to_numpy()
    np.testing.assert_array_equal(column, table["muscle force: elbow flexor"])


@pytest.mark.needs("motorgrad[lab]")
def test_pandas_has_the_same_table(steps):
    frame = steps.to_pandas()
    assert list(frame.columns) == steps.columns
    assert frame.attrs["units"]["joint torque: elbow"] == "N m"
    np.testing.assert_array_equal(frame["reward"].to_numpy(), steps["reward"])
    assert frame.groupby("seed")["reward"].sum()[0] == pytest.approx(np.nansum(steps.of(seed=0)["reward"]))


def test_what_is_wrong_is_named(arm, steps, tmp_path):
    for ask, message in (
        (lambda: steps["muscle force: elbow flexr"], "did you mean 'muscle force: elbow flexor'"),
        (lambda: steps["muscle forces"], "did you mean 'muscle force'"),
        (lambda: steps.names("muscl length"), "did you mean 'muscle length'"),
        (lambda: steps.of(seed=7), "seed = 7: must be one of 0, 1"),
        (lambda: steps.of(episode=5), "episode = 5: must be one of 0, 1"),
        (lambda: steps.save(tmp_path / "a.xlsx"), "ends in .parquet, .csv, .sto"),
        (lambda: steps.save(tmp_path / "a.sto"), "episodes in a .sto file = 4.*table.of"),
        (lambda: mg.rollout(arm), "steps, seconds, episodes = None: must be one of the three"),
        (lambda: mg.rollout(arm, steps=3, seconds=1.0), "one of the three"),
        (lambda: mg.rollout(arm, seconds=-1.0), "seconds = -1.0"),
        (lambda: mg.rollout(arm, steps=3, seeds=[0, 5]), "seeds = 5"),
        (lambda: mg.rollout(arm, steps=3, seeds=np.int64(5)), "seeds = 5"),
        (lambda: mg.rollout(arm, steps=3, seeds=1.5), r"seeds = 1\.5: must be an integer, a sequence or None"),
        (lambda: mg.rollout(arm, steps=3, trust="no"), "trust = 'no': must be True or False"),
        (lambda: mg.rollout(arm, LIGHT, steps=3), "left out for a run"),
        (lambda: mg.rollout(arm, steps=3, every="sec"), "every 'sec'"),
        (lambda: mg.rollout("t-maze", steps=3, every="step"), "has no body"),
        (lambda: mg.rollout("three-state", episodes=3), "give it a limit"),
        (lambda: mg.rollout("three-state", steps=3, untrained=True), "untrained"),
        (lambda: mg.rollout("three-state", steps=2**31 - 1), "4 GiB"),
    ):
        with pytest.raises(ValueError, match=message):
            ask()
    assert not list(tmp_path.iterdir())


@pytest.mark.ci
def test_policies_that_are_not_finite_are_left_out(ring):
    broken = dataclasses.replace(ring, policies=_first_lost(ring.policies))
    with pytest.warns(mg.training.RunWarning, match="seed 0: parameters that are not finite; left out"):
        table = mg.rollout(broken, steps=5)
    assert set(table["seed"]) == {1, 2}


def _first_lost(policies):
    import jax

    def lose(leaf):
        found = np.array(leaf)
        if found.dtype.kind == "f":
            found[0] = np.nan
        return found

    return jax.tree.map(lose, policies)
