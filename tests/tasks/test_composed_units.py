"""Units of what tasks observe, reward and record: from the terms to figures and tables."""

import dataclasses

import jax.numpy as jnp
import pyarrow as pa
import pytest
from composed_examples import BODY, OBSERVE, task

import motorgrad as mg
from motorgrad.tasks import TASKS, compose, make, terms
from motorgrad.training.plots import curve_of

POSE = terms.Pose(("shoulder", "elbow"), at=(0.1, 0.2), name="pose")
TARGETS = (terms.Reach("hand", at=(0.3, 0.0, 0.8)), POSE)


def test_every_observed_number_has_its_unit():
    made = task(
        observe=(
            *OBSERVE,
            terms.TargetError(),
            terms.TargetPosition("pose"),
            terms.Clock(2.0),
            terms.JointPositions("ball"),
        ),
        targets=TARGETS,
    )
    assert made.observation_units == (
        *("rad", "rad"),
        *("", ""),  # velocities, scaled
        *("m", "rad", "rad"),  # lengths: of a tendon, and of what drives a joint
        "m/s",
        *("N", "N m", "N m"),
        "1",
        *("m",) * 6,
        *("m/s",) * 3,
        *("rad/s",) * 3,
        "N",
        *("",) * 3,  # controls of other actuators than muscles
        "s",
        "m",
        *("m",) * 3,
        *("rad", "rad"),
        *("1", "1"),
        *("m",) * 3,
        *("1",) * 4,  # a quaternion
    )
    assert len(made.observation_units) == len(made.observation_names)
    assert made.input_units == made.observation_units


@pytest.mark.parametrize(
    ("term", "unit"),
    [
        (terms.Distance(), "m"),
        (terms.Distance("pose"), "rad"),
        (terms.Distance(power=2), "m²"),
        (terms.Distance(power=0.5), ""),
        (terms.Closeness(), "1"),
        (terms.Within(), "1"),
        (terms.Beyond("pose"), "1"),
        (terms.Success(), "1"),
        (terms.Height("hand"), "m"),
        (terms.Upright("upper"), "1"),
        (terms.Along("hand"), "m/s"),
        (terms.Speed("hand"), "m/s"),
        (terms.Speed(joints="elbow"), "rad/s"),
        (terms.Speed(), ""),  # a free joint moves in m/s and rad/s
        (terms.Outside("hand"), "1"),
        (terms.Effort(), "1"),
        (terms.Effort("activation", "lift"), "1"),
        (terms.Fatigue("lift"), "1"),
        (terms.Alive(), "1"),
    ],
)
def test_every_quantity_has_its_unit(term, unit):
    made = task(reward=[term], metrics=[term], targets=TARGETS)
    (name,) = made.metric_names
    assert made.metric_units == {name: unit}
    assert made.reward_units == {name: unit}


def test_what_is_scaled_has_a_unit_only_if_it_is_a_pure_number():
    made = task(reward=[terms.Height("hand", weight=0.5), terms.Alive(weight=0.5), terms.Height("ball", weight=-1.0)])
    assert made.reward_units == {"height": "", "alive": "1", "height 2": "m"}
    assert task(observe=[terms.Activations(scale=0.5)]).observation_units == ("1",)
    assert set(task(scaling="running").input_units) == {""}


def test_terms_of_ones_own_may_have_units():
    class Apart(terms.Quantity):
        """How far two parts are from each other."""

        def bind(self, scene):
            one, two = scene.point("hand"), scene.point("ball")
            return terms.Bound(lambda now: jnp.linalg.norm(one(now.state) - two(now.state)), units="m")

    assert task(metrics=[Apart(name="apart")]).metric_units == {"apart": "m"}


def test_units_of_tasks_are_those_of_what_they_report():
    for name in TASKS:
        made = make(name)
        assert made.metric_units.keys() <= set(made.metric_names) | {"success", "solved"}, name
        assert len(made.input_units) == made.observation_size, name
        assert made.reward_units.keys() <= set(made.reward_names), name
    assert make("hopper").observation_units == ("1", "rad", "")
    assert make("hexapod").metric_units == {"speed": "m/s", "falls": "1/s", "net": "m/s", "stalls": "1"}


def test_figures_and_tables_of_a_composed_task_have_the_units_of_its_terms(tmp_path):
    made = compose(
        BODY,
        observe=["joint-positions"],
        reward=[terms.Distance(), terms.Effort(weight=-0.1)],
        targets=TARGETS[:1],
        metrics=["distance", terms.Within(name="solved")],
    )
    agent = {"policy": "graded-hyperplanes", "decay": 0.9, "learning_rate": 0.01}
    run = mg.train(made, agent, steps=20, seeds=1, window=10, out=tmp_path / "run", progress=False)
    labels = ["distance (m)", "solved", "mean reward\nper decision"]
    for each in (run, mg.load(tmp_path / "run")):
        axes = each.plot(["distance", "solved", "reward"], tmp_path / "figure.svg").axes
        assert [one.get_ylabel() for one in axes] == labels
    assert "distance (m)" in (tmp_path / "figure.svg").read_text()
    table = mg.rollout(run, steps=3)
    units = {name: table.units[name] for name in ("observation: elbow", "input: elbow", "metric: distance")}
    assert units == {"observation: elbow": "rad", "input: elbow": "1", "metric: distance": "m"}
    assert (table.units["reward: distance"], table.units["reward: effort"]) == ("m", "1")
    assert mg.evaluate(run, steps=5).records.schema.field("distance").metadata == {b"unit": b"m"}


def test_runs_of_earlier_releases_have_the_units_of_their_task():
    run = mg.train("hopper", steps=20, seeds=1, window=10, progress=False)
    assert curve_of(run, "apex", "decisions", None, "").unit == "m"
    plain = pa.schema([field.remove_metadata() for field in run.metrics.schema])
    run = dataclasses.replace(run, metrics=run.metrics.cast(plain))
    assert curve_of(run, "apex", "decisions", None, "").unit == "m"
    assert curve_of(run, "reward", "decisions", None, "").unit == ""
