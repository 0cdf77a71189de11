"""Large pools by the natural step: end to end at its smoke size, its times, and its judgements both ways."""

import json

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.tasks import LinearRecruitment
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_4._pools import NORMAL, equally_spaced_from, parameter_history, spacing_deviation
from motorgrad_thesis.chapter_4.beyond_4_3_1_pools import WITHOUT, LargePools

SEEDS = 20


def values(**changes):
    """What a run of pools of 2, 16 and 64 might find: times that grow as they are claimed to."""
    decision, error = np.array([100.0, 200.0]), np.full((SEEDS, 2), 0.1)
    jitter = np.linspace(0.9, 1.1, SEEDS)
    found = {"normal_units": np.array([2, 16, 64]), "normal_budget": np.full(3, 1_000_000)}
    found["normal_times"] = np.array([1e4, 5e4, 1.5e5])[:, None] * jitter
    found |= {"natural_units": np.array([2, 16]), "natural_budget": np.full(2, 1_000_000)}
    found["natural_times"] = np.array([1e5, 3e5])[:, None] * jitter
    found |= {"plain_units": np.array([2, 8, 16]), "plain_budget": np.array([3e6, 4e7, 2e7])}
    found["plain_times"] = np.array([1e6, 3e7, np.inf])[:, None] * jitter
    for name in ("normal", "natural", "plain"):
        found |= {f"{name}_decision": decision, f"{name}_error": error}
    for place in range(len(WITHOUT)):
        late = (1e5 * jitter, np.full(SEEDS, np.inf), np.full(SEEDS, np.inf), 1.5e5 * jitter, 1.5e5 * jitter)[place]
        found |= {f"without_{place}_times": late, f"without_{place}_rate": np.array(7e-4)}
        found |= {f"without_{place}_decision": decision, f"without_{place}_error": error}
    return found | changes


def judged(found):
    return [claim.holds for claim in LargePools(pools=(2, 16, 64)).claims(found)]


@pytest.mark.slow
def test_it_leaves_a_figure_and_its_claims(tmp_path):
    found = reproduce(LargePools.quick(), tmp_path, quick=True, progress=False)
    assert found.figure.read_text().startswith("<?xml")
    assert json.loads((found.folder / "record.json").read_text())["settings"]["seeds"] == 2
    # one pool, one claim less, and the four parts that are replaced
    assert len(found.claims) == 1 + 3 + 4
    assert "beyond-4.3.1" in EXPERIMENTS
    assert LargePools().part == "chapter-4"
    assert LargePools().seeds >= 20


def test_the_claims_hold_where_they_should_and_fail_where_they_should():
    found = values()
    assert all(judged(found)), judged(found)
    one_left = found["normal_times"].copy()
    one_left[1, 3] = np.inf
    assert judged(values(normal_times=one_left))[0] is False
    one_left = found["normal_times"].copy()
    one_left[2, 3] = np.inf
    assert judged(values(normal_times=one_left))[1] is False
    assert judged(values(normal_times=found["normal_times"] + [[0], [0], [1e6]]))[:2] == [True, False]
    quick = found["plain_times"].copy()
    quick[2, 0] = 1.9e7
    assert judged(values(plain_times=quick))[2] is False
    slow_growth = np.array([1e6, 6e6, np.inf])[:, None] * np.ones(SEEDS)
    assert judged(values(plain_times=slow_growth))[3] is False
    steep = np.array([1e3, 5e4, 9e5])[:, None] * np.ones(SEEDS)
    assert judged(values(normal_times=steep))[4] is False
    lost = found["normal_times"].copy()
    lost[0, 0] = np.inf
    assert judged(values(normal_times=lost))[4] is False
    for place in range(1, len(WITHOUT)):
        as_quick = {f"without_{place}_times": found["without_0_times"].copy()}
        assert judged(values(**as_quick))[4 + place] is False


def test_the_last_doubling_is_judged_by_itself():
    units = {"normal_units": np.array([2, 16, 64, 128]), "normal_budget": np.full(4, 1_000_000)}
    times = np.array([1e4, 5e4, 1.5e5, 9e5])[:, None] * np.ones(SEEDS)
    claims = list(LargePools(pools=(2, 16, 64, 128)).claims(values(**units, normal_times=times)))
    assert [claim.holds for claim in claims[4:6]] == [True, False]
    assert "64, 128" in claims[5].statement


def test_the_best_step_at_the_end_of_those_tried_is_told():
    (claim,) = list(LargePools(pools=(2, 16, 64)).claims(values(without_3_rate=np.array(3e-4))))[-2:-1]
    assert claim.note.endswith("is 0.0003, at an end.")


def test_the_figure_is_drawn_where_some_got_there_and_some_did_not():
    LargePools(pools=(2, 16, 64)).figure(values())


@pytest.mark.ci
def test_a_pool_of_sixteen_is_equally_spaced_soon_and_stays_so():
    task = LinearRecruitment(units=16)
    run = mg.train(task, NORMAL, 150_000, 3, progress=False)
    assert (equally_spaced_from(run.curve()[0], spacing_deviation(*parameter_history(run), task)) <= 100_000).all()


@pytest.mark.slow
def test_a_pool_of_sixty_four_is_equally_spaced_in_a_few_hundred_thousand():
    task = LinearRecruitment(units=64)
    run = mg.train(task, NORMAL, 400_000, 20, progress=False)
    assert (
        np.isfinite(equally_spaced_from(run.curve()[0], spacing_deviation(*parameter_history(run), task))).mean() > 0.85
    )


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"seeds": 1}, "seeds = 1"),
        ({"pools": (2, 4)}, r"pools = \(2, 4\): must be some with 16 among them"),
        ({"pools": (16, 2)}, "pools"),
        ({"tries": 6}, r"tries = 6: must be an integer from 1 to 5"),
        ({"dissected": 1}, "dissected = 1"),
        ({"share": 0.0}, r"share = 0.0"),
    ],
)
def test_impossible_settings_are_refused_by_name(changes, names):
    with pytest.raises(ValueError, match=names):
        LargePools(**changes)
