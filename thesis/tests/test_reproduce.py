"""Reproducing experiments: records, resuming, refusals, the report and the command."""

import dataclasses
import json
import re
import shutil
import signal
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

from motorgrad.cli import main
from motorgrad.statistics import Measured, exact, mean_of, median_of, share_of
from motorgrad.training import RunWarning
from motorgrad.worlds import FiniteMDP, chain
from motorgrad_thesis import (
    EXPERIMENTS,
    Experiment,
    above,
    at_least,
    at_most,
    below,
    in_every,
    reproduce,
    select_experiments,
    within,
    write_report,
)
from motorgrad_thesis.chapter_4.figure_4_9 import EXPLORERS, doublings, first_reward_times


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    """A folder in which the coin is reproduced."""
    folder = tmp_path_factory.mktemp("reproduced")
    reproduce(Coin(), folder, progress=False)
    return folder


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@dataclasses.dataclass(frozen=True)
class Coin(Experiment):
    """Throw a coin <so> many times."""

    name = "coin"
    title = "a coin & its faces"
    source = "figure 9.9"
    throws: int = 400
    stop: bool = False

    made = []  # noqa: RUF012 (what has been made, over all runs)

    def run(self, work):
        heads = work.part("heads", lambda: self._throw("heads"))
        if self.stop:
            raise KeyboardInterrupt
        return heads | work.part("tails", lambda: self._throw("tails"))

    def _throw(self, face):
        self.made.append(face)
        return {face: np.random.default_rng(len(face)).random(self.throws) < 0.5}

    def figure(self, values):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(1, 1))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.hist(values["heads"].astype(float))
        axes.set_axis_off()  # to draw ticks takes longest
        return figure

    def claims(self, values):
        share = share_of(values["heads"])
        return [
            within(0.4, 0.6, "A coin is fair.", share),
            in_every("It always shows <heads>.", values["heads"], note="It does not.", source="hearsay"),
            above(share.value, "It shows more.", share),
        ]


@pytest.fixture(autouse=True)
def _nothing_made():
    Coin.made.clear()


# verdicts


def measured(low, high, level=0.95):
    return Measured((low + high) / 2, low, high, 10, "mean", level)


@pytest.mark.parametrize(("low", "high", "verdict"), [
    (1.1, 2.0, "holds"), (0.1, 0.9, "refuted"), (0.5, 1.5, "undecided"),
    (1.0, 2.0, "undecided"), (0.0, 1.0, "undecided"), (1.0, 1.0, "undecided"),
    (-np.inf, np.inf, "undecided"), (1.1, np.inf, "holds"), (np.nan, np.nan, "undecided"),
])  # fmt: skip
def test_a_verdict_is_the_intervals_place_about_the_bound(low, high, verdict):
    opposite = {"holds": "refuted", "refuted": "holds", "undecided": "undecided"}[verdict]
    assert above(1, "It is more.", measured(low, high)).verdict == verdict
    assert below(1, "It is less.", measured(low, high)).verdict == opposite
    assert above(-1, "It is more.", measured(-high, -low)).verdict == opposite


@pytest.mark.parametrize(
    ("value", "verdict"), [(1.1, "holds"), (1.0, "refuted"), (0.9, "refuted"), (np.nan, "undecided")]
)
def test_what_is_exact_is_decided(value, verdict):
    assert above(1, "It is more.", exact(value)).verdict == verdict


def test_a_closed_bound_belongs_to_its_range():
    assert at_least(1, "It is no less.", measured(1, 2)).holds
    assert at_most(1, "It is no more.", measured(0, 1)).holds
    assert [within(0, 1, "It is there.", measured(*ends)).verdict for ends in ((0, 1), (-1, 0.5), (2, 3), (-1, 2))] == [
        "holds", "undecided", "refuted", "undecided",
    ]  # fmt: skip


