"""Searches by Optuna: rounds of studies, the same whatever was killed."""

import json
import math
import re

import pytest

from motorgrad.studies import Search, Study, _partition, _search
from motorgrad.training import RunDirectoryError, RunWarning

pytest.importorskip("optuna", reason="searches need motorgrad[search]")


def searching(**changes):
    """A search for a learning rate and a baseline."""
    study = Study(
        task="three-state",
        agent={"learning_rate": {"low": 1e-4, "high": 0.5, "scale": "log"}, "baseline": ["mean", "none"]},
        steps=360,
        seeds=2,
        window=120,
    )
    return Search(**({"study": study, "trials": 6, "batch": 3, "seed": 1} | changes))


def asked(path):
    return [json.loads(file.read_text()) for file in sorted(path.glob("rounds/*/trials.json"))]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    return searching().run(tmp_path_factory.mktemp("done") / "search", progress=False)


def test_a_search_asks_in_rounds_and_finds_the_best(done):
    assert done.complete
    assert [len(results.study.points) for results in done.rounds] == [3, 3]
    rates = [trial["agent.learning_rate"] for trials in asked(done.path) for trial in trials]
    assert all(1e-4 <= rate <= 0.5 for rate in rates)
    assert len(set(rates)) == 6
    best = done.best(6)
    assert len(best) == 6
    assert best[0].chosen_by.value == max(results.values("reward").mean(axis=1).max() for results in done.rounds)
    assert best[0].settings["agent.learning_rate"] in rates
    again = Search.load(done.path)
    assert again.search == done.search
    assert again.best() == done.best()


def test_optuna_knows_all_values(done):
    import optuna

    storage = optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(str(done.path / "optuna.log")))
    (study,) = (optuna.load_study(study_name=None, storage=storage),)
    assert [trial.state.name for trial in study.trials] == ["COMPLETE"] * 6
    assert study.best_value == done.best()[0].chosen_by.value


@pytest.mark.ci
def test_trials_that_break_fail_and_rank_last(tmp_path):
    import optuna

    study = Study(task="call-admission", agent={"learning_rate": [3e38, 0.01]}, steps=200, seeds=2, window=100)
    search = Search(study=study, trials=4, batch=2, sampler="random")
    with pytest.warns(RunWarning, match="parameters not finite"):
        results = search.run(tmp_path / "search", progress=False)
    sound, broken = results.best()
    assert (sound.settings, sound.broken) == ({"agent.learning_rate": 0.01}, 0)
    assert (broken.settings, broken.broken) == ({"agent.learning_rate": 3e38}, 2)
    assert math.isnan(broken.chosen_by.value)
    log = optuna.storages.journal.JournalFileBackend(str(results.path / "optuna.log"))
    told = optuna.load_study(study_name=None, storage=optuna.storages.JournalStorage(log))
    states = {trial.params["agent.learning_rate"]: trial.state.name for trial in told.trials}
    assert [states[name] for name in sorted(states)] == ["COMPLETE", "FAIL"]


@pytest.mark.ci
@pytest.mark.representatives("1")  # within a round; 2 is between two
@pytest.mark.parametrize("job", [0, 1, 2, 3])
def test_a_search_that_was_stopped_asks_the_same(done, tmp_path, monkeypatch, job):
    train, calls = _partition.train, []

    def train_or_stop(*arguments, **options):
        calls.append(arguments)
        if len(calls) == job + 1:
            raise KeyboardInterrupt
        return train(*arguments, **options)

    monkeypatch.setattr(_partition, "train", train_or_stop)
    path = tmp_path / "search"
    with pytest.raises(KeyboardInterrupt, match="the same call continues") as stop:
        searching().run(path, progress=False)
    assert not stop.value.results.complete  # type: ignore[attr-defined]
    monkeypatch.undo()
    # its file has the table of the learning rate after the baseline
    found = Search.read(path / "study.toml").run(path, progress=False)
    assert found.complete
    assert asked(path) == asked(done.path)
    assert [best.settings for best in found.best()] == [best.settings for best in done.best()]


@pytest.mark.ci
def test_successive_halving_spends_more_on_the_better(tmp_path):
    found = searching(rungs=2, reduction=3, batch=6).run(tmp_path / "search", progress=False)
    first, second = found.rounds
    assert [first.study.steps, second.study.steps] == [120, 360]
    assert 1 <= len(second.study.points) < 6
    agents = [point["agent"] for point in first.study.points]
    assert all(point["agent"] in agents for point in second.study.points)
    # the best of the first rung goes on
    values = first.values("reward").mean(axis=1)
    assert agents[values.argmax()] in [point["agent"] for point in second.study.points]
    assert len(found.best(10)) == len(second.study.points)


def test_a_job_that_fails_fails_its_trials_and_the_search_goes_on(tmp_path, monkeypatch):
    train = _partition.train

    def fail(task, agent, *rest, **options):
        if agent["baseline"] == "none":
            raise RuntimeError("no baseline, no luck")
        return train(task, agent, *rest, **options)

    monkeypatch.setattr(_partition, "train", fail)
    found = searching().run(tmp_path / "search", progress=False, attempts=1)
    assert len(found.rounds) == 2
    assert "no baseline, no luck" in found.failures[0]["message"]
    assert all(best.settings["agent.baseline"] == "mean" for best in found.best())


@pytest.mark.parametrize(
    ("search", "said"),
    [
        ("search = 3", "search = 3: must be a table of the search's settings"),
        ("search = { study = 3 }", "search = {'study': 3}: must be a table"),
        ("agent.decay = 1979-05-27", "1979-05-27: must not be a date or a time, unless it is a text, in quotes"),
    ],
)
def test_a_file_that_describes_no_search_is_refused_by_name(search, said, tmp_path):
    (tmp_path / "s.toml").write_text(f"task = 'chain'\n{search}\n")
    with pytest.raises(ValueError, match=rf"s.toml: .*{re.escape(said)}"):
        Search.read(tmp_path / "s.toml")


@pytest.mark.parametrize("content", ["3", "[]", '["x", "y", "z"]', "{}"])
def test_what_a_round_asked_for_is_read_with_care(content, tmp_path):
    (tmp_path / "trials.json").write_text(content)
    with pytest.raises(ValueError, match=r"trials.json: damaged: must list the settings of 3 trials"):
        _search._trials(tmp_path / "trials.json", 3)


def test_impossible_searches_are_refused_before_any_work(done, tmp_path):
    with pytest.raises(ValueError, match="one task: rewards of several do not compare"):
        searching(study=Study(task=["three-state", "chain"]))
    with pytest.raises(ValueError, match="did you mean 'tpe'"):
        searching(sampler="tpee")
    with pytest.raises(ValueError, match="the first would have 0 steps"):
        searching(rungs=9)
    bad = Study(task="three-state", agent={"decay": {"low": 0.5, "high": 1.5}})
    with pytest.raises(ValueError, match=r"1\.5"):
        searching(study=bad).run(tmp_path / "search")
    assert not (tmp_path / "search").exists()
    with pytest.raises(RunDirectoryError, match=r"search\.seed was 1 and is now 2"):
        searching(seed=2).run(done.path)
