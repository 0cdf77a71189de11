"""Figure 5.9: the biomimetic hexapod, and the requirements on its feet."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np

from motorgrad.bodies import LEGS, Hexapod, Hinge, LegState, OnTerrain, Terrain, Walk, biomimetic_hexapod, walk
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of, per_case
from motorgrad_thesis._claims import Claim, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, new_figure
from motorgrad_thesis.chapter_5.hexapod._drawing import TOUCH, Places, draw_view, name_part

SECTION = "section 5.4.1"
HIND_SECTIONS = ("middle", "rear")
START = 2.0  # s
FRONT_FEET = [LEGS.index(leg) for leg in LEGS if leg.endswith("front")]
HIND_FEET = [number for number in range(len(LEGS)) if number not in FRONT_FEET]
COLOURS = {"front": "#0072B2", "behind": "#D55E00"}
FEET_LABELS = {"front": "front feet", "behind": "middle and rear feet"}


@experiment("fig-5.9", "the biomimetic hexapod", "figure 5.9")
class BiomimeticHexapod(Experiment):
    """The hexapod whose legs have different functions, drawn from its model. Under the fixed controller, over bumps:
    its speed for several frictions of the front feet and of the others; the slip of the latter; and its walk with front
    legs that rise less in the swing.
    """

    reading: ClassVar[str] = (
        "The fixed controller is read as for figure 5.7: legs that wait count as supporting the body."
    )

    frictions: tuple[float, ...] = static(
        (0.2, 0.4, 0.8, 1.6),
        allowed=Range(0, open_low=True),
        help="friction coefficients of the feet, rising, at least two",
    )
    highest: float = number(0.0, 0, 45, unit="degrees", help="elevation of front legs that are not clear in the swing")
    height: float = number(0.1, 0, 1, open_low=True, unit="m", help="height of the bumps; each seed has its own ground")
    seconds: float = number(
        10.0, 1, 15, unit="simulated s", help="length of each walk, after two seconds that do not count"
    )
    seeds: int = count(20, 2, 1000, help="number of walks of each body")

    def validate(self) -> None:
        super().validate()
        self.check_rising("frictions", 2)

    quick = smoke(frictions=(0.4, 1.6), seconds=2.0, seeds=2)

    def bodies(self) -> dict[str, Hexapod]:
        """The bodies that walk, by name, which includes a friction that differs from the body's own."""
        body = biomimetic_hexapod("servos")
        rough = with_friction(body, ("front",), self.frictions[-1])
        made = {"as it is": body, "plain": Hexapod(drive="servos"), "low": with_low_front(body, self.highest)}
        made["rough low"] = with_low_front(rough, self.highest)
        for friction in self.frictions:
            made[f"front {friction:g}"] = with_friction(body, ("front",), friction)
            made[f"behind {friction:g}"] = with_friction(body, HIND_SECTIONS, friction)
        return made

    def run(self, work: Workspace) -> Values:
        found: Values = {"friction": np.array(self.frictions)}
        for name, body in self.bodies().items():
            seen = work.part(name, lambda b=body: walk_on_bumps(b, self.height, self.seeds, self.seconds, work.threads))
            found |= {f"{name} {quantity}": each for quantity, each in seen.items()}
        return found

    def figure(self, values: Values) -> Figure:
        """Side and top view; speed and slip over the friction of the feet; clear and low front legs."""
        body = biomimetic_hexapod()
        figure = new_figure(10.2, 8.8)
        panels: Any = figure.subplot_mosaic(
            [["side"] * 3, ["above"] * 3, ["speed", "slip", "clear"]], height_ratios=[0.75, 1.6, 1.1]
        )
        for view in ("side", "above"):
            draw_view(panels[view], body, view)
        panels["side"].set(xlim=(-1.0, 1.0), ylim=(-0.06, 0.32))
        _names(panels["above"], body)
        for quantity, words in (
            ("speed", "speed along the heading (m/s)"),
            ("slip", "slip of middle and rear feet (m/s)"),
        ):
            _over_friction(panels[quantity], values, quantity)
            panels[quantity].set_ylabel(words)
            panels[quantity].set_ylim(0, None)
        panels["speed"].legend(loc="lower left", fontsize=8.5, title="changed:", title_fontsize=8.5)
        _clear(panels["clear"], values, body, self.highest)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        least, most = (f"{friction:g}" for friction in (self.frictions[0], self.frictions[-1]))

        def difference(quantity: str, one: str, other: str) -> np.ndarray:
            return values[f"{one} {quantity}"] - values[f"{other} {quantity}"]

        def means(quantity: str, *names: str) -> str:
            return " and ".join(f"{values[f'{name} {quantity}'].mean():.3f}" for name in names)

        front = (f"front {least}", f"front {most}")
        behind = (f"behind {most}", f"behind {least}")
        own = f"{biomimetic_hexapod().front.leg.friction:g}"
        early = "Fraction of the swing in which front feet touch the ground: {}, and {} for legs that are not clear."
        fastest = max(values["friction"], key=lambda friction: values[f"behind {friction:g} speed"].mean())
        best = f"Fastest at {fastest:g}: {means('speed', f'behind {fastest:g}')} m/s."
        rows = (
            (
                f"The front feet need low friction: the hexapod is faster with {least} than with {most}.",
                difference("speed", *front),
                "m/s",
                f"{means('speed', *front)} m/s. Unchanged, with {own}: {means('speed', 'as it is')} m/s.",
            ),
            (
                f"Middle and rear feet need high friction: with {least} they slip more than with {most}.",
                difference("slip", *behind[::-1]),
                "m/s",
                f"{means('slip', *behind[::-1])} m/s while on the ground.",
            ),
            (
                f"Because they slip, the hexapod is slower with {least} than with {most} on middle and rear feet.",
                difference("speed", *behind),
                "m/s",
                f"{means('speed', *behind[::-1])} m/s. {best}",
            ),
            (
                "The front legs must be clear in the swing: the hexapod is slower if they rise only to "
                f"{self.highest:g}°.",
                difference("speed", "as it is", "low"),
                "m/s",
                early.format(means("early", "as it is"), means("early", "low")),
            ),
            (
                f"This also holds if their feet have a friction of {most}.",
                difference("speed", f"front {most}", "rough low"),
                "m/s",
                early.format(means("early", f"front {most}"), means("early", "rough low")),
            ),
            (
                "Untimed legs with different functions turn the body: it yaws more than the plain hexapod.",
                difference("yaw", "as it is", "plain"),
                "rad/s",
                f"Root mean squares of the yaw rate: {means('yaw', 'as it is', 'plain')} rad/s.",
            ),
        )
        for statement, differences, unit, note in rows:
            yield positive(
                statement, mean_of(differences), "on the same ground: difference", unit, note=note, source=SECTION
            )


