"""Section 4.4: what comes of leaving out the loads at which no unit should fire."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, Measured, mean_of, share_of
from motorgrad.experiments._curves import final
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_4._inputs_figure import draw_inputs
from motorgrad.experiments.chapter_4._pools import firing, numbers
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import Run, settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ON = 0.9  # fires with more than this probability at every load of 0 and below
LOWS = {"never": 0.1, "once": 0.0, "thesis": -2.0, "often": -6.0}  # kg, where a sweep begins
LOADS = np.linspace(-2.0, 14.0, 65)
ENLARGED = "In a first run, of 40 pools, the interval of this difference included 0; more pools were taken then."


@dataclasses.dataclass(frozen=True)
class NegativeInputs(Experiment):
    """Pools learn to lift with sweeps that begin above 0 kg, at 0, at −2 (the thesis) and at −6. Where loads of 0 and
    below are missing, a unit becomes one that always fires. Then those loads come back, and learning goes on from
    there, without and with a decay of the gains.

    **Arguments:**

    - `units`: in each pool.
    - `seeds`: pools that learn with each kind of sweep.
    - `steps` (decisions): for which each pool learns, and then learns on.
    - `decays` (per sweep): of the gains, in further ways of learning on.
    """

    name: ClassVar[str] = "sec-4.4-negative-inputs"
    title: ClassVar[str] = "too few negative inputs"
    source: ClassVar[str] = "section 4.4"

    units: int = 4
    seeds: int = 100
    steps: int = 200_000
    decays: tuple[float, ...] = (1e-3, 1e-2)

    def __post_init__(self) -> None:
        check(2 <= self.seeds <= 10_000, "seeds", self.seeds, "in 2 … 10,000")
        check(200 <= self.steps <= 10**9, "steps", self.steps, "in 200 … 1,000,000,000")
        for decay in self.decays:
            check(0 < decay <= 1, "decays", decay, "in (0, 1]")
        self.task("thesis")

    @classmethod
    def quick(cls) -> Self:
        return cls(seeds=4, steps=4_000, decays=(1e-3,))

    def task(self, inputs: str) -> ArmRecruitment:
        """The task with the inputs of this name."""
        return ArmRecruitment(units=self.units, low=LOWS[inputs])

    def run(self, work: Workspace) -> Values:
        runs = {
            name: work.train(self.task(name), settings_for(self.task(name)), self.steps, self.seeds) for name in LOWS
        }
        found, task = {name: _found(run) for name, run in runs.items()}, self.task("thesis")
        for decay in (0.0, *self.decays):
            settings = settings_for(task, weight_decays={"gain": decay} if decay else None)
            found[_again(decay)] = _found(work.train(task, settings, self.steps, self.seeds, runs["never"].policies))
        return {
            "load": LOADS,
            "best": best_activation(task, LOADS),
            "start": numbers(runs["never"].initial)[0],
            "decay": np.array(self.decays),
            "state": np.array(list(found)),
            **{key: np.stack([each[key] for each in found.values()]) for key in found["never"]},
        }

    def figure(self, values: Values) -> "Figure":
        return draw_inputs(values, stuck(values))

    def claims(self, values: Values) -> Sequence[Claim]:
        states = [str(state) for state in values["state"]]
        caught = dict(zip(states, np.asarray(stuck(values).any(axis=2)), strict=True))
        firing = dict(zip(states, values["firing"][:, :, LOADS <= 0].mean(axis=(2, 3)), strict=True))
        made = []
        for name, words in (("never", "never seen"), ("once", "seen only once a sweep")):
            more = mean_of(firing[name] - firing["thesis"])
            oftener = mean_of(caught[name] * 1.0 - caught["thesis"])
            made += [
                Claim(
                    f"Where loads of 0 and below are {words}, some force is always put out.",
                    "section 4.4",
                    "at −2 to 0 kg more of the pool fires than where sweeps begin at −2 kg: difference above 0",
                    more,
                    more.low > 0,
                    "of the pool",
                    f"Mean: {firing[name].mean():.3f}, from −2 kg {firing['thesis'].mean():.3f}.",
                ),
                Claim(
                    f"Where loads of 0 and below are {words}, more pools have a unit that fires at all of them.",
                    "section 4.4",
                    "a greater share than where sweeps begin at −2 kg: difference above 0",
                    oftener,
                    oftener.low > 0,
                    note=f"Shares: {share_of(caught[name])}; from −2 kg {share_of(caught['thesis'])}; "
                    f"from −6 kg {share_of(caught['often'])}. {ENLARGED}",
                ),
            ]
        return [*made, *_way_there(values, caught["never"]), *_way_back(values, caught)]


def _way_there(values: Values, pools: np.ndarray) -> list[Claim]:
    """Of the unit of each pool that is most sure to fire at 0 kg and below: how it came to be so."""
    unit = values["firing"][0][:, LOADS <= 0].min(axis=1).argmax(axis=1)[:, None]
    gain, threshold, start = (
        np.take_along_axis(each, unit, axis=1)[:, 0]
        for each in (values["gain"][0], values["threshold"][0], values["start"])
    )
    switched, raised = among(gain < 0, pools), among(threshold > start, pools & (gain < 0))
    return [
        Claim(
            "That unit has switched to a negative gain.",
            "section 4.4",
            "in most pools that have one, of those that never saw a load of 0",
            switched,
            switched.low > 0.5,
        ),
        Claim(
            "It has raised its threshold then.",
            "section 4.4",
            "in most of those pools",
            raised,
            raised.low > 0.5,
        ),
    ]


def _way_back(values: Values, caught: Mapping[str, np.ndarray]) -> list[Claim]:
    """What becomes of the pools that are caught once loads of 0 and below come back."""
    stay = among(caught[_again(0.0)], caught["never"])
    reward = dict(zip(map(str, values["state"]), np.median(values["reward"], axis=1), strict=True))
    made = [
        Claim(
            "Loads of 0 and below do not correct it when they come back.",
            "section 4.4",
            "most pools that had such a unit still have one",
            stay,
            stay.low > 0.5,
        )
    ]
    for decay in values["decay"]:
        free = among(~caught[_again(decay)], caught["never"] & caught[_again(0.0)])
        made.append(
            Claim(
                f"A decay of the gains ({decay:g} per sweep) frees those that stay caught without it.",
                "our own question, after section 4.4.1",
                "most of them",
                free,
                free.low > 0.5,
                note=f"Median reward of all pools: {reward[_again(decay)]:.2f}, without {reward[_again(0.0)]:.2f}.",
            )
        )
    return made


def _again(decay: float) -> str:
    return f"decay-{decay:g}"


def _found(run: Run) -> Values:
    threshold, gain = numbers(run.policies)
    fires, reward = firing(run.policies, LOADS), final(run, "reward")
    return {"threshold": threshold, "gain": gain, "firing": fires, "reward": reward}


def stuck(values: Values) -> np.ndarray:
    """Which units always fire where none should, `(states, seeds, units)`."""
    return np.asarray(values["firing"][:, :, values["load"] <= 0].min(axis=2) > ON)


def among(happened: np.ndarray, which: np.ndarray) -> Measured:
    """The share of those pools in which something happened; unknown where there are none."""
    return share_of(happened[which]) if which.any() else Measured(math.nan, 0.0, 1.0, 0, "share")


def best_activation(task: ArmRecruitment, loads: np.ndarray) -> np.ndarray:
    """The part of the pool that pays best at each load."""
    parts = np.arange(task.units + 1) / task.units
    pay = np.array([np.asarray(task.pay(load, parts, task.effect(load, parts))) for load in loads])  # type: ignore
    return parts[pay.argmax(axis=1)]
