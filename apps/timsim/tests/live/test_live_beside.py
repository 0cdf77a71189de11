"""Other policies beside the one that learns: seeds of a run, functions, models of stable-baselines3."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

import motorgrad as mg
from motorgrad import _consent
from motorgrad._errors import NotTrusted
from timsim import live


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "run"
    return mg.train("hopper", steps=300, seeds=[2, 7], out=out, progress=False)


def spread(observation):
    """A policy that fires both muscles while the load sinks."""
    return (np.full(2, observation[1]) < 0).astype(int)


class Model:
    """A model as of stable-baselines3, with a state of its own."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert deterministic
        count = 0 if state is None else state
        return np.full(2, count // 10 % 2), count + 1


@pytest.mark.ci
def test_policies_of_all_kinds_stand_beside_and_go_back_bit_for_bit(run, driven):
    beside = {"seed 7": (run, 7), "function": spread, "model": Model(), "policy": run.policy(2), "before": "untrained"}
    watched = driven(live.setup_of("hopper", run=run, seed=2, frozen=True, beside=beside))
    alone = driven(live.setup_of("hopper", run=run, seed=7, frozen=True))
    watched(live.Step(150))
    alone(live.Step(150))
    seen = watched.seen()
    assert watched.worker.records.labels == ["learned", *beside]
    assert seen["bodies"] == 6
    assert np.array_equal(seen["position"][1], alone.seen()["position"][0])  # what this seed does by itself
    assert np.array_equal(seen["position"][4], seen["position"][0])  # the same policy with the same random numbers
    assert len(np.unique(seen["position"][:6], axis=0)) == 5
    assert np.isnan(seen["parameters"][2]).all()
    count = int(watched.seen("trail 3")["next"])
    acted = watched.seen("trail 3")["action"][:count]
    assert set(np.unique(acted)) == {0, 1}
    np.testing.assert_array_equal(acted[10:20, 0], acted[30:40, 0])  # ten decisions on, ten off
    watched(live.Scrub(40), live.Scrub(150))
    again = watched.seen()
    for name in ("position", "velocity", "control"):
        np.testing.assert_array_equal(again[name], seen[name])
    curve = watched.seen("curve 2")
    watched(live.Step(200))
    assert int(watched.seen("curve 2")["count"]) >= int(curve["count"])
    watched(live.Reset(), live.Step(150))
    np.testing.assert_array_equal(watched.seen()["position"], seen["position"])


@pytest.mark.ci
def test_the_actions_of_a_function_are_those_that_are_taken(driven):
    flow = driven(live.setup_of("chain", beside={"always": lambda observation: 1}))
    flow(live.Step(5))
    seen = flow.seen("trail 1")
    assert np.all(seen["action"][:5].argmax(1) == 1)


@pytest.mark.ci
@pytest.mark.needs("motorgrad[peers]")
def test_a_ppo_model_stands_beside_as_an_object_and_as_a_file(tmp_path, driven):
    import gymnasium
    import stable_baselines3 as sb3

    model = sb3.PPO("MlpPolicy", gymnasium.make("motorgrad/Hopper-v0"), device="cpu", n_steps=64, batch_size=64)
    file = tmp_path / "ppo.zip"
    model.save(file)
    watched = driven(live.setup_of("hopper", beside={"PPO": model, "file": file}, trust=True))
    watched(live.Step(30))
    seen = watched.seen()
    np.testing.assert_array_equal(seen["position"][1], seen["position"][2])
    trail = watched.seen("trail 1")
    for row in range(29):
        wanted = model.predict(trail["observation"][row].astype(np.float32), deterministic=True)[0]
        np.testing.assert_array_equal(trail["action"][row], wanted)


@pytest.mark.parametrize(
    ("beside", "says"),
    [
        ({"x": 3}, "beside 'x': policy = 3: must be a run, a policy"),
        ({"": "untrained"}, "label in beside"),
        ({"x": "no/such/run"}, "must be a run directory, a saved policy"),
        ({str(i): "untrained" for i in range(9)}, "number of policies beside = 9: must be at most 7"),
    ],
)
def test_what_cannot_stand_beside_is_refused_by_name(beside, says):
    with pytest.raises(ValueError, match=r".") as refused:
        live.setup_of("hopper", beside=beside)
    assert says in str(refused.value)


@pytest.mark.ci
def test_a_run_of_another_task_is_refused(run):
    with pytest.raises(ValueError, match="beside 'a': task of the run = 'hopper': must be 'chain'"):
        live.setup_of("chain", beside={"a": run})


def test_seeds_and_runs_are_gathered_from_the_command_line():
    from timsim._commands._side_by_side import gathered
    from timsim._commands.sim import prepared

    assert gathered(["hopper", "--seed", "2", "--seed=7"]) == ["hopper", "--seeds", "2", "7"]
    assert gathered(["--run", "a", "--run", "b", "--seeds", "0,3", "--paused"]) == (
        ["--paused", "--seeds", "0", "3", "--run", "a", "--runs-beside", "b"]
    )
    with pytest.raises(ValueError, match="several are shown side by side of a run"):
        prepared(["hopper", "--seeds", "1", "2"])


@pytest.fixture
def model(tmp_path, monkeypatch):
    """What a stranger sends: a file that looks like a model of stable-baselines3, under several names."""
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile("ppo.zip", "w") as packed:
        packed.writestr("data", "{}")
    (tmp_path / "folder").mkdir()
    for link in ("link.zip", "folder/link.zip"):
        (tmp_path / link).symlink_to(tmp_path / "ppo.zip")
    (tmp_path / "scene.toml").write_text('beside = ["PPO=ppo.zip/"]\ntask.name = "hopper"\n')
    return tmp_path / "ppo.zip"


SPELLINGS = ["ppo.zip", "ppo.zip/", "./ppo.zip//", "ppo.zip/.", "folder/../ppo.zip/", "link.zip", "folder/link.zip/"]


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_no_spelling_loads_a_model_without_trust(spelling, model):
    from timsim._commands.sim import prepared

    with pytest.raises(NotTrusted, match="stable-baselines3: loading it runs code that it holds; nothing was loaded"):
        prepared(["hopper", "--beside", f"PPO={spelling}"])
    for given in (spelling, Path(spelling), model.parent / spelling, (spelling, 3)):
        with pytest.raises(NotTrusted):
            live.setup_of("hopper", beside={"PPO": given})


def test_a_yes_is_for_the_content_that_was_asked_for(model):
    """Another model, or what was put in its place since, is asked for again."""
    model.write_bytes(model.read_bytes() + b"its own")  # what a test allows is allowed in this process
    with pytest.raises(NotTrusted) as asked:
        live.setup_of("hopper", beside={"PPO": model})
    _consent.allow(asked.value.names)
    with pytest.raises((RuntimeError, ValueError, KeyError)) as found:
        live.setup_of("hopper", beside={"PPO": model})
    assert not isinstance(found.value, NotTrusted)
    model.write_bytes(model.read_bytes() + b"x")
    with pytest.raises(NotTrusted):
        live.setup_of("hopper", beside={"PPO": model})


def test_a_scene_loads_no_model_without_trust(model, capsys):
    from motorgrad.cli import main

    assert main(["sim", "--config", "scene.toml"]) == 2
    said = capsys.readouterr().err
    assert "ppo.zip is a model of stable-baselines3: loading it runs code" in said
    assert "--trust" in said
    (model.parent / "scene.toml").write_text('beside = ["PPO=ppo.zip"]\ntrust = true\ntask.name = "hopper"\n')
    assert main(["sim", "--config", "scene.toml"]) == 2
    assert "trust = True: must be an option of the command line" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["ppo.ZIP", "ppo", "ppo.npz", "ppo.zip.txt"])
def test_a_model_under_another_name_is_not_loaded(name, model):
    model.rename(name)
    with pytest.raises(ValueError, match="beside 'PPO'"):
        live.setup_of("hopper", beside={"PPO": name}, trust=True)


@pytest.mark.ci
def test_what_was_gathered_is_prepared(run):
    from timsim._commands.sim import prepared

    setup, options = prepared(["--run", str(run.path), "--seed", "7", "--seed", "2"])
    assert (setup.seed, setup.label, setup.frozen) == (7, "seed 7", True)
    assert [each.label for each in setup.beside] == ["seed 2"]
    assert options.seeds == (7, 2)
    setup, _ = prepared(["hopper", "--beside", "before=untrained", f"other={run.path}"])
    assert ([each.label for each in setup.beside], setup.frozen) == (["before", "other"], False)


@pytest.mark.ci
def test_two_runs_stand_beside_each_other(run, tmp_path):
    from timsim._commands.sim import prepared

    other = mg.train("hopper", steps=100, seeds=[4, 5], out=tmp_path / "other", progress=False)
    setup, _ = prepared(["--run", str(run.path), "--run", str(other.path)])
    assert (setup.label, [each.label for each in setup.beside]) == ("run", ["other"])
    assert setup.beside[0].seed == 4
