"""Learning curves: the numbers drawn, what runs are called, and figures that are the same every time."""

import dataclasses
import re

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.axes import Axes

import motorgrad as mg
from motorgrad.training import Run, agent_for, agent_table, learning_curves
from motorgrad.training.plots._plot_curves import trailing_mean
from motorgrad.training.plots._plot_labels import folders_of, labels_of

TRAINED = {
    "chain": {"task": "chain", "steps": 60, "seeds": 5, "window": 10},
    "long": {"task": "chain", "steps": 90, "seeds": 5, "window": 10},
    "three-state": {"task": "three-state", "steps": 60, "seeds": 3, "window": 20},
    "hopper": {"task": "hopper", "steps": 300, "seeds": 3, "window": 25},
}
RANDOM = np.random.default_rng(0)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    made = {}

    def of(name):
        if name == "empty":  # stopped before its first record
            return dataclasses.replace(run_of([[0]], window=10), metrics=pa.table({}), decision=5)
        if name not in made:
            made[name] = mg.train(**TRAINED[name], out=tmp_path_factory.mktemp("runs") / name, progress=False)
        return made[name]

    return of


def run_of(values, window=10, period=1.0, name="made", done=1.0, path=None, **settings):
    """A run of these rewards, `(seeds, records)`, as `train` would give it."""
    values = np.asarray(values, np.float32)
    seeds, records = values.shape
    decision = window * np.arange(1, records + 1)
    columns = {
        "seed": np.tile(np.arange(seeds), records),
        "decision": np.repeat(decision, seeds),
        "simulated_time": np.repeat(decision * period, seeds),
        "wall_time": np.repeat(0.5 * np.arange(1.0, records + 1) ** 2, seeds),
        "reward": values.T.ravel(),
    }
    steps = round(window * records / done)
    config = {
        "run": {"steps": steps, "seeds": list(range(seeds)), "window": window},
        "task": {"name": name, **settings},
        "agent": {"initial": "0"},
    }
    return Run(config, window * records, pa.table(columns), None, None, path=path)  # type: ignore[arg-type]


def texts(path):
    """The words of an SVG, in the order in which they stand there."""
    return re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text())


# ---- numbers


def test_the_line_is_the_median_and_the_band_the_quartiles_over_seeds(trained):
    run = trained("chain")
    (curve,) = learning_curves([run]).curves
    decision, values = run.curve("reward")
    np.testing.assert_array_equal(curve.x, decision)
    np.testing.assert_array_equal(curve.values, values)
    np.testing.assert_array_equal(curve.quartiles, np.percentile(values, [25, 50, 75], axis=0))
    assert np.ptp(values, axis=0).any()


def test_what_is_drawn_are_these_numbers(trained):
    figure = learning_curves([trained("chain"), trained("long")], ["reward", "baseline"])
    assert len(figure.axes) == 2
    for axes, quantity in zip(figure.axes, ("reward", "baseline"), strict=True):
        lines = [line for line in axes.lines if not line.get_label().startswith("_")]
        curves = [curve for curve in figure.curves if curve.quantity == quantity]
        for line, curve in zip(lines, curves, strict=True):
            np.testing.assert_array_equal(line.get_xydata().T, [curve.x, curve.quartiles[1]])
        assert lines[0].get_color() != lines[1].get_color()
    assert figure.axes[0].get_shared_x_axes().joined(*figure.axes)


@pytest.mark.parametrize(("runs", "thin"), [(1, True), (3, True), (4, False)])
def test_single_seeds_are_drawn_where_there_are_few_runs(runs, thin):
    axes: Axes = learning_curves([run_of(RANDOM.random((4, 3)))] * runs).axes[0]
    assert (sum(line.get_linewidth() < 1 for line in axes.lines) == 4 * runs) == thin


def test_seeds_in_which_nothing_occurred_are_left_out_and_never_is_a_gap():
    nan = np.nan
    run = run_of([[1, nan, 1, nan, np.inf], [3, nan, nan, 5, 2], [5, nan, nan, nan, nan]])
    (curve,) = learning_curves([run]).curves
    np.testing.assert_array_equal(curve.quartiles[1], [3, nan, 1, 5, 2])
    np.testing.assert_array_equal(curve.seen, [3, 0, 1, 1, 1])
    assert curve.table()["median"] == [3, None, 1, 5, 2]