def test_an_interval_short_of_its_level_decides_nothing():
    few, enough = [2.0] * 5, [2.0] * 6
    assert above(1, "It is more.", median_of(few)).verdict == "undecided"
    assert above(1, "It is more.", median_of(enough)).verdict == "holds"
    assert below(1, "It is less.", median_of(few)).verdict == "undecided"
    assert above(1, "It is more.", mean_of([2.0])).verdict == "undecided"


def test_nobody_decides_nothing():
    assert above(0.5, "Most do.", share_of([])).verdict == "undecided"


def test_every_seed_is_a_fact_about_the_seeds_at_hand():
    assert in_every("All do.", [True] * 3).verdict == "holds"
    assert in_every("All do.", [True, True, False]).verdict == "refuted"
    assert in_every("All do.", [True] * 3).finding == "1, share of 3"


def test_the_criterion_is_said_by_quantity_bound_and_direction():
    found = measured(0, 1)
    said = [
        claim.criterion
        for claim in (
            above(0.5, "", found, "share of seeds"), at_least(-0.02, "", found), below(1, "", found, "ratio"),
            at_most(1e-9, "", found), within(-0.05, 0.05, "", found), within(2, 20, "", found, "gain"),
            in_every("", [True]),
        )
    ]  # fmt: skip
    assert said == [
        "share of seeds above 0.5", "at least −0.02", "ratio below 1", "at most 1e−09", "within ±0.05",
        "gain between 2 and 20", "share of these seeds equal to 1",
    ]  # fmt: skip


# a reproduction


def test_a_reproduction_leaves_figure_claims_and_provenance(tmp_path):
    done = reproduce(Coin(), tmp_path, progress=False)
    assert [claim.verdict for claim in done.claims] == ["holds", "refuted", "undecided"]
    assert [claim.source for claim in done.claims] == ["figure 9.9", "hearsay", "figure 9.9"]
    record = json.loads((tmp_path / "coin" / "record.json").read_text())
    assert record == json.loads(json.dumps(done.record()))
    assert record["settings"] == {"throws": 400, "stop": False}
    assert record["claims"][0]["measured"]["count"] == 400
    assert [claim["verdict"] for claim in record["claims"]] == ["holds", "refuted", "undecided"]
    assert record["versions"]["mujoco"] == "4.0.0"
    assert record["seconds"] > 0
    assert done.figure.read_text().startswith("<?xml")
    assert (tmp_path / "coin" / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_finished_work_is_not_done_again(tmp_path):
    first = reproduce(Coin(), tmp_path, progress=False)
    picture = first.figure.read_bytes()
    second = reproduce(Coin(), tmp_path, progress=False)
    assert Coin.made == ["heads", "tails"]
    assert second.record() == first.record()
    assert second.figure.read_bytes() == picture


def test_an_interrupted_experiment_goes_on_with_its_finished_parts(tmp_path, monkeypatch):
    @dataclasses.dataclass(frozen=True)
    class Stopped(Coin):
        """Stops once."""

        def run(self, work):
            if len(self.made) == 1:
                return super().run(work)
            work.part("heads", lambda: self._throw("heads"))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(Stopped(), tmp_path, progress=False)
    (session,) = json.loads((tmp_path / "coin" / "provenance.json").read_text())["sessions"]
    done = reproduce(Stopped(), tmp_path, progress=False)
    assert Coin.made == ["heads", "tails"]
    assert done.seconds > session["seconds"]
    assert len(done.sessions) == 2


def test_versions_of_all_sessions_are_kept_and_a_change_is_said(tmp_path):
    reproduce(Coin(), tmp_path, progress=False)
    file = tmp_path / "coin" / "provenance.json"
    file.write_text(file.read_text().replace('"mujoco": "4.0.0"', '"mujoco": "3.9.9"'))
    with pytest.warns(RunWarning, match=r"mujoco was 3\.9\.9 and is now 4\.0\.0"):
        done = reproduce(Coin(), tmp_path, progress=False)
    assert done.record()["versions"]["mujoco"] == "3.9.9"


@pytest.mark.parametrize("name", ["values.npz", "parts/heads.npz", "provenance.json"])
def test_a_damaged_file_is_named(name, tmp_path):
    reproduce(Coin(), tmp_path, progress=False)
    (tmp_path / "coin" / name).write_bytes(b"nothing of use")
    if name.startswith("parts"):
        (tmp_path / "coin" / "values.npz").unlink()
    with pytest.raises(ValueError, match=rf"{name}: damaged"):
        reproduce(Coin(), tmp_path, progress=False)


def test_a_damaged_record_is_named_by_the_report(tmp_path):
    reproduce(Coin(), tmp_path, progress=False)
    (tmp_path / "coin" / "record.json").write_bytes(b"nothing of use")
    with pytest.raises(ValueError, match=r"record.json: damaged"):
        write_report(tmp_path, EXPERIMENTS)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("record.json", lambda found: [], "it = [], not a table"),
        ("record.json", lambda found: found.pop("claims"), "the file has no 'claims'"),
        ("record.json", lambda found: found["claims"][0].pop("verdict"), "claims[0] has no 'verdict'"),
        ("record.json", lambda found: found.update(claims=7), "claims = 7, not a list"),
        ("record.json", lambda found: found.update(seconds="long"), "seconds = 'long', not a number"),
        ("record.json", lambda found: found.update(quick=1), "quick = 1, not true or false"),
        ("record.json", lambda found: found["versions"].update(jax=None), "versions.jax = None, not a text"),
        ("record.json", lambda found: found.update(name="../coin"), "name = '../coin', not that of its folder"),
        ("provenance.json", lambda found: [], "it = [], not a table"),
        ("provenance.json", lambda found: found.pop("sessions"), "the file has no 'sessions'"),
        ("provenance.json", lambda found: found.update(sessions=[3]), "sessions[0] = 3, not a table"),
        ("provenance.json", lambda found: found["sessions"][0].pop("trained"), "sessions[0] has no 'trained'"),
        ("provenance.json", lambda found: found["sessions"][0].update(seconds=True), "seconds = True, not a number"),
    ],
)
def test_what_a_record_lacks_is_named(name, change, said, reproduced, tmp_path):
    folder = tmp_path / "coin"
    shutil.copytree(reproduced / "coin", folder)
    found = json.loads((folder / name).read_text())
    other = change(found)
    (folder / name).write_text(json.dumps(other if other == [] else found))
    with pytest.raises(ValueError, match=rf"{re.escape(str(folder / name))}: .*{re.escape(said)}") as told:
        write_report(tmp_path, ["coin"]) if name == "record.json" else reproduce(Coin(), tmp_path, progress=False)
    assert "\n" not in str(told.value)
    assert "reproduce the experiment again" in str(told.value)


