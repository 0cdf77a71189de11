"""Lists as grids, and ranges that are drawn."""

import math

import numpy as np
import pytest
import tomli_w

from motorgrad.studies import Study


def settings(**given):
    return Study(**({"task": "three-state"} | given)).settings


def test_a_list_is_a_grid_whose_last_list_changes_fastest():
    found = settings(task=["three-state", "chain"], agent={"learning_rate": [0.1, 0.2], "baseline": "none"})
    assert found == [
        {"task.name": name, "agent.learning_rate": rate} for name in ("three-state", "chain") for rate in (0.1, 0.2)
    ]


def test_a_list_of_tables_is_a_grid_over_tables():
    found = settings(agent=[{"baseline": "none"}, {"estimator": {"trace": {"decay": [0.5, 0.9]}}}])
    assert found == [
        {"agent.baseline": "none"},
        {"agent.estimator.trace.decay": 0.5},
        {"agent.estimator.trace.decay": 0.9},
    ]


def test_a_list_within_a_list_is_a_value():
    study = Study(task="three-state", agent={"policy": {"kind": "gaussian", "centre": [[0.0, 1.0], [2.0, 3.0]]}})
    assert [point["agent"]["policy"]["centre"] for point in study.points] == [[0.0, 1.0], [2.0, 3.0]]


def test_one_setting_alone_differs_from_nothing():
    assert settings() == [{}]


@pytest.mark.parametrize("kind", ["random", "sobol"])
def test_ranges_are_drawn_within_their_ends_and_the_same_for_every_combination(kind):
    ranges = {"learning_rate": {"low": 1e-4, "high": 1.0, "scale": "log"}, "decay": {"low": 0.5, "high": 0.9}}
    design = {"kind": kind, "count": 64, "seed": 3}
    study = Study(task=["three-state", "chain"], agent=ranges, design=design)
    rates = np.array([point["agent"]["learning_rate"] for point in study.points])
    decays = np.array([point["agent"]["decay"] for point in study.points])
    assert len(study.points) == 128
    np.testing.assert_array_equal(rates[:64], rates[64:])
    assert rates.min() > 1e-4
    assert rates.max() < 1.0
    assert 0.5 < decays.min() < decays.max() < 0.9
    # half of the draws lie below the middle of a logarithmic scale
    below = np.mean(rates[:64] < 1e-2)
    assert below == 0.5 if kind == "sobol" else 0.3 < below < 0.7
    assert Study(task=["three-state", "chain"], agent=ranges, design=design).points == study.points
    other = Study(task=["three-state", "chain"], agent=ranges, design=design | {"seed": 4})
    assert other.points != study.points


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"task": "tree-state"}, "did you mean 'three-state'"),
        ({"task": {"states": 3}}, "task.name"),
        ({"agent": {"learning_rate": []}}, "agent.learning_rate = []: must be at least one value"),
        ({"agent": {"learning_rate": [0.1, 0.1]}}, "without a value that occurs twice"),
        ({"agent": 3}, "agent = 3: must be a table"),
        ({"steps": 1.5}, "steps = 1.5: must be an integer"),
        ({"lanes": 0}, "lanes = 0"),
        ({"design": {"kind": "sobl", "count": 4}}, "did you mean 'sobol'"),
        ({"design": {"kind": "sobol", "count": 3}}, "a power of two"),
        ({"design": {"kind": "random", "count": 3}}, "there is no range"),
        ({"design": {"kind": "random"}}, "design.count: must be given"),
    ],
)
def test_an_impossible_study_is_refused_by_name(given, said):
    if given.get("design", {}).get("kind") == "sobol":
        given["agent"] = {"learning_rate": {"low": 0.1, "high": 0.2}}
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        settings(**given)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"low": 1.0, "high": 1.0}, "learning_rate.high = 1.0: must be above low"),
        ({"low": 0.0, "high": 1.0, "scale": "log"}, "learning_rate.low = 0.0: must be above 0"),
        ({"low": 0.1, "high": 1.0, "scale": "lg"}, "did you mean 'log'"),
        ({"low": 0.1, "high": 1.0, "scal": "log"}, "did you mean 'scale'"),
        ({"low": math.nan, "high": 1.0}, "must be a finite number"),
    ],
)
def test_an_impossible_range_is_refused_by_name(table, said):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        settings(agent={"learning_rate": table}, design={"kind": "random", "count": 2})
    assert said in str(caught.value)


def test_a_study_is_its_file(tmp_path):
    study = Study(
        task=["three-state", "chain"],
        agent=[{"learning_rate": {"low": 0.1, "high": 1.0}}, {"decay": [0.5, 0.9]}],
        steps=1000,
        seeds=(3, 4),
        design={"kind": "sobol", "count": 4},
    )
    file = tmp_path / "study.toml"
    file.write_text(tomli_w.dumps(study.as_table()))
    assert Study.read(file) == study
    file.write_text(file.read_text().replace("steps", "step"))
    with pytest.raises(ValueError, match=r"study\.toml: unknown setting of study 'step': did you mean 'steps'"):
        Study.read(file)


@pytest.mark.parametrize(
    "agent",
    [
        {"metric": {"kind": "fisher", "rate": [0.1, 0.2]}, "learning_rate": [0.01, 0.02]},
        {
            "metric": [{"kind": "fisher", "rate": [0.1, 0.2]}, {"kind": "fisher"}],
            "baseline": {"kind": "fixed-step", "rate": [0.5]},
            "decay": [0.1],
        },
        {"metric": {"kind": "fisher", "rate": {"low": 0.1, "high": 1.0}}, "learning_rate": {"low": 0.1, "high": 1.0}},
    ],
)
def test_the_points_of_a_study_that_is_read_again_have_the_same_order(agent, tmp_path):
    # TOML writes tables after what stands beside them
    design = {"kind": "sobol", "count": 4} if "low" in str(agent) else None
    study = Study(task="three-state", agent=agent, design=design)
    file = tmp_path / "study.toml"
    file.write_text(tomli_w.dumps(study.as_table()))
    assert Study.read(file).points == study.points


MANY = [n / 1000 for n in range(1, 401)]
TOO_MANY = {
    "a grid": {"agent": {"learning_rate": MANY, "decay": MANY}},
    "tables": {"agent": [{"learning_rate": MANY, "decay": [n / 500 + k for n in range(100)]} for k in range(3)]},
    "cases": {
        "cases": [{"task": "chain", "agent": {"learning_rate": MANY, "decay": MANY[: 100 + k]}} for k in range(3)]
    },
    "draws": {"agent": {"learning_rate": {"low": 0.1, "high": 0.2}}, "design": {"kind": "random", "count": 10**6}},
    "draws of a grid": {
        "agent": {"learning_rate": {"low": 0.1, "high": 0.2}, "decay": MANY},
        "design": {"kind": "random", "count": 300},
    },
}


@pytest.mark.parametrize("given", TOO_MANY.values(), ids=TOO_MANY)
def test_a_small_file_does_not_stand_for_more_settings_than_there_is_memory(given):
    with pytest.raises(ValueError, match="100,000"):
        _ = Study(**({} if "cases" in given else {"task": "three-state"}) | given).points