def test_a_point_that_is_no_line_is_drawn_as_a_dot():
    alone = learning_curves([run_of([[1, np.nan, 4, 5]])]).axes[0].lines[-1]
    np.testing.assert_array_equal(alone.get_xydata(), [[10, 1]])
    assert alone.get_marker() == "o"
    only = learning_curves([run_of([[1]])]).axes[0].lines[-1]
    assert len(only.get_xydata()) == 1


def test_what_never_occurred_says_so(tmp_path):
    never, some = run_of(np.full((2, 3), np.nan), a=1), run_of(np.ones((2, 3)), a=2)
    learning_curves([never], path=tmp_path / "never.svg")
    assert "never occurred" in texts(tmp_path / "never.svg")
    learning_curves([never, some], path=tmp_path / "both.svg")
    assert {"a 1 (reward never occurred)", "a 2"} <= set(texts(tmp_path / "both.svg"))


# ---- smoothing


@pytest.mark.ci
def test_smoothing_makes_the_means_that_a_longer_window_would_have_made(trained):
    short, long = trained("hopper"), mg.train(**{**TRAINED["hopper"], "window": 100}, progress=False)
    assert np.isnan(short.curve("apex")[1]).any()  # records without a hop weigh nothing
    for quantity in ("reward", "apex"):
        (smooth,) = learning_curves([short], quantity, smooth=1.0).curves
        np.testing.assert_allclose(smooth.values[:, 3::4], long.curve(quantity)[1], rtol=1e-5)
        assert not np.allclose(smooth.values[:, 3::4], short.curve(quantity)[1][:, 3::4])


def test_the_trailing_mean_weighs_what_it_spans():
    x, values = np.array([1.0, 2.0, 4.0, 9.0]), np.array([[1.0, 5.0, np.nan, 2.0], [0.0, 1.0, 2.0, 3.0]])
    weights = np.array([[1.0, 3.0, 2.0, 1.0]])
    found = trailing_mean(x, values, weights, 3.0)
    np.testing.assert_allclose(found, [[1, 4, 5, 2], [0, 0.75, 7 / 5, 3]])


@pytest.mark.parametrize(("period", "records"), [(0.01, 7), (0.1, 3), (1 / 3, 6)])
def test_a_multiple_of_the_record_is_that_many_records(period, records):
    values = RANDOM.random((2, 400))
    (curve,) = learning_curves([run_of(values, period=period)], smooth=records * 10 * period).curves
    for end in (records, 200, 400):
        np.testing.assert_allclose(curve.values[:, end - 1], values[:, end - records : end].mean(axis=1), rtol=1e-5)


def test_runs_of_different_records_are_smoothed_over_the_same_stretch(tmp_path):
    fine, coarse = run_of(RANDOM.random((2, 40)), 10, a=1), run_of(RANDOM.random((2, 8)), 50, a=2)
    figure = learning_curves([fine, coarse], smooth=100, path=tmp_path / "c.svg")
    first, second = figure.curves
    np.testing.assert_allclose(first.values[:, 19], fine.curve()[1][:, 10:20].mean(axis=1), rtol=1e-6)
    np.testing.assert_allclose(second.values[:, 3], coarse.curve()[1][:, 2:4].mean(axis=1), rtol=1e-6)
    said = texts(tmp_path / "c.svg")
    assert "median and quartiles over 2 seeds; records as in the legend; trailing mean over 100 decisions" in said
    assert {"a 1 (records of 10 decisions)", "a 2 (records of 50 decisions)"} <= set(said)


def test_the_figure_states_that_it_is_not_smoothed(tmp_path):
    learning_curves([run_of([[1, 2]])], path=tmp_path / "c.svg")
    assert "one seed; records of 10 decisions; not smoothed further" in texts(tmp_path / "c.svg")


# ---- axes


@pytest.mark.parametrize(
    ("names", "axis"),
    [
        (["hopper"], "simulated"),
        (["chain"], "decisions"),
        (["hopper", "chain"], "decisions"),
        (["chain"] * 2, "decisions"),
    ],
)
def test_x_is_simulated_time_by_default_where_the_task_knows_it(names, axis, trained):
    assert learning_curves([trained(name) for name in names]).axis == axis


@pytest.mark.parametrize(
    ("x", "column", "words"),
    [
        ("decisions", "decision", "decisions"),
        ("simulated", "simulated_time", "simulated time (s)"),
        ("wall", "wall_time", "wall time (s)"),
        ("cpu", "cpu_time", "processor time (s)"),
    ],
)
def test_x_is_what_was_asked_for(x, column, words, trained):
    run = trained("hopper")
    figure = learning_curves([run], x=x)
    np.testing.assert_array_equal(figure.curves[0].x, run.metrics[column].to_numpy()[::3])
    assert figure.axes[-1].get_xlabel() == words


