"""Section 5.4: inputs that tell nothing."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Range, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, Run
from motorgrad_thesis._claims import Claim, above, below, positive
from motorgrad_thesis._experiment import Values, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_5._hopper_study import HIGH
from motorgrad_thesis.chapter_5._hopper_variants import COLOURS, HopperVariants, draw_practice

SENSORS = 3
NOISE_VARIANCE = 1 / 3  # of a number from U[−1, 1)
INFLUENCE = 0.1
"""Standard deviation of an input's part of a unit's potential, relative to that of all sensors, below which it counts
as having no effect on the selection of actions."""


@experiment("sec-5.4-inputs", "inputs that tell nothing", "section 5.4")
class NoiseInputs(HopperVariants):
    """Hoppers learn with three sensors and further inputs of pure noise, whose number varies: heights of hops during
    practice and those of the frozen policies, and how much the noise moves the potentials of the units, compared with
    the sensors.
    """

    reading: ClassVar[str] = (
        'The thesis says that inputs which "do not correlate with abnormal reward have no effect on action selection". '
        "We test it with independent random numbers, and take no effect to mean that together they move the "
        f"potentials of the units by less than {INFLUENCE:g} of what the sensors do."
    )

    numbers: tuple[int, ...] = static(
        (0, 3, 10, 30),
        allowed=Range(0, 1000, kind="int"),
        help="numbers of inputs of noise, rising, 0 first",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("numbers", 2)
        right = self.numbers[0] == 0 and len(self.numbers) <= len(COLOURS)
        check(right, "numbers", self.numbers, f"0 first, and at most {len(COLOURS)}, to have colours")

    quick = smoke(seconds=6.0, seeds=2, watched=2.0, numbers=(0, 10))

    @property
    def variants(self) -> Mapping[str, Hopper]:
        return {f"{each}": dataclasses.replace(self.task, noise_inputs=each) for each in self.numbers}

    def measured(self, task: Hopper, run: Run, outcome: Evaluation) -> Values:
        """Also `noise` `(seeds,)`: the standard deviation of what the noise adds to the potential of a unit over that
        of what the sensors add while the hopper hops, mean of the two units."""
        policies: Any = run.policies
        assert outcome.sensors is not None
        sensed = outcome.sensors
        contact = np.where(sensed["foot_contact"] > 0, 1.0, -1.0)
        seen = np.stack([contact, sensed["knee_angle"], task.velocity_scale * sensed["knee_velocity"]], axis=-1)
        weights = np.asarray(policies.weights)
        sensors = np.einsum("sdi,sui->sdu", seen, weights[:, :, :SENSORS]).std(axis=1)
        noise = np.sqrt(np.sum(weights[:, :, SENSORS:] ** 2, axis=2) * NOISE_VARIANCE)
        return {**super().measured(task, run, outcome), "noise": (noise / sensors).mean(axis=1)}

    def figure(self, values: Values) -> Figure:
        """Heights during practice; and against the number of inputs, practice until hops are high, height of the frozen
        policies, and influence of the noise."""
        names = [str(name) for name in values["variants"]]
        figure, ((practice, passed), (heights, noise)) = subplots(9.5, 7.0, 2, 2)
        draw_practice(practice, values, {name: name for name in names})
        practice.legend(title="inputs of noise", fontsize=8.5, title_fontsize=8.5)
        places = np.arange(len(names))
        for axes, quantity, words in (
            (passed, "passed", f"practice until hops pass {HIGH} m (s)"),
            (heights, "height", "height of hops, frozen (m)"),
            (noise, "noise", "noise in a unit's potential,\nrelative to the sensors"),
        ):
            found = np.stack([values[f"{name} {quantity}"] for name in names])
            spread = np.linspace(-0.15, 0.15, found.shape[1])
            axes.plot(places[:, None] + spread, found, "o", color="0.7", markersize=3.5, markeredgewidth=0)
            draw_intervals(axes, places, [mean_of(each) for each in found], fmt="o-", color="black", markersize=5)
            axes.set_xticks(places, names)
            axes.set(xlabel="inputs of noise, beside three sensors", ylabel=words, ylim=(0, None))
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        none, *_, most = (str(name) for name in values["variants"])
        heights, passed, noise = (
            ", ".join(f"{np.median(values[f'{name} {quantity}']):.3g} with {name}" for name in values["variants"])
            for quantity in ("height", "passed", "noise")
        )
        yield below(
            INFLUENCE,
            "Inputs that do not correlate with reward have no effect on the selection of actions.",
            mean_of(values[f"{most} noise"]),
            f"standard deviation of what {most} inputs of noise add to a potential, relative to the sensors' part",
            note=f"Medians: {noise}. The weights of such inputs have no drift, but every reward moves them at random.",
        )
        yield above(
            HIGH,
            f"Policy gradients cope with many inputs: with {most} of noise beside three sensors, hopping is learned.",
            mean_of(values[f"{most} height"]),
            f"frozen, after {self.seconds:g} s of practice: height of hops",
            "m",
            note=f"Medians in m: {heights}.",
        )
        yield positive(
            "Inputs of noise delay learning.",
            mean_of(values[f"{most} passed"] - values[f"{none} passed"]),
            f"practice until hops pass {HIGH} m: how much longer with {most}",
            "s",
            note=f"Medians in s: {passed}. A seed that never passes counts with the whole practice.",
            kind="extension",
        )
