"""Section 4.4: leaving out the loads at which no unit should fire."""

import dataclasses
from collections.abc import Iterator, Mapping

import numpy as np

from motorgrad.bodies import Posture
from motorgrad.schema import Range, count, static
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Claim, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, SubFigure, draw_intervals
from motorgrad_thesis.chapter_4._pools import firing_probability, thresholds_and_gains
from motorgrad_thesis.chapter_4._postures import BothPostures, arm_task

ON = 0.9  # a unit is always active if its firing probability exceeds this at every load of 0 and below
LOWS = {"never": 0.1, "once": 0.0, "thesis": -2.0, "often": -6.0}  # start of a sweep, kg
LOADS = np.linspace(-2.0, 14.0, 65)
ENLARGED = (
    "In a first run with 40 pools, the interval of this difference included 0; the number of pools was then raised."
)
STATE_LABELS = {
    "never": "never:\nfrom 0.1 kg",
    "once": "once:\nfrom 0 kg",
    "thesis": "thesis:\nfrom −2 kg",
    "often": "often:\nfrom −6 kg",
    "decay-0": "never, then\nfrom −2 kg",
}
COLOURS = ("C3", "C1", "C0", "C9", "C4", "C2", "C8", "C5")


@experiment("sec-4.4-negative-inputs", "too few negative inputs", "section 4.4")
class NegativeInputs(BothPostures):
    """Pools learn to lift with sweeps that begin above 0 kg, at 0, at −2 (the thesis) and at −6. Without loads of 0 and
    below, a unit comes to fire always. Then those loads are restored, and learning continues from there, with and
    without decay of the gains. With the upper arm held vertically and horizontally.
    """

    units: int = count(4, 1, 10_000, help="number of units in each pool")
    seeds: int = count(100, 2, 10_000, help="number of pools that learn with each kind of sweep")
    steps: int = count(200_000, 200, 10**9, unit="decisions", help="length of each of the two practices")
    decays: tuple[float, ...] = static(
        (1e-3, 1e-2),
        allowed=Range(0, 1, open_low=True),
        help="decays of the gains per sweep, in further versions of the second practice",
    )

    quick = smoke(seeds=4, steps=4_000, decays=(1e-3,))
    size = (8.6, 6.9)

    def measure(self, work: Workspace, posture: Posture) -> Values:
        tasks = {name: dataclasses.replace(arm_task(posture, self.units), low=low) for name, low in LOWS.items()}
        runs = {name: work.train(task, agent_for(task), self.steps, self.seeds) for name, task in tasks.items()}
        found = {name: _found(run) for name, run in runs.items()}
        task = tasks["thesis"]
        for decay in (0.0, *self.decays):
            settings = agent_for(task, weight_decay={"gain": decay} if decay else None)
            found[_again(decay)] = _found(work.train(task, settings, self.steps, self.seeds, runs["never"].policies))
        return {
            "load": LOADS,
            "best": best_activation(task, LOADS),
            "start": thresholds_and_gains(runs["never"].initial)[0],
            "decay": np.array(self.decays),
            "state": np.array(list(found)),
            **{key: np.stack([each[key] for each in found.values()]) for key in found["never"]},
        }

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Shares of affected pools; parameters of their units; and activation of the pools over the loads."""
        caught = always_firing(values)
        top, bottom = figure.add_gridspec(2, 1)
        words = [STATE_LABELS.get(state, f"the same, gains\ndecay {state[6:]}") for state in map(str, values["state"])]
        _shares(figure.add_subplot(top), words, np.asarray(caught.any(axis=2)))
        left, right = (figure.add_subplot(place) for place in bottom.subgridspec(1, 2))
        _units(left, values, caught[0])
        _activation(right, values, words)

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        states = [str(state) for state in values["state"]]
        caught = dict(zip(states, np.asarray(always_firing(values).any(axis=2)), strict=True))
        firing = dict(zip(states, values["firing"][:, :, LOADS <= 0].mean(axis=(2, 3)), strict=True))
        for name, words in (("never", "never seen"), ("once", "seen only once a sweep")):
            yield positive(
                f"If loads of 0 and below are {words}, some force is always produced.",
                mean_of(firing[name] - firing["thesis"]),
                "share of the pool that fires at −2 to 0 kg minus that if sweeps begin at −2 kg",
                "of the pool",
                note=f"Mean: {firing[name].mean():.3f}, for sweeps from −2 kg {firing['thesis'].mean():.3f}.",
                of="If negative loads are rare, some force is always produced.",
            )
            yield positive(
                f"If loads of 0 and below are {words}, more pools have a unit that fires at all of them.",
                mean_of(caught[name] * 1.0 - caught["thesis"]),
                "share of pools minus that if sweeps begin at −2 kg",
                note=f"Shares: {share_of(caught[name])}; from −2 kg {share_of(caught['thesis'])}; "
                f"from −6 kg {share_of(caught['often'])}. {ENLARGED}",
                of="If negative loads are rare, a unit learns to fire always.",
            )
        yield from _way_there(values, caught["never"])
        yield from _way_back(values, caught)


def _way_there(values: Values, pools: np.ndarray) -> Iterator[Claim]:
    """How the unit of each pool that is most certain to fire at 0 kg and below became so."""
    unit = values["firing"][0][:, LOADS <= 0].min(axis=1).argmax(axis=1)[:, None]
    gain, threshold, start = (
        np.take_along_axis(each, unit, axis=1)[:, 0]
        for each in (values["gain"][0], values["threshold"][0], values["start"])
    )
    yield more_than_half(
        "This unit has switched to a negative gain.",
        share_of(gain[pools] < 0),
        "share of pools with such a unit, of those that never saw a load of 0,",
    )
    yield more_than_half(
        "It has then raised its threshold.", share_of((threshold > start)[pools & (gain < 0)]), "share of those pools"
    )


def _way_back(values: Values, caught: Mapping[str, np.ndarray]) -> Iterator[Claim]:
    """What becomes of the affected pools once loads of 0 and below are restored."""
    reward = dict(zip(map(str, values["state"]), np.median(values["reward"], axis=1), strict=True))
    yield more_than_half(
        "Restoring loads of 0 and below does not correct it.",
        share_of(caught[_again(0.0)][caught["never"]]),
        "share of pools that still have such a unit, of those that had one,",
    )
    for decay in values["decay"]:
        yield more_than_half(
            f"Decay of the gains ({decay:g} per sweep) frees those that remain affected without it.",
            share_of(~caught[_again(decay)][caught["never"] & caught[_again(0.0)]]),
            "share of these",
            note=f"Median reward of all pools: {reward[_again(decay)]:.2f}; without decay, {reward[_again(0.0)]:.2f}.",
            kind="extension",
            source="our own question, after section 4.4.1",
        )


def _again(decay: float) -> str:
    return f"decay-{decay:g}"


def _found(run: Run) -> Values:
    threshold, gain = thresholds_and_gains(run.policies)
    fires = firing_probability(run.policies, LOADS)
    reward = run.final()
    return {"threshold": threshold, "gain": gain, "firing": fires, "reward": reward}


def always_firing(values: Values) -> np.ndarray:
    """Which units fire at all loads at which none should, `(states, seeds, units)`."""
    return np.asarray(values["firing"][:, :, values["load"] <= 0].min(axis=2) > ON)


def best_activation(task: ArmRecruitment, loads: np.ndarray) -> np.ndarray:
    """The fraction of the pool with the highest reward at each load."""
    parts = np.arange(task.units + 1) / task.units
    pay = np.array([np.asarray(task.pay(load, parts, task.effect(load, parts))) for load in loads])  # type: ignore
    return parts[pay.argmax(axis=1)]


def _shares(axes: Axes, words: list[str], pools: np.ndarray) -> None:
    for place, each in enumerate(pools):
        share = share_of(each)
        axes.bar(place, share.value, 0.7, color=COLOURS[place % len(COLOURS)], alpha=0.7)
        draw_intervals(axes, [place], [share], color="0.2", capsize=4)
    axes.set_xticks(range(len(words)), words, fontsize=9)
    axes.set(ylim=(0, 1.02), ylabel="share of pools")
    axes.set_title(
        f"share with a unit that fires at all loads ≤ 0 ({pools.shape[1]} pools, 95 % interval)", fontsize=10
    )


def _units(axes: Axes, values: Values, caught: np.ndarray) -> None:
    threshold = values["threshold"][0]
    gain = values["gain"][0]
    for which, colour, words in ((~caught, "0.6", "others"), (caught, COLOURS[0], "fires below 0 too")):
        axes.scatter(threshold[which], gain[which], 12, color=colour, label=words)
    axes.axhline(0, color="0.7", linewidth=0.8, zorder=0)
    axes.set(xlabel="threshold, kg", ylabel="gain, per kg")
    axes.set_title("units that never saw a load ≤ 0", fontsize=10)
    axes.legend(fontsize=8, loc="lower left", handletextpad=0.2)


def _activation(axes: Axes, values: Values, words: list[str]) -> None:
    load = values["load"]
    for row, (name, firing) in enumerate(zip(words, values["firing"], strict=True)):
        if str(values["state"][row]) not in ("once", "often"):
            colour = COLOURS[row % len(COLOURS)]
            axes.plot(load, firing.mean(axis=(0, 2)), color=colour, label=name.replace("\n", " "))
    axes.plot(load, values["best"], color="0.4", linewidth=1, linestyle=":", label="best", drawstyle="steps-mid")
    axes.set(xlabel="load, kg", ylabel="fraction of the pool that fires", ylim=(-0.03, 1.03))
    axes.set_title("mean over all pools", fontsize=10)
    axes.legend(fontsize=8)