def test_wall_time_goes_on_over_a_resume(tmp_path):
    settings = {"task": "chain", "seeds": 5, "window": 50, "out": tmp_path, "progress": False}
    before = learning_curves([mg.train(**settings, steps=100)], x="wall").curves[0].x
    after = learning_curves([mg.train(**settings, steps=200)], x="wall").curves[0].x
    np.testing.assert_array_equal(after[:2], before)
    assert (np.diff(after) > 0).all()
    assert before[0] > 0


def test_an_unfinished_run_says_how_far_it_is(tmp_path):
    learning_curves([run_of([[1, 2]], done=0.25)], path=tmp_path / "c.svg")
    assert "made (unfinished, 25 %)" in texts(tmp_path / "c.svg")


# ---- labels


def labels(*runs):
    return labels_of([run.config for run in runs], [run.path for run in runs])


def test_runs_are_called_by_the_settings_in_which_they_differ(tmp_path):
    a, b = (run_of([[1]], path=tmp_path / p / "demo", penalty=x, mass=2) for p, x in (("a", 0.1), ("b", 0.3)))
    assert labels(a, b) == ["penalty 0.1", "penalty 0.3"]
    deep = [run_of([[1]], body={"hip": {"mass": m}, "knee": {"mass": 1 + m}}) for m in (1, 2)]
    assert labels(*deep) == ["hip mass 1, knee mass 2", "hip mass 2, knee mass 3"]


def test_runs_that_settings_do_not_tell_apart_are_called_by_their_folders_too(tmp_path):
    one, two, three = (run_of([[1]], path=tmp_path / p / "demo", k=k) for p, k in (("a", 1), ("b", 1), ("c", 2)))
    assert labels(one, two) == ["a/demo", "b/demo"]
    assert labels(one, two, three) == ["a/demo (k 1)", "b/demo (k 1)", "c/demo (k 2)"]
    many = [run_of([[1]], path=tmp_path / p, **dict.fromkeys("abcd", p)) for p in "xy"]
    assert labels(*many) == ["x", "y"]
    assert labels(one) == ["demo"]
    assert labels(run_of([[1]]), run_of([[1]])) == ["made 1", "made 2"]


def test_runs_of_two_tasks_are_called_by_the_task(trained):
    assert labels(run_of([[1]], name="x", a=1), run_of([[1]], name="y", b=2)) == ["x", "y"]
    chain, other, states = (trained(name) for name in ("chain", "long", "three-state"))
    assert labels(chain, states) == ["chain", "three-state"]
    assert labels(chain, other) == ["chain", "long"]  # the folders: steps are no setting of theirs


def test_learners_are_called_by_the_kind_of_their_parts():
    task = mg.make("chain")
    runs = []
    for changes in ({"baseline": "mean"}, {"baseline": {"kind": "fixed-step", "rate": 0.1}}, {"decay": 0.3}):
        run = run_of([[1]])
        runs.append(dataclasses.replace(run, config={**run.config, "agent": agent_table(agent_for(task, changes))}))
    own = runs[0].config["agent"]["estimator"]["trace"]["decay"]
    assert labels(*runs) == [f"decay {own}, mean", f"decay {own}, fixed-step", "decay 0.3, mean"]


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/a/demo", "/b/demo"], ["a/demo", "b/demo"]),
        (["/a/x/demo", "/b/x/demo", "/c"], ["a/x/demo", "b/x/demo", "c"]),
        (["/demo", "/a/demo"], ["demo", "a/demo"]),
        (["/a/demo", "/a/b/../demo"], ["a/demo 1", "a/demo 2"]),
        (["/a/demo/"], ["demo"]),
    ],
)
def test_a_folder_is_called_by_the_shortest_end_that_is_its_own(paths, names):
    assert folders_of(paths) == names


def test_labels_may_be_given(tmp_path, trained):
    figure = learning_curves([trained("chain"), trained("long")], labels=["before", "after"], path=tmp_path / "c.svg")
    assert [curve.label for curve in figure.curves] == ["before", "after"]
    assert {"before", "after"} <= set(texts(tmp_path / "c.svg"))


# ---- files


@pytest.mark.representatives("svg")
@pytest.mark.parametrize("suffix", ["svg", "png", "pdf"])
def test_the_same_numbers_give_the_same_bytes(suffix, trained, tmp_path, monkeypatch):
    files = []
    for number in range(2):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", str(number))  # as if at another time
        files.append(tmp_path / f"{number}.{suffix}")
        learning_curves([trained("chain"), trained("long")], ["reward", "baseline"], files[-1])
    assert files[0].read_bytes() == files[1].read_bytes()
    learning_curves([trained("chain")], path=files[1])
    assert files[0].read_bytes() != files[1].read_bytes()


