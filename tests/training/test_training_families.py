"""Every family of learners in runs: chosen by its kind, saved, resumed bit for bit, swept, recorded and refused."""

import re

import jax
import numpy as np
import pytest
from training_examples import assert_differ, assert_same_run

import motorgrad as mg
from families import FAMILIES, learner_of, made, short_and_path, task_of
from motorgrad.cli import main
from motorgrad.learning import Baseline, Learner
from motorgrad.schema import fields_of, parts_by_path
from motorgrad.training import agent_for, agent_from_table, agent_table, changed, check_training, stepper_for

SINGLE_STREAM = {
    "proximal": "batches used again by ProximalPolicyOptimization",
    "soft-actor-critic": "the experience kept by SoftActorCritic",
    "sparse": "the task 'particle', whose world is compiled",
}


def trained(kind, steps, out=None, **options):
    return mg.train(task_of(kind), learner_of(kind), steps, 2, out, window=20, progress=False, **options)


def test_here_is_every_family():
    assert FAMILIES.keys() == Learner.kinds().keys()


@pytest.mark.ci
@pytest.mark.parametrize("kind", FAMILIES)
def test_a_run_is_saved_and_resumed_bit_for_bit(kind, tmp_path):
    whole = trained(kind, 100, tmp_path / "whole")
    trained(kind, 47, tmp_path / "parts")  # between two updates
    assert_same_run(trained(kind, 100, tmp_path / "parts"), whole)
    loaded = mg.load(tmp_path / "whole")
    assert_same_run(loaded, whole)
    assert_differ(loaded.policies, loaded.initial)
    assert type(agent_from_table(task_of(kind), loaded.config["agent"])) is Learner.kinds()[kind]
    assert set(loaded.critic) == set(whole.critic)


@pytest.mark.ci
@pytest.mark.parametrize("kind", FAMILIES)
def test_a_table_is_the_learner_again(kind):
    agent = learner_of(kind)
    assert agent_from_table(task_of(kind), agent_table(agent)) == agent