def with_friction(body: Hexapod, sections: Sequence[str], friction: float) -> Hexapod:
    """The hexapod with this friction of the feet of these sections."""
    changed = {name: body.sections[name] for name in sections}
    return dataclasses.replace(
        body,
        **{
            name: dataclasses.replace(section, leg=dataclasses.replace(section.leg, friction=friction))
            for name, section in changed.items()
        },
    )


def with_low_front(body: Hexapod, highest: float) -> Hexapod:
    """The hexapod with front legs that rise only to this angle in degrees."""
    leg = body.front.leg
    hinge = Hinge((leg.vertical.range[0], highest), leg.vertical.stiffness, leg.vertical.damping)
    return dataclasses.replace(
        body, front=dataclasses.replace(body.front, leg=dataclasses.replace(leg, vertical=hinge))
    )


def walk_on_bumps(body: Hexapod, height: float, seeds: int, seconds: float, threads: int) -> dict[str, Any]:
    """Walks of a hexapod over bumps after its start, each seed on its own ground; (seeds,) each.

    **Returns** by name: `speed` along the heading and `net` displacement over time, m/s; `slip`, the speed at which
    middle and rear feet slide while on the ground, m/s; `early`, the fraction of the front legs' swing in which they
    touch the ground; `yaw`, the root mean square yaw rate, rad/s.
    """
    grounds = [OnTerrain(body, Terrain("bumps", height=height, seed=seed)) for seed in range(seeds)]
    found = walk(grounds, seconds=seconds + START, threads=threads)
    late = found.time > START
    gait = found.gait(since=START)
    contact = found.reading.contact[late] > TOUCH
    swing = found.states[late] == LegState.SWING
    touches, swings = (each[:, :, FRONT_FEET].sum((0, 2)) for each in (contact & swing, swing))
    slides = slip(found, body, HIND_FEET)[late[1:]]
    known = np.isfinite(slides)
    return {
        "speed": gait.speed,
        "net": gait.net,
        "slip": per_case(np.where(known, slides, 0.0).sum(0), known.sum(0)),
        "early": per_case(touches, swings),
        "yaw": np.sqrt((found.reading.yaw_rate[late] ** 2).mean(0)),
    }


