"""What a comparison is told: everything is checked before work starts, and every message names its place."""

import sys

import numpy as np
import pytest
import tomli_w
from study_examples import small

from motorgrad.cli import main
from motorgrad.studies import Comparison, Results
from motorgrad.studies.comparison._tables import _recorded
from motorgrad.training import NotTrusted

TABLE = {
    "metric": "reward",
    "steps": 400,
    "window": 100,
    "evaluate": 50,
    "seeds": {"tune": 2, "judge": 3},
    "tasks": {"three-state": {"scale": [0.5, 0.8]}, "short": {"task": "three-state", "steps": 200}},
    "agent": {"learning_rate": [0.01, 0.1]},
    "methods": {"OLGARB": {"estimator": "olgarb"}, "tuned trace": {"estimator": "olgarb", "decay": [0.0, 0.5]}},
}


def made(**changes):
    table = {**TABLE, **changes}
    return Comparison(**{name: value for name, value in table.items() if value is not None})


def test_a_comparison_is_its_table(tmp_path):
    comparison = made()
    file = tmp_path / "it.toml"
    file.write_text(tomli_w.dumps(TABLE))
    assert Comparison.read(file).as_table() == comparison.as_table()
    file.write_text(tomli_w.dumps(comparison.as_table()))
    assert Comparison.read(file) == comparison
    assert comparison.pairs == [(m, t) for m in TABLE["methods"] for t in TABLE["tasks"]]
    assert (comparison.seeds.tuning, comparison.seeds.judging) == ([0, 1], [2, 3, 4])
    assert [comparison.steps_of(task) for task in comparison.tasks] == [400, 200]


def test_a_method_sets_what_all_have_otherwise_by_any_name():
    comparison = made(methods={"own": {"optimizer.learning_rate": 0.5}, "olpomdp": "olpomdp"})
    assert comparison.settings("own", "short") == [{"optimizer.learning_rate": 0.5}]
    assert comparison.varied("olpomdp") == [{"learning_rate": 0.01}, {"learning_rate": 0.1}]
    assert [point["agent"]["estimator"] for point in comparison.tuning(dict.fromkeys(comparison.pairs, 9)).points[2:4]]


def test_a_method_may_be_for_some_tasks_and_drawn_from_ranges():
    drawn = {"learning_rate": {"low": 1e-3, "high": 1.0, "scale": "log"}, "tasks": ["short"]}
    comparison = made(methods={"drawn": drawn, "OLGARB": {}}, design={"kind": "sobol", "count": 4})
    assert comparison.pairs == [("drawn", "short"), ("OLGARB", "three-state"), ("OLGARB", "short")]
    assert len(comparison.settings("drawn", "short")) == 4
    assert (comparison.is_drawn("drawn"), comparison.is_drawn("OLGARB")) == (True, False)
    # here both tasks are the same but in name: what occurs twice learns once
    assert len(comparison.tuning(dict.fromkeys(comparison.pairs, 100)).points) == 4 + 2


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tasks": ["three-stat"]}, "tasks.three-stat: unknown task 'three-stat': did you mean 'three-state'"),
        (
            {"tasks": {"short": {"task": {"name": "chain", "lenght": 3}}}},
            "tasks.short: unknown setting of chain 'lenght'",
        ),
        ({"tasks": []}, r"tasks = \[\]: must be at least one task"),
        ({"tasks": {"chain": {"metrc": "reward"}}}, "unknown setting of tasks.chain 'metrc': did you mean 'metric'"),
        ({"methods": ["olgrab"]}, "unknown method 'olgrab': did you mean 'olgarb'"),
        ({"methods": [["olgarb"]]}, r"methods = \[\['olgarb'\]\]: must be a list of names"),
        ({"tasks": {"x": {"task": {"name": ["chain"]}}}}, r"tasks.x: unknown task \['chain'\]"),
        ({"methods": {"mine": "olgrab"}}, "unknown methods.mine: method 'olgrab': did you mean 'olgarb'"),
        ({"methods": {"mine": {"tasks": ["chain"]}}}, "unknown methods.mine.tasks 'chain'"),
        ({"methods": {"mine": {"tasks": "short"}}}, "methods.mine.tasks = 'short': must be a list of at least one"),
        ({"methods": {"mine": {"tasks": []}}}, r"methods.mine.tasks = \[\]: must be a list of at least one"),
        ({"methods": {}}, "methods = {}: must be at least one method"),
        ({"metric": "apex"}, "unknown metric of tasks.three-state: 'apex'"),
        ({"metric": None}, "missing 1 required positional argument: 'metric'"),
        ({"seeds": {"tune": 4, "judge": [3, 4]}}, r"seeds.judge = \[3, 4\]: seed 3 is in tune, too"),
        ({"seeds": {"tune": [1, 1], "judge": 2}}, r"seeds.tune = \[1, 1\]: must be different seeds"),
        ({"seeds": {"tune": 0, "judge": 2}}, "seeds.tune = 0"),
        ({"choose_by": "finale"}, "did you mean 'final'"),
        ({"steps": 0}, "steps = 0: must be an integer of at least 1, in decisions"),
        ({"evaluate": 0}, "evaluate = 0: must be an integer from 1"),
        ({"steps": None}, "steps = None: must be given, the decisions of every run; or seconds"),
        ({"seconds": 1.0}, "steps = 400: must be left out where there is a budget in seconds"),
        ({"tasks": {"chain": {"scale": [1.0, 1.0]}}}, "two different numbers"),
        (
            {"tasks": {"chain": {"agent": {"decay": [0.1, 0.2]}}}},
            "tasks.chain.agent = .*: must be without lists",
        ),
    ],
)
def test_what_is_wrong_is_named(changes, said):
    with pytest.raises((ValueError, TypeError), match=said):
        made(**changes)