@pytest.mark.ci
@pytest.mark.parametrize("kind", FAMILIES)
def test_a_short_name_is_its_path_in_changes_and_in_sweeps(kind):
    short, path = short_and_path(kind)
    assert learner_of(kind, **{short: 0.25}) == learner_of(kind, **{path: 0.25})
    sweep = {short: [0.25, 0.5]}
    swept = mg.train(task_of(kind), learner_of(kind), 60, 2, sweep=sweep, window=20, progress=False)
    assert swept.settings == [{path: 0.25}, {path: 0.5}]
    alone = mg.train(task_of(kind), learner_of(kind, **{short: 0.5}), 60, 2, window=20, progress=False)
    for mine, own in zip(*(jax.tree.leaves(run.policies) for run in (swept.split()[1], alone)), strict=True):
        np.testing.assert_allclose(mine, own, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_change_by_short_name_takes_the_place_of_one_by_path(kind):
    short, path = short_and_path(kind)
    assert changed({"kind": kind, path: 0.5}, {short: 0.25}) == {"kind": kind, short: 0.25}
    assert changed({"kind": kind, short: 0.5}, {path: 0.25}) == {"kind": kind, path: 0.25}


@pytest.mark.ci
@pytest.mark.parametrize("kind", FAMILIES)
def test_runs_have_what_their_learner_has(kind):
    """A baseline in the records and a critic only where there is one, a gradient only of the policy gradient."""
    run = trained(kind, 30)  # after seven batches of 4 there is half of another
    has_one = Learner.kinds()[kind].critic is not None
    assert has_one == any(isinstance(part, Baseline) for _, part in parts_by_path(learner_of(kind)))
    assert ("baseline" in run.metrics.column_names) == has_one
    assert bool(run.critic) == has_one
    assert (run.gradient is not None) == (kind == "policy-gradient")
    evaluation = mg.evaluate(run, 20)
    assert "baseline" not in evaluation.metrics
    assert np.isfinite(evaluation.reward).all()


@pytest.mark.ci
@pytest.mark.parametrize("kind", FAMILIES)
def test_several_environments_feed_a_learner_or_are_refused_by_name(kind):
    suited, settings = FAMILIES[kind]
    task = made(suited.several)
    policy = suited.policy if suited.several == suited.trained else {}
    agent = agent_for(task, {"kind": kind, **policy, **settings})
    single_stream = SINGLE_STREAM.get(kind, agent.needs.single_stream)
    if single_stream is None:
        stepper = stepper_for(task, agent, [3, 8], threads=1, envs=3)
        before = stepper.policies()
        stepper.advance(120)
        assert_differ(stepper.policies(), before)
        assert len({tuple(row) for row in stepper.state["cycle"].observation[0].tolist()}) == 3
        return
    with pytest.raises(ValueError, match=f"envs = 3: must be 1 for {single_stream}"):
        check_training(task, agent, 120, envs=3)


REFUSED = [
    ("soft-actor-critic", "estimator.values", "unknown setting of agent 'estimator': known are averaging, discount,"),
    ("soft-actor-critic", "estimator.reuse", "unknown setting of agent 'estimator': known are averaging, discount,"),
    ("soft-actor-critic", "decay", "unknown setting of agent 'decay'"),
    ("action-value-gradient", "baseline", "unknown setting of agent 'baseline'"),
    ("action-value-gradient", "values.discont", "unknown setting of agent.values 'discont': did you mean 'discount'?"),
    ("proximal", "estimator.reuse.epochs", "unknown setting of agent 'estimator'"),
    ("proximal", "epoch", "unknown setting of agent 'epoch': did you mean 'epochs'?"),
    ("sparse", "estimator.trace", "unknown setting of agent 'estimator'"),
    ("policy-gradient", "epochs", "unknown setting of agent 'epochs'"),
    ("policy-gradient", "estimator.reuse", "unknown setting of agent.estimator 'reuse'"),
    ("policy-gradient", "estimator.values", "unknown setting of agent.estimator 'values'"),
]


@pytest.mark.parametrize(("kind", "name", "said"), REFUSED)
def test_a_setting_of_another_family_is_refused_with_what_is_known(kind, name, said, capsys):
    with pytest.raises(ValueError, match=re.escape(said)):
        learner_of(kind, **{name: "none"})
    options = ["--agent.kind", kind, f"--agent.{name}", "none"]
    assert main(["train", FAMILIES[kind].suited.trained, *options, "--steps", "10", "--check"]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("kind", FAMILIES)
def test_the_command_line_switches_families_and_shows_the_options_of_each(kind, capsys, tmp_path):
    task = FAMILIES[kind].suited.trained
    short, path = short_and_path(kind)
    kind_of_learner = Learner.kinds()[kind]
    with pytest.raises(SystemExit) as done:
        main(["train", task, "--agent.kind", kind, "--help-all"])
    assert done.value.code == 0
    shown = capsys.readouterr().out
    listed = " ".join(shown.split())
    assert f"Another kind keeps the policy. (default: {kind})" in listed
    own = {name for name in mg.schema.fields_of(kind_of_learner) if name not in ("policy", "transformations")}
    shown_names = {name.replace("-", "_") for name in re.findall(r"^  --agent\.([\w-]+)", shown, re.MULTILINE)}
    assert shown_names >= own
    others = {name for cls in Learner.kinds().values() for name in mg.schema.fields_of(cls)} - own - {"policy"}
    assert not shown_names & others
    assert all(name.replace("_", "-") in listed for name in kind_of_learner.aliases)

    table = tmp_path / "run.toml"
    table.write_text(f'steps = 10\n[agent]\nkind = "{kind}"\n{short} = 0.25\n')
    found = []
    line = ["--agent.kind", kind, f"--agent.{short.replace('_', '-')}", "0.25"]
    for words in (line, ["--config", str(table)]):
        with pytest.raises(SystemExit) as done:
            main(["train", task, *words, "--steps", "10", "--check"])
        assert done.value.code == 0
        found.append(capsys.readouterr().out.partition("[agent]")[2])
    assert found[0] == found[1]
    assert f"{path.rpartition('.')[2]} = 0.25" in found[0]


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["policy-gradient", "proximal"])
def test_a_rollout_has_the_value_of_the_learner(kind):
    changes = {"kind": kind, "baseline": {"kind": "linear", "rate": 0.01}, "update_every": 20}
    run = mg.train("particle", changes, 200, 2, window=100, progress=False)
    table = mg.rollout(run, steps=20)
    for row, seed in enumerate(run.seeds):
        part = table.of(seed=seed)
        slope, level = np.split(run.critic["weights"][row], [-1])
        wanted = (part["observation"] @ slope + level)[:-1]  # of the next reward, and of the last there is none
        assert np.ptp(wanted) > 0
        np.testing.assert_allclose(part["value"][:-1], wanted, rtol=1e-4, atol=1e-6)


@pytest.mark.ci
@pytest.mark.parametrize("kind", [kind for kind, cls in Learner.kinds().items() if "replay" in fields_of(cls)])
def test_noise_that_is_not_filtered_is_learned_evaluated_and_rolled_out(kind):
    """Its score is not exact, which does not matter where nothing learns from scores."""
    policy = {"kind": "bounded-hyperplanes", "network": "none", "autocorrelation": 0.5, "filtered": False}
    task = task_of(kind)
    run = mg.train(task, learner_of(kind, policy=policy), 60, 1, progress=False)
    assert np.isfinite(mg.evaluate(run, steps=20).reward).all()
    assert np.isfinite(mg.rollout(run, steps=10)["reward"]).any()
    with pytest.raises(ValueError, match="must be one with an exact score"):
        agent_for(task, policy=policy)