def slip(found: Walk, body: Hexapod, legs: Sequence[int]) -> np.ndarray:
    """Mean sliding speed of the feet that touch the ground at two consecutive decisions, NaN if none does, (decisions −
    1, seeds) in m/s."""
    contact = found.reading.contact[:, :, list(legs)] > TOUCH
    both = contact[1:] & contact[:-1]
    moved = np.diff(_soles(found, body, legs)[..., :2], axis=0)
    speed = np.linalg.norm(moved, axis=-1) / found.period
    return per_case((speed * both).sum(-1), both.sum(-1))


def _soles(found: Walk, body: Hexapod, legs: Sequence[int]) -> np.ndarray:
    """Ends of the feet, (decisions, seeds, legs, 3) in m."""
    names = [LEGS[number] for number in legs]
    along = np.array([[body.sections[name.partition("_")[2]].leg.foot.length, 0.0, 0.0] for name in names])
    ends = np.empty((*found.posture.shape[:2], len(names), 3))
    for seed, model in enumerate(found.models):
        data = mujoco.MjData(model)
        feet = [model.body(f"foot_{name}").id for name in names]
        for decision, posture in enumerate(found.posture[:, seed]):
            data.qpos[:] = posture
            mujoco.mj_kinematics(model, data)
            turned = np.einsum("lij,lj->li", data.xmat[feet].reshape(-1, 3, 3), along)
            ends[decision, seed] = data.xpos[feet] + turned
    return ends


def _names(axes: Axes, body: Hexapod) -> None:
    places = Places(body, "above")
    for name, offset, words in (
        ("front", (0.16, 0.06), "short, reach forward"),
        ("middle", (0.1, 0.13), "as on the plain hexapod"),
        ("rear", (-0.13, 0.02), "long and strong, reach back"),
    ):
        leg = body.sections[name].leg
        lengths = " + ".join(f"{part.length:g}" for part in (leg.coxa, leg.femur, leg.foot))
        splay = f", {abs(leg.splay):g}°" if leg.splay else ""
        lines = f"{name} legs: {words}{splay}\n{lengths} m, friction {leg.friction:g}"
        name_part(axes, lines, places.tip(f"left_{name}"), offset)
        pair, other = leg.lateral_muscles, leg.vertical_muscles
        strengths = (
            f"protractor {pair.protractor:g} N, retractor {pair.retractor:g} N\n"
            f"levator {other.levator:g} N, depressor {other.depressor:g} N"
        )
        down = {"front": (0.2, -0.03), "middle": (0.12, -0.14), "rear": (-0.13, -0.02)}[name]
        name_part(axes, strengths, places.tip(f"right_{name}"), down)
    for name in body.sections:
        section = body.sections[name]
        centre = places.joint(name)
        words = f"{section.length:g} m ×\n{section.width:g} m,\n{section.mass:g} kg"
        axes.text(centre[0], centre[1], words, ha="center", va="center", fontsize=8, color="white", zorder=8)
    axes.set(xlim=(-1.0, 1.0), ylim=(-0.55, 0.55))


def _over_friction(axes: Axes, values: Values, quantity: str) -> None:
    for which, colour in COLOURS.items():
        measured = [mean_of(values[f"{which} {friction:g} {quantity}"]) for friction in values["friction"]]
        _errorbar(axes, values["friction"], measured, colour, FEET_LABELS[which])
    axes.set(xlabel="friction of the changed feet", xlim=(0, None))


def _clear(axes: Axes, values: Values, body: Hexapod, highest: float) -> None:
    """Speeds with front legs that are clear in the swing, and with low ones."""
    rough = f"{values['friction'][-1]:g}"
    own = f"{body.front.leg.friction:g}"
    for row, names in enumerate((("as it is", "low"), (f"front {rough}", "rough low"))):
        measured = [mean_of(values[f"{name} speed"]) for name in names]
        colour = ("0.2", "#CC79A7")[row]
        _errorbar(axes, np.array([0, 1]) + 0.06 * (2 * row - 1), measured, colour, (own, rough)[row])
    axes.set_xticks([0, 1], ["clear", f"rise only to {highest:g}°"])
    axes.set(xlim=(-0.4, 1.4), ylim=(0, None), xlabel="front legs in the swing")
    axes.legend(loc="lower left", fontsize=8.5, title="friction of front feet:", title_fontsize=8.5)


def _errorbar(axes: Axes, x: np.ndarray, measured: list[Any], colour: str, words: str) -> None:
    draw_intervals(axes, x, measured, fmt="o-", color=colour, markersize=4, linewidth=1.2, label=words)
