"""The partition of a study into compiled calls."""

import pytest
from study_examples import small

from motorgrad.studies import Study


def calls(study):
    return [(job.task["name"], job.sweep and len(job.sweep)) for job in study.jobs]


def test_numbers_of_the_learner_learn_side_by_side():
    study = Study(task="three-state", agent={"learning_rate": [0.1, 0.2], "estimator.trace.decay": [0.5, 0.9]})
    (job,) = study.jobs
    assert job.sweep == [
        {"learning_rate": rate, "estimator.trace.decay": decay} for rate in (0.1, 0.2) for decay in (0.5, 0.9)
    ]
    assert job.points == (0, 1, 2, 3)


def test_structure_and_tasks_are_jobs_of_their_own():
    study = Study(
        task=["three-state", "chain"],
        agent={"trace": {"kind": "window", "length": [5, 10]}, "learning_rate": [0.1, 0.2]},
    )
    assert calls(study) == [("three-state", 2)] * 2 + [("chain", 2)] * 2
    # the settings of a job are those of its points
    for job in study.jobs:
        for point, swept in zip(job.points, job.sweep, strict=True):
            agent = study.points[point]["agent"]
            assert agent["learning_rate"] == swept["learning_rate"]
            assert agent["trace"] == job.agent["trace"]


def test_a_number_that_may_be_absent_is_structure_where_it_is():
    study = Study(task="three-state", agent={"entropy": ["none", 0.1, 0.2]})
    assert [(job.agent["entropy"], job.sweep and len(job.sweep)) for job in study.jobs] == [("none", None), (0.1, 2)]


def test_calls_are_of_equal_size_where_that_is_possible():
    def sizes(settings, lanes):
        study = Study(
            task="three-state", agent={"learning_rate": [0.01 * (i + 1) for i in range(settings)]}, seeds=2, lanes=lanes
        )
        assert [point for job in study.jobs for point in job.points] == list(range(settings))
        return [len(job.points) for job in study.jobs]

    assert sizes(12, 10) == [4, 4, 4]
    assert sizes(12, 24) == [12]
    assert sizes(11, 12) == [6, 5]  # a prime number: two programs
    assert sizes(3, 1) == [1, 1, 1]  # fewer lanes than seeds: one setting each


def test_names_follow_the_order_of_the_study():
    assert [job.name for job in small().jobs] == [f"{index:04d}-three-state" for index in range(4)]


@pytest.mark.parametrize(
    ("agent", "said"),
    [
        ({"learning_rat": [0.1, 0.2]}, "did you mean 'learning_rate'"),
        ({"learning_rate": [0.1, -0.2]}, "learning_rate"),
        ({"learning_rate": [0.1, "fast"]}, "fast"),
        ({"decay": [0.5, 1.5]}, "1.5"),
        ({"trace": [{"kind": "window", "length": 5}, {"kind": "window", "length": -5}]}, "length = -5"),
        ({"baseline": ["mean", "man"]}, "did you mean 'mean'"),
    ],
)
def test_every_combination_is_checked_before_any_work(agent, said, tmp_path):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        Study(task="three-state", agent=agent).run(tmp_path / "study")
    assert said in str(caught.value)
    assert not (tmp_path / "study").exists()


def test_an_impossible_task_is_refused_before_any_work(tmp_path):
    with pytest.raises(ValueError, match="task: unknown setting of chain 'lenth': did you mean 'length'"):
        _ = Study(task={"name": "chain", "lenth": [5, 6]}).jobs