def test_a_figure_that_is_gone_is_named(reproduced, tmp_path):
    shutil.copytree(reproduced / "coin", tmp_path / "coin")
    (tmp_path / "coin" / "figure.svg").unlink()
    with pytest.raises(ValueError, match=r"figure\.svg: missing: reproduce the experiment again"):
        write_report(tmp_path, ["coin"])


def test_values_of_another_version_are_named(tmp_path):
    reproduce(Coin(), tmp_path, progress=False)
    np.savez(tmp_path / "coin" / "values.npz", other=np.zeros(1))
    with pytest.raises(ValueError, match=r"values.npz: holds no 'heads': made by another version; delete the folder"):
        reproduce(Coin(), tmp_path, progress=False)


def test_other_settings_in_the_same_folder_are_refused_by_name(tmp_path):
    reproduce(Coin(), tmp_path, progress=False)
    with pytest.raises(ValueError, match=r"coin with throws = 400, not 300: use another folder"):
        reproduce(Coin(throws=300), tmp_path, progress=False)
    assert json.loads((tmp_path / "coin" / "record.json").read_text())["settings"]["throws"] == 400


def test_one_folder_serves_one_process_at_a_time(tmp_path):
    @dataclasses.dataclass(frozen=True)
    class Twice(Coin):
        """Reproduces itself while it runs."""

        def run(self, work):
            with pytest.raises(RuntimeError, match="in use by another process"):
                reproduce(Coin(), tmp_path, progress=False)
            return super().run(work)

    reproduce(Twice(), tmp_path, progress=False)


