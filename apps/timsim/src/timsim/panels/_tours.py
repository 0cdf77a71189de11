"""The steps of guided tours: what a step is, and the tours of the library's bodies and of any other."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

from motorgrad._errors import check, unknown
from motorgrad.schema import build, check_fields
from timsim.live import Session
from timsim.scene import camera_named

MAX_STEP_CHARACTERS = 600  # which must fit over the picture of a telephone


@dataclasses.dataclass(frozen=True)
class TourStep:
    """One step of a guided tour: a text, where to look, and what it waits for.

    **Arguments:**

    - `text`: at most 600 characters.
    - `camera`: by its name in the list of cameras, those of the model also without "Fixed: "; None leaves it.
    - `tab`: by its title; None leaves it.
    - `wait`: until when the step stays. "next" is the button; "play" and "pause" are those of the run; "push"; "edit":
      any other change of body, learner or muscle; "decisions" and "seconds": `amount` of them, simulated, since the
      step began; "metric": until a metric of the task is at least `amount`. The button goes on from every step.
    - `amount`: above 0 for decisions and seconds.
    - `metric`: "reward", or the name of one of the task's metrics.

    **Raises** `ValueError` for an unknown `wait`, and for an amount or a metric that is missing or not meant.

    ```py
    TourStep("Push it.", camera="side", tab="Run", wait="push")
    TourStep("It learns to hop.", wait="metric", metric="apex", amount=0.3)
    ```
    """

    text: str
    camera: str | None = None
    tab: str | None = None
    wait: Literal["next", "play", "pause", "push", "edit", "decisions", "seconds", "metric"] = "next"
    amount: float | None = None
    metric: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        check(
            len(self.text.strip()) > 0 and len(self.text) <= MAX_STEP_CHARACTERS,
            "text",
            self.text,
            f"1 to {MAX_STEP_CHARACTERS} characters",
        )
        if self.wait in ("decisions", "seconds"):
            fine = self.amount is not None and math.isfinite(self.amount) and self.amount > 0
            check(fine, "amount", self.amount, f"a number of {self.wait} above 0")
        elif self.wait == "metric":
            check(self.amount is not None and math.isfinite(self.amount), "amount", self.amount, "the value to reach")
        else:
            check(self.amount is None, "amount", self.amount, f"left out where the step waits for {self.wait!r}")
        if self.wait == "metric":
            check(bool(self.metric), "metric", self.metric, "the name of a metric")
        else:
            check(self.metric is None, "metric", self.metric, "left out where the step waits for no metric")


def read_tour(rows: Sequence[TourStep | Mapping[str, Any]], where: str = "tour") -> tuple[TourStep, ...]:
    """The steps of a list of tables, as in a scene file. **Raises** `ValueError` that names the step."""
    check(isinstance(rows, list | tuple) and len(rows) > 0, where, rows, "a list of steps, [[tour]], at least one")
    steps = []
    for number, row in enumerate(rows):
        name = f"{where}[{number}]"
        if not isinstance(row, TourStep):
            check(isinstance(row, dict), name, row, "a step: a table with a text")
            row = build(TourStep, row, name)
        steps.append(row)
    return tuple(steps)


def check_tour(steps: Iterable[TourStep], session: Session, cameras: Sequence[str], tabs: Sequence[str]) -> None:
    """Refuse a step that a page cannot take. **Raises** `ValueError` that names it."""
    for number, step in enumerate(steps):
        try:
            if step.camera is not None:
                camera_named(step.camera, list(cameras))
            if step.tab is not None and step.tab.lower() not in map(str.lower, tabs):
                raise unknown("tab", step.tab, tabs)
            if step.metric is not None and step.metric not in (known := metrics_of(session)):
                check(bool(known), "metric", step.metric, "left out: nothing learns here")
                raise unknown("metric", step.metric, known)
            check(step.wait != "push" or session.model is not None, "wait", step.wait, "another: there is no body here")
        except ValueError as error:
            raise ValueError(f"tour[{number}]: {error}") from None


def metrics_of(session: Session) -> tuple[str, ...]:
    """What a step can wait for in the learning curve."""
    return () if session.agent is None else ("reward", *session.metrics)


def tour_of(session: Session, cameras: Sequence[str], tabs: Sequence[str]) -> tuple[TourStep, ...]:
    """The library's tour of a session, without the steps that its page cannot take."""
    name = session.name if session.task is None else session.task.name
    steps = next((tour for key, tour in TOURS.items() if name == key or name.startswith(f"{key}-")), GENERIC)
    found = []
    for step in steps:
        try:
            check_tour([step], session, cameras, tabs)
        except ValueError:
            continue
        found.append(step)
    return tuple(found)


BEGIN = TourStep("Play and Pause, or the space bar, start and stop it; N makes one decision.", tab="Run", wait="play")
HANDS = "Drag to turn the camera, scroll to zoom. F follows the body and frames it again."
BACK = TourStep(
    'Pause, then draw "To (s)" to the left: body and learner go back in time, bit for bit. "Continue from here" goes '
    "on from there; what came later is kept as a branch.",
    tab="Run",
    wait="pause",
)
END = TourStep(
    'That is the tour. The tab "Capture" saves films, pictures, the pose as SVG, and a replay in one file. '
    "? lists all keys.",
    tab="Capture",
)