@pytest.mark.ci
@pytest.mark.representatives("c-svg-c.svg-<?xml", ".-None-reward-baseline.png-\\x89PNG")
@pytest.mark.parametrize(
    ("path", "format", "file", "start"),
    [
        ("c.svg", None, "c.svg", b"<?xml"),
        ("c.PDF", None, "c.PDF", b"%PDF"),
        ("c", None, "c.png", b"\x89PNG"),
        ("c", "svg", "c.svg", b"<?xml"),
        ("c.v2", "pdf", "c.v2.pdf", b"%PDF"),
        ("deep/in/c.png", "png", "deep/in/c.png", b"\x89PNG"),
        (".", None, "reward-baseline.png", b"\x89PNG"),
        (".", "svg", "reward-baseline.svg", b"<?xml"),
    ],
)
def test_the_format_is_the_suffix_or_what_is_asked_for(path, format, file, start, trained, tmp_path):
    figure = learning_curves([trained("chain")], ["reward", "baseline"], tmp_path / path, format=format)
    assert figure.saved == tmp_path / file
    assert figure.saved.read_bytes().startswith(start)


def test_a_run_draws_into_its_directory(trained):
    run = trained("hopper")
    figure = run.plot(["reward", "apex"], smooth=100.0, labels=["mine"], format="svg", x="wall")
    assert figure.saved == run.path / "figures" / "reward-apex.svg"
    assert {"mine", "wall time (s)"} <= set(texts(figure.saved))
    assert run_of([[1, 2]]).plot().saved is None


@pytest.mark.ci
def test_a_notebook_shows_the_figure_once(trained):
    formatter = pytest.importorskip("IPython.core.formatters", reason="needs IPython").DisplayFormatter()
    shown, _ = formatter.format(trained("chain").plot())
    assert set(shown) == {"text/plain", "image/png"}
    assert shown["image/png"].startswith(b"\x89PNG")


# ---- refusals

REFUSED = [
    (["chain"], {"quantity": "rewards"}, "unknown quantity 'rewards': did you mean 'reward'"),
    (["chain"], {"quantity": []}, "quantity = []: must be one column or more"),
    (["chain"], {"quantity": ["reward", "reward"]}, "none of them twice"),
    (["hopper", "chain"], {"quantity": "apex"}, "chain: unknown quantity 'apex'"),
    (["chain", "empty"], {}, "has no records yet: one takes 10 decisions, it has made 5"),
    (["empty"], {}, "has no records yet"),
    ([], {}, "runs = []: must be at least one run"),
    (
        ["chain"],
        {"x": "simulated"},
        "x = 'simulated': must be decisions, wall or cpu: the task chain has no simulated time",
    ),
    (["hopper", "chain"], {"x": "simulated"}, "the task chain has no simulated time"),
    (["chain"], {"x": "wal"}, "unknown x 'wal': did you mean 'wall'"),
    (["chain"], {"smooth": 0}, "smooth = 0: must be a positive number"),
    (["chain"], {"smooth": float("nan")}, "smooth = nan"),
    (["chain"], {"smooth": 10}, "smooth = 10: must be more than a record, which is 10 decisions"),
    (["hopper"], {"smooth": 0.2}, "more than a record, which is 0.25 s of simulated time"),
    (["chain", "long"], {"labels": ["a"]}, "labels = ['a']: must be 2 different words"),
    (["chain", "long"], {"labels": ["a", "a"]}, "2 different words"),
    (["chain"], {"path": "c.bmp"}, "unknown format 'bmp'"),
    (["chain"], {"path": "c.png", "format": "svg"}, "format = 'svg': must be 'png', as the suffix of c.png says"),
    (["chain"], {"format": "sgv", "path": "c"}, "unknown format 'sgv': did you mean 'svg'"),
]


@pytest.mark.parametrize(("names", "options", "words"), REFUSED, ids=[words[:50] for *_, words in REFUSED])
def test_what_cannot_be_drawn_is_refused_before_a_file_is_made(names, options, words, trained, tmp_path):
    runs = [trained(name) for name in names]
    with pytest.raises(ValueError, match=re.escape(words)):
        learning_curves(runs, **{"path": "c.png", **options})
    assert not list(tmp_path.iterdir())
