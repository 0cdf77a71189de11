"""Presets: learners for any task that scale with the budget and can be changed part by part."""

import inspect
import json
import pickle
from typing import Any

import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import Annealed, FisherMetric, LinearCritic, MeanReward
from motorgrad.schema import kind_of, numbers_of
from motorgrad.tasks import from_gymnasium
from motorgrad.training import PRESETS, agent_from_table, agent_table, check_training
from motorgrad.worlds import oracle


@pytest.mark.parametrize(("steps", "batch", "updates"), [(50, 100, 1), (20_000, 200, 100), (500_000, 1000, 500)])
def test_schedules_scale_with_the_budget(steps, batch, updates):
    agent: Any = mg.presets.natural("hopper", steps)
    estimator, metric, critic = agent.estimator, agent.metric, agent.estimator.baseline
    assert isinstance(metric, FisherMetric)
    assert isinstance(critic, LinearCritic)
    assert isinstance(metric.kl, Annealed)
    assert (estimator.update_every, critic.fit.interval) == (batch, batch)
    assert (metric.kl.steps, agent.averaging.start) == (updates, updates - updates // 8)
    np.testing.assert_allclose(
        [metric.rate, critic.fit.rate, estimator.normalization.rate], [0.1, 0.1, 0.1] / np.array(batch)
    )


@pytest.mark.parametrize(
    ("task", "discount", "decay"),
    [
        (mg.make("particle"), 0.99, 0.94),  # no limit
        (mg.make("three-state", time_limit=100), 0.98, 0.88),
        (mg.make("three-state", time_limit=1), 0.9, 0.4),
        (from_gymnasium("Pendulum-v1"), 0.99, 0.94),
        (from_gymnasium("Pendulum-v1", repeat=2), 0.98, 0.88),
        (from_gymnasium("Pendulum-v1", max_episode_steps=100), 0.98, 0.88),
    ],
)
def test_the_horizon_is_half_an_episode(task, discount, decay):
    numbers = numbers_of(mg.presets.natural(task).hyperparameters)
    found = [numbers["estimator.baseline.discount"], numbers["estimator.trace.decay"]]
    np.testing.assert_allclose(found, [discount, decay])


def test_divergence_and_entropy_go_with_the_number_of_units():
    for task, units in (("three-state", 1), ("chain", 1), ("hopper", mg.make("hopper").action_size)):
        numbers = numbers_of(mg.presets.natural(task).hyperparameters)
        found = [numbers[f"{name}.{at}"] for name in ("metric.kl", "estimator.entropy") for at in ("start", "end")]
        np.testing.assert_allclose(found, [0.05 * units**0.5, 0.005, 0.3, 0])


@pytest.mark.parametrize(
    ("env_id", "policy"),
    [
        ("CartPole-v1", "softmax"),
        ("Pendulum-v1", "bounded-hyperplanes"),
        ("hexapod", "hyperplanes"),
        ("arm-recruitment", "motoneurons"),
    ],
)
def test_the_policy_goes_with_the_actions_or_is_the_tasks_own(env_id, policy):
    task = from_gymnasium(env_id) if "-v" in env_id else mg.make(env_id)
    assert kind_of(mg.presets.natural(task).policy) == policy


def test_small_environments_of_alternatives_have_it_by_themselves_in_proportion_to_the_training():
    task = from_gymnasium("CartPole-v1")
    assert agent_table(mg.agent_for(task)) == agent_table(mg.presets.natural(task))
    found = check_training(task, {"damping": 0.02}, 300).agent  # as `train` makes it
    wanted = mg.presets.natural(task, 300, damping=0.02)
    assert agent_table(found) == agent_table(wanted)


@pytest.mark.ci
def test_a_foreign_environment_is_learned_by_it():
    task = from_gymnasium("CartPole-v1")
    run = mg.train(task, {"damping": 0.02}, steps=300, progress=False)
    assert run.config["agent"] == agent_table(mg.presets.natural(task, 300, damping=0.02))


def test_the_learner_of_24_muscles_has_the_numbers_of_its_study():
    numbers = numbers_of(mg.agent_for("hexapod").hyperparameters)
    wanted = {
        "estimator.trace.decay": 0.9215,
        "estimator.baseline.discount": 0.97,
        "estimator.baseline.fit.rate": 1 / 3200,
        "estimator.normalization.rate": 1 / 1600,
        "estimator.entropy.start": 0.05,
        "metric.rate": 1 / 3200,
        "metric.initial": 0.05,
        "metric.damping": 0.01,
        "metric.kl.start": 0.03,
        "metric.kl.end": 0.003,
        "optimizer.learning_rate": 1.0,
    }
    assert {path: numbers[path] for path in wanted} == wanted
    agent: Any = mg.agent_for("hexapod")
    assert (agent.estimator.update_every, agent.metric.kl.steps, agent.averaging.start) == (160, 1200, 1050)


@pytest.mark.parametrize("name", ["CartPole-v1", "Pendulum-v1", "hexapod"])
def test_a_network_stands_in_place_of_features_under_the_same_units(name):
    task = from_gymnasium(name) if "-v" in name else mg.make(name)
    plain, deep = (agent_table(make(task, 50_000)) for make in (mg.presets.natural, mg.presets.natural_network))
    policy = {key: value for key, value in plain["policy"].items() if key != "features"}
    assert {key: value for key, value in deep["policy"].items() if key != "network"} == policy
    assert deep["policy"]["network"]["hidden"] == [128, 128]
    assert deep["metric"]["kind"] == "conjugate-gradient"
    assert deep["metric"]["memory"] == deep["estimator"]["update_every"] == plain["estimator"]["update_every"]
    assert deep["metric"]["kl"] == plain["metric"]["kl"]
    horizon = min(100, max(10, (task.longest_episode or 200) / 5))
    found = deep["estimator"]["baseline"]["discount"], deep["estimator"]["trace"]["decay"]
    np.testing.assert_allclose(found, [1 - 1 / horizon, 1 - 6 / horizon])


def test_a_policy_without_layers_is_refused_by_name():
    with pytest.raises(ValueError, match="network"):
        mg.presets.natural_network("arm-recruitment")


def test_parts_are_changed_one_by_one():
    task = mg.make("particle")
    own: Any = mg.presets.natural(task)
    changed: Any = mg.presets.natural(task, changes={"metric.damping": 0.5}, baseline="mean")
    assert (changed.metric.damping, type(changed.estimator.baseline)) == (0.5, MeanReward)
    assert jax.tree.leaves(changed.metric.kl) == jax.tree.leaves(own.metric.kl)
    with pytest.raises(ValueError, match="unknown setting of agent 'dampin': did you mean 'damping'"):
        mg.presets.natural(task, dampin=0.5)
    with pytest.raises(ValueError, match="unknown preset 'naturl': did you mean 'natural'"):
        mg.agent_for(task, preset="naturl")


@pytest.mark.ci
def test_the_command_line_scales_and_changes_a_preset(tmp_path):
    words = "train CartPole-v1 --steps 400 --seeds 2 --agent.metric.damping 0.02 --agent.baseline.discount 0.9"
    assert main([*words.split(), "--out", str(tmp_path / "run")]) == 0
    config = mg.load(tmp_path / "run").config
    task = from_gymnasium("CartPole-v1")
    changes = {"metric.damping": 0.02, "baseline.discount": 0.9}
    assert config["agent"] == agent_table(mg.presets.natural(task, 400, changes))
    assert config["task"]["env_id"] == "CartPole-v1"


def test_any_task_takes_a_preset_from_the_command_line(capsys, tmp_path):
    config = tmp_path / "run.toml"
    config.write_text('preset = "natural"\nsteps = 30000\n[task]\nname = "hopper"\n[agent]\nupdate_every = 50\n')
    with pytest.raises(SystemExit) as done:
        main(["train", "--config", str(config), "--agent.baseline.discount", "0.9", "--check"])
    assert done.value.code == 0
    said = capsys.readouterr().out
    for words in ('preset = "natural"', "update_every = 50", "discount = 0.9", "steps = 100", 'kind = "fisher"'):
        assert words in said
    # the options of the policy of continuous actions, which the task's default environment does not have
    words = "train Pendulum-v1 --agent.policy.deviation 0.7 --agent.policy.features.nonlinear 32 --check"
    with pytest.raises(SystemExit) as done:
        main(words.split())
    assert done.value.code == 0
    said = capsys.readouterr().out
    assert "deviation = 0.7" in said
    assert "nonlinear = 32" in said
    assert main(["train", "hopper", "--preset", "naturel"]) == 2
    capsys.readouterr()
    assert main(["train", "CartPol-v1"]) == 2
    assert "env_id = 'CartPol-v1'" in capsys.readouterr().err


EPISODES = {"time_limit": 50}
FITTED = (  # each preset once
    *("continuous-avg", "continuous-sac", "continuous-natural-network", "continuous-stream-ac"),
    *("binary-avg", "discrete-sac"),
    *("binary-intentional-ac", "binary-ppo-short-horizon", "binary-trpo"),
    *("discrete-a2c", "discrete-natural", "discrete-ppo", "discrete-reinforce"),
)


@pytest.mark.ci
@pytest.mark.representatives(*FITTED)
@pytest.mark.parametrize("preset", sorted(PRESETS))
@pytest.mark.parametrize(
    ("make", "policy"),
    [
        (lambda: mg.make("three-state", **EPISODES), "softmax"),
        (lambda: mg.make("call-admission", **EPISODES), "hyperplanes"),
        (lambda: from_gymnasium("Pendulum-v1"), "bounded-hyperplanes"),
    ],
    ids=["discrete", "binary", "continuous"],
)
def test_every_preset_fits_its_kinds_of_action_and_is_saved(preset, make, policy):
    task = make()
    real = mg.agent_for(from_gymnasium("Pendulum-v1"), preset=preset, steps=20_000).needs.actions
    assert real != "any" or preset not in ("avg", "sac", "td3")
    fits = {
        "any": True,
        "differentiable": policy == "bounded-hyperplanes",
        "differentiable or few": policy != "hyperplanes",
    }
    if not fits[real]:
        with pytest.raises(ValueError, match="real-valued actions"):
            mg.agent_for(task, preset=preset, steps=20_000)
        return
    agent = mg.agent_for(task, preset=preset, steps=20_000)
    assert kind_of(agent.policy) == policy
    assert (agent.policy.network is not None) == (preset != "natural")
    assert agent_from_table(task, json.loads(json.dumps(agent_table(agent)))) == agent
    assert agent_table(agent) == agent_table(getattr(mg.presets, preset.replace("-", "_"))(task, 20_000))
    checked = check_training(task, agent, 20_000)
    assert checked.agent is agent


def test_every_preset_is_a_public_function_that_explains_itself():
    assert list(PRESETS) == sorted(PRESETS)
    assert {name.replace("-", "_") for name in PRESETS} == set(mg.presets.__all__) - {"PRESETS", "Choice", "choose"}
    for name in PRESETS:
        function = getattr(mg.presets, name.replace("-", "_"))
        assert list(inspect.signature(function).parameters) == ["task", "steps", "changes", "more"]
        assert "as `natural`" in function.__doc__ or name == "natural"
        assert pickle.loads(pickle.dumps(function)) is function


def test_hidden_layers_stand_before_the_tasks_own_policy_or_another_that_takes_them():
    stride = mg.make("hexapod-stride")
    own = stride.learner_for(1_000)["policy"]
    policy = mg.presets.ppo(stride).policy
    assert (kind_of(policy), policy.deviation) == (own["kind"], own["deviation"])
    with pytest.raises(ValueError, match=r"unknown setting of agent.policy 'network'"):
        mg.presets.ppo("particle")
    chosen = mg.presets.ppo("particle", policy={"kind": "hyperplanes", "network": {"hidden": [32]}}).policy
    assert (kind_of(chosen), chosen.network.hidden) == ("hyperplanes", (32,))


@pytest.mark.parametrize(("steps", "batch"), [(1_000, 256), (20_000, 384), (1_000_000, 2048)])
def test_the_batches_of_ppo_and_trpo_scale_with_the_budget_and_divide_into_minibatches(steps, batch):
    ppo, trpo = (getattr(mg.presets, name)("three-state", steps) for name in ("ppo", "trpo"))
    assert (ppo.update_every, ppo.baseline.fit.interval) == (batch, batch)
    assert (ppo.minibatches, ppo.epochs) == (batch // 64, 10)
    assert (trpo.estimator.update_every, trpo.metric.memory, trpo.metric.kl) == (batch, batch, 0.01)


def test_the_short_horizon_is_a_fifth_of_an_episode():
    long = mg.presets.ppo_short_horizon("three-state", 1_000)
    short = mg.presets.ppo_short_horizon(mg.tasks.from_gymnasium("CartPole-v1"), 1_000)
    for agent, discount in ((long, 1 - 1 / 40), (short, 0.99)):
        assert agent.baseline.discount == agent.reward_scaling.discount == pytest.approx(discount)
        assert (agent.baseline.decay, agent.decay) == pytest.approx((0.9, 0.9 * discount))


def test_reinforce_needs_episodes_and_several_environments_are_refused_for_batches_used_again():
    with pytest.raises(
        ValueError, match=r"estimator\.update_every = 'episode': needs episodes, but the task 'three-state'"
    ):
        check_training("three-state", mg.presets.reinforce("three-state"), 1_000)
    with pytest.raises(ValueError, match=r"envs = 4: must be 1 for batches used again by ProximalPolicyOptimization"):
        check_training("hopper", mg.presets.ppo("hopper", 6_400), 6_400, envs=4)
    with pytest.raises(ValueError, match=r"envs = 4: must be 1 for EpisodicNatural"):
        check_training("hopper", mg.agent_for("hopper", metric="episodic-nac", update_every=100), 6_400, envs=4)


@pytest.mark.slow
@pytest.mark.parametrize(("preset", "steps"), [("ppo", 6_000), ("trpo", 6_000), ("a2c", 12_000)])
def test_batch_methods_learn_three_states(preset, steps):
    """The best policy earns 0.8, the first one 0.5. Single seeds may stay below."""
    task = mg.make("three-state")
    run = mg.train(task, mg.agent_for(task, preset=preset, steps=steps), steps=steps, seeds=8, progress=False)
    policies = [jax.tree.map(lambda x, s=s: x[s], run.policies) for s in range(8)]
    assert np.median([oracle.average_reward(task.dynamics, policy) for policy in policies]) > 0.75


@pytest.mark.ci
def test_the_preset_balances_the_pole():
    task = from_gymnasium("CartPole-v1")
    run = mg.train(task, steps=50_000, seeds=2, progress=False)
    assert (mg.evaluate(run, 2_000, mode="mode").metrics["return"] >= 475).all()