GENERIC: tuple[TourStep, ...] = (
    TourStep(f"Welcome. {HANDS}", camera="Follow", tab="Run"),
    TourStep(
        "Press Play, or the space bar, and watch it move for two simulated seconds.",
        tab="Run",
        wait="seconds",
        amount=2.0,
    ),
    TourStep("Push it: choose a part, a direction and a force, and press Push, or P.", tab="Run", wait="push"),
    TourStep(
        "Each muscle is pale while silent and strong red while it is active. Click one to choose it.", tab="Muscles"
    ),
    TourStep("Angle, speed and torques of a joint, and the moment arms of its muscles.", tab="Joints"),
    TourStep(
        "The learning curve and the numbers behind it. Settings can be changed while it learns, and undone with U.",
        tab="Learning",
    ),
    TourStep("Any body can learn: choose its senses, muscles and reward here, and start.", tab="Task"),
    BACK,
    END,
)

HOPPER: tuple[TourStep, ...] = (
    TourStep(
        "A hopper: a load on two jointed legs that share a foot. Its muscles learn to make it hop as high as it can. "
        f"{HANDS}",
        camera="Follow",
        tab="Run",
    ),
    BEGIN,
    TourStep(
        "At first its muscles fire at random. Watch them from the side: pale is silent, red is active.",
        camera="side",
        wait="seconds",
        amount=5.0,
    ),
    TourStep(
        "One muscle close by: where it works on its force–length and force–velocity curves. Click another.",
        camera="Orbit",
        tab="Muscles",
    ),
    TourStep("Push the load with Push, or P, and see whether it lands on its foot.", tab="Run", wait="push"),
    TourStep(
        'Now the learning. Its metrics are plotted in simulated time: choose "apex", the height of the foot in a hop. '
        'Set the speed to "max" in the tab "Run" to see it rise within a minute.',
        tab="Learning",
        wait="seconds",
        amount=60.0,
    ),
    TourStep("The weights of the policy: from what it senses to the muscles, and when a muscle fires.", tab="Policy"),
    TourStep("Change a setting, such as a learning rate, as it learns. U undoes it.", tab="Learning", wait="edit"),
    BACK,
    END,
)

HEXAPOD: tuple[TourStep, ...] = (
    TourStep(f"A hexapod with 24 muscles learns to walk. {HANDS}", camera="Follow", tab="Run"),
    BEGIN,
    TourStep(
        "From above: which feet are on the ground together?",
        camera="above",
        tab="Gait",
        wait="seconds",
        amount=5.0,
    ),
    TourStep("Footfalls, the phase of each leg, and the class of its gait.", camera="Follow", tab="Gait"),
    TourStep(
        'Speed in the course of learning. Set the speed of the run to "max" in the tab "Run".',
        tab="Learning",
        wait="seconds",
        amount=120.0,
    ),
    TourStep("Push it to the side, with Push or P. Does it go on?", tab="Run", wait="push"),
    TourStep("All 24 muscles: search, groups and order; activations over time.", tab="Muscles"),
    TourStep("Walk beside it: W, A, S and D move you, the mouse looks around. O leaves the ground.", camera="Walk"),
    BACK,
    END,
)

ARM: tuple[TourStep, ...] = (
    TourStep(f"An arm with a muscle at its elbow, and nothing that drives it yet. {HANDS}", camera="Orbit", tab="Run"),
    BEGIN,
    TourStep('Drive the muscle: in the folder "Drive", move "By hand".', camera="side", tab="Muscles", wait="edit"),
    TourStep("Its working point moves on the force–length and force–velocity curves as it bends.", tab="Muscles"),
    TourStep("Moment arms over the range of the elbow: how far the muscle pulls from the joint.", tab="Joints"),
    TourStep("Push the forearm, with Push or P.", tab="Run", wait="push"),
    TourStep('Let it learn: choose senses, muscles and reward, and press "Learn".', tab="Task"),
    BACK,
    END,
)

RECRUITMENT: tuple[TourStep, ...] = (
    TourStep(f"An arm lifts a load, with a pool of motoneurons that learns how many to recruit. {HANDS}", tab="Run"),
    BEGIN,
    TourStep(
        "Each decision is a number of active motoneurons.",
        tab="Run",
        wait="decisions",
        amount=200.0,
    ),
    TourStep("Reward, height of the load and active motoneurons in the course of learning.", tab="Learning"),
    TourStep("Change a setting while it learns, and press Apply. U undoes it.", tab="Learning", wait="edit"),
    TourStep("The weights from what it senses to the motoneurons.", tab="Policy"),
    BACK,
    END,
)

PARTICLE: tuple[TourStep, ...] = (
    TourStep(
        "A particle learns to steer through rewarded regions, green, and around penalised ones, red.",
        camera="Orbit",
        tab="Run",
    ),
    BEGIN,
    TourStep(
        "Ellipses are its units: each fires where the particle is near, and pushes along its arrow.",
        wait="seconds",
        amount=10.0,
    ),
    TourStep("The units in their plane, with the number of the policy's parameters.", tab="Policy"),
    TourStep('Reward in the course of learning. The speed "max" in the tab "Run" shows it sooner.', tab="Learning"),
    TourStep("Change a setting while it learns. U undoes it.", tab="Learning", wait="edit"),
    BACK,
    END,
)

TOURS: dict[str, tuple[TourStep, ...]] = {
    "hopper": HOPPER,
    "hexapod": HEXAPOD,
    "arm-recruitment": RECRUITMENT,
    "arm": ARM,
    "particle": PARTICLE,
}
"""By the task's name, or that of a body without a task; also for tasks whose names begin so, as "hexapod-stride"."""