@pytest.mark.parametrize(
    ("methods", "said"),
    [
        ({"a": {"decy": 0.5}}, "methods.a on tasks.three-state: unknown setting of agent 'decy': did you mean 'decay'"),
        ({"a": {"estimator": "olgrab"}}, "methods.a on tasks.three-state: unknown agent.estimator 'olgrab'"),
        ({"a": {}, "b": {"trace": "episodic"}}, "methods.b on tasks.three-state: .*episod"),
        ({"a": {"decay": 2.0}}, "methods.a on tasks.three-state: .*decay = 2.0: must be in"),
    ],
)
def test_a_method_that_does_not_fit_a_task_is_named_with_it(methods, said):
    with pytest.raises(ValueError, match=said):
        made(methods=methods).check()


def test_the_command_refuses_a_bad_file_and_makes_nothing(tmp_path, capsys):
    file = tmp_path / "bad.toml"
    file.write_text(tomli_w.dumps({name: value for name, value in TABLE.items() if name != "metric"}))
    assert main(["compare", str(file)]) == 2
    assert f"motorgrad compare: {file}: metric: must be given" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
    file.write_text(tomli_w.dumps(TABLE))
    with pytest.raises(SystemExit):
        main(["compare", str(file), "--check"])
    out, err = capsys.readouterr()
    assert "2 methods on 2 tasks: 12 settings × 2 seeds to tune, 4 × 3 seeds to judge" in err
    assert "[methods" in out


def test_a_folder_imports_nothing_that_its_user_has_not_imported(tmp_path, monkeypatch):
    """A folder of somebody else, whose task names a module, is neither read nor continued."""
    name = "stranger_in_a_folder"
    (tmp_path / f"{name}.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(str(tmp_path))
    task = {"name": "gymnasium", "env_id": f"{name}:Strange-v0"}
    compared, studied = tmp_path / "compared", tmp_path / "studied"
    for folder in (compared, studied):
        folder.mkdir()
    (compared / "comparison.toml").write_text(tomli_w.dumps({**TABLE, "tasks": {"strange": {"task": task}}}))
    (studied / "study.toml").write_text(tomli_w.dumps({"task": task, "agent": {}, "steps": 10}))
    for use in (
        lambda: Comparison.load(compared),
        lambda: made().run(compared, progress=False),
        lambda: Results.load(studied),
        lambda: small().run(studied, progress=False),
    ):
        with pytest.raises(NotTrusted, match=f"imports '{name}:Strange-v0'.*nothing was imported"):
            use()
    assert name not in sys.modules
    assert not (compared / "tuning").exists()


def test_a_run_counts_with_its_latest_record_and_not_before_its_first():
    gap = np.nan
    values = np.array([[gap, 1.0, gap, 3.0], [gap, gap, 5.0, gap], [gap, 2.0, 4.0, 6.0], [gap] * 4])
    (early, two), (late, three) = _recorded(values)
    assert (early.tolist(), two.tolist()) == ([1], [[1.0, 2.0]])
    assert (late.tolist(), three.tolist()) == ([2, 3], [[1.0, 5.0, 4.0], [3.0, 5.0, 6.0]])
    ((records, known),) = _recorded(np.arange(6.0).reshape(2, 3))
    assert (records.tolist(), known.tolist()) == ([0, 1, 2], [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]])
    assert list(_recorded(np.full((2, 3), gap))) == []