# the report


class Page(HTMLParser):
    """Collects the tags and the text of a page, and refuses one whose tags do not close."""

    def __init__(self, text):
        super().__init__()
        self.open, self.found, self.words = [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_the_report_is_one_page_with_everything_in_it(tmp_path):
    reproduce(Coin(), tmp_path, progress=False)
    reproduce(EXPERIMENTS["fig-2.1"](), tmp_path, quick=True, progress=False)
    page = Page(write_report(tmp_path, EXPERIMENTS).read_text())
    text = " ".join("".join(page.words).split())
    assert "1 of 3 claims hold, 1 refuted, 1 undecided" in text
    assert "a coin & its faces" in text
    assert "Throw a coin <so> many times." in text
    assert "It always shows <heads>." in text
    assert "A smoke test" in text
    assert [a["id"] for tag, a in page.found if tag == "section"] == ["fig-2.1", "coin"]
    pictures = [a for tag, a in page.found if tag == "img"]
    assert all(a["src"].startswith("data:image/svg+xml;base64,") and a["alt"] for a in pictures)
    links = {a["href"] for tag, a in page.found if tag == "a"}
    assert links == {"#fig-2.1", "#coin"}  # nothing is fetched from elsewhere


# the registry


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_says_what_it_is(name):
    kind = EXPERIMENTS[name]
    assert dataclasses.is_dataclass(kind)
    assert kind.__dataclass_params__.frozen
    experiment = kind()
    assert experiment.name == name
    assert experiment.title
    assert len(experiment.summary) > 40
    assert re.fullmatch(r"(beyond )?(figure|section) [0-9A]\.[0-9.]*[0-9]", experiment.source)
    kind_of_source, number = experiment.source.rsplit(" ", 1)
    place = {"figure": "fig", "section": "sec", "beyond section": "beyond"}[kind_of_source] + f"-{number.lower()}"
    assert re.fullmatch(rf"{re.escape(place)}(-[a-z]+)*", name)
    assert kind.quick() == kind.quick()


def test_experiments_stand_in_the_order_of_the_source():
    def place(name):
        numbers = name.split("-")[1].split(".")
        return [99 if part == "a" else int(part) for part in numbers]

    parts = [place(name)[0] for name in EXPERIMENTS]
    assert parts == sorted(parts)


def test_parts_and_all_choose_experiments():
    assert select_experiments(["all"], EXPERIMENTS) == list(EXPERIMENTS)
    assert select_experiments(["chapter-3", "FIG-2.1"], EXPERIMENTS) == [
        "fig-2.1",
        "sec-3.1-newton",
        "fig-3.1",
        "sec-3.2.1",
        "sec-3.2.1-criteria",
        "sec-3.2.2-accurate",
    ]
    with pytest.raises(ValueError, match=r"unknown experiment 'fig-4.11': did you mean 'fig-4.1'\?"):
        select_experiments(["fig-4.11"], EXPERIMENTS)


# the command


@pytest.mark.ci
def test_the_command_reproduces_and_reports(capsys):
    assert main(["reproduce", "fig-2.1", "fig-4.9", "--quick", "--json", "found.json"]) == 0
    shown = capsys.readouterr().out
    assert "figure 4.9, waiting for a first reward: " in shown
    assert "report: runs/reproduce-quick/report.html" in shown
    with open("found.json") as file:
        found = json.load(file)
    assert [each["name"] for each in found["experiments"]] == ["fig-2.1", "fig-4.9"]


@pytest.mark.ci
def test_settings_of_one_experiment_are_options(capsys):
    assert main(["reproduce", "fig-4.9", "--quick", "--settings.longest", "6", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["experiments"][0]["settings"] == {"longest": 6, "runs": 200, "seed": 0}


@pytest.mark.slow
def test_a_file_names_the_experiment_and_its_settings(tmp_path, capsys):
    (tmp_path / "e.toml").write_text('experiments = ["fig-4.9"]\nquick = true\n[settings]\nlongest = 8\n')
    assert main(["reproduce", "--config", "e.toml", "--settings.seed", "3", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["experiments"][0]["settings"] == {"longest": 8, "runs": 200, "seed": 3}
    again = "motorgrad reproduce fig-4.9 --quick --settings.longest 8 --settings.seed 3"
    assert found["experiments"][0]["command"] == again


@pytest.mark.ci
def test_a_strict_run_fails_where_a_claim_does():
    assert main(["reproduce", "fig-4.9", "--quick", "--settings.longest", "6", "--strict"]) == 1


def test_settings_need_a_single_experiment(capsys):
    assert main(["reproduce", "fig-4.9", "fig-2.1", "--settings.runs", "50"]) == 2
    assert "settings = " in capsys.readouterr().err
    with pytest.raises(SystemExit, match="0"):
        main(["reproduce", "--quick", "fig-4.9", "--settings.runs", "50", "--check"])
    assert "runs = 50" in capsys.readouterr().out


def test_no_name_and_impossible_settings_are_refused(capsys):
    assert main(["reproduce"]) == 2
    assert main(["reproduce", "fig-4.9", "--settings.longest", "99"]) == 2
    assert "longest = 99: must be an integer from 6 to 20" in capsys.readouterr().err


@pytest.mark.ci
def test_a_killed_reproduction_goes_on(tmp_path):
    command = [sys.executable, "-m", "motorgrad", "reproduce", "fig-4.9", "--quick", "--settings.longest", "8"]
    first = subprocess.Popen([*command, "--out", "killed"], stderr=subprocess.PIPE, text=True)
    for line in first.stderr:
        if "reset" in line:  # the first part is finished, the second has begun
            first.send_signal(signal.SIGKILL)
            break
    first.wait()
    first.stderr.close()
    part = tmp_path / "killed" / "fig-4.9" / "parts" / "walk.npz"
    age = part.stat().st_mtime_ns
    subprocess.run([*command, "--out", "killed"], check=True, capture_output=True)
    subprocess.run([*command, "--out", "whole"], check=True, capture_output=True)
    assert part.stat().st_mtime_ns == age
    for name in ("values.npz",):
        one, other = (np.load(tmp_path / out / "fig-4.9" / name) for out in ("killed", "whole"))
        assert set(one.files) == set(other.files)
        assert all(np.array_equal(one[key], other[key]) for key in one.files)


# figure 4.9


def expected_wait(mdp: FiniteMDP) -> float:
    """The mean of the first passage under random actions, by linear algebra."""
    matrix = mdp.transitions.mean(0)
    inner = np.flatnonzero(mdp.rewards == 0)
    return np.linalg.solve(np.eye(len(inner)) - matrix[np.ix_(inner, inner)], np.ones(len(inner)))[0]


@pytest.mark.parametrize("length", [2, 3, 6, 9])
def test_the_formulas_are_those_of_the_chain(length):
    for name in ("walk", "reset"):
        np.testing.assert_allclose(EXPLORERS[name][2](length), expected_wait(chain(length, name)))
    # an episode of N − 1 decisions sees the reward only by N − 1 right moves
    assert EXPLORERS["cut"][2](length) == (length - 1) * 2 ** (length - 1)


def test_no_first_reward_is_sooner_than_the_shortest_way():
    waits = first_reward_times(chain(5, "walk"), 500, seed=3)
    assert waits.min() == 4
    assert np.all(waits % 2 == 0) or waits.max() > 4
    cut = first_reward_times(chain(5, "walk"), 500, seed=3, limit=4)
    assert np.all(cut % 4 == 0)


def test_doublings_tell_exponential_from_square():
    lengths = np.arange(2, 13)
    exponential = np.repeat(2.0 ** lengths[:, None], 100, axis=1)
    square = np.repeat(lengths[:, None] * (lengths[:, None] - 1.0), 100, axis=1)
    assert doublings(exponential).value == 1
    assert doublings(square).value < 0.3
