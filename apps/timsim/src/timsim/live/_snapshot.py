"""What a page sees of a run, in shared memory: snapshot, trail and learning curve."""

import contextlib
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.shared_memory import SharedMemory
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

MAX_BODIES = 10  # side by side
MAX_LABEL_CHARACTERS = 40


class Snapshot(NamedTuple):
    """One moment of the bodies in view, copied out of shared memory; all values belong to the same decision.

    - `decision`: decisions made; `seconds`: simulated time, in s.
    - `playing`; `frozen`: whether learning is off; `speed`: simulated seconds per second of wall time, as achieved.
    - `position`, `velocity`, `activation`, `control`: MuJoCo's `qpos`, `qvel`, `act` and `ctrl` of each body. In a
      JAX world, `position` and `velocity` of its state, or the whole state in `position`.
    - `observation`; `probability`: each unit's probability of firing given it, or its mean activation.
    - `memory`: what the policy remembers for its next decision; of no numbers where it has no memory.
    - `reward` of the last decision; `baseline`; `gradient_norm` of the last gradient, NaN where unknown.
    - `parameters`: the trainable parameters of the acting policy, flat; `fixed`: its numbers that are not trained, such
      as the running statistics of observations.
    - `marks`: the places that the task marks, such as targets: x, y, z and radius (m) of one after the other.
    - `reset_count`: how often the run was reset or set to another decision; `oldest`, `newest`: the range of decisions
      that it can go to.
    - `labels`: what each body is, in a word or two.

    The first axis is of bodies: the one that learns, then those beside it: other policies, an untrained one, and that
    of another branch. Values that a body does not have are NaN.
    """

    decision: int
    seconds: float
    playing: bool
    frozen: bool
    speed: float
    position: Float[np.ndarray, "bodies nq"]
    velocity: Float[np.ndarray, "bodies nv"]
    activation: Float[np.ndarray, "bodies na"]
    control: Float[np.ndarray, "bodies nu"]
    observation: Float[np.ndarray, "bodies observations"]
    memory: Float[np.ndarray, "bodies memory"]
    probability: Float[np.ndarray, "bodies actions"]
    reward: Float[np.ndarray, " bodies"]
    baseline: Float[np.ndarray, " bodies"]
    gradient_norm: Float[np.ndarray, " bodies"]
    parameters: Float[np.ndarray, "bodies parameters"]
    fixed: Float[np.ndarray, "bodies fixed"]
    marks: Float[np.ndarray, "bodies numbers"]
    reset_count: int
    oldest: int
    newest: int
    labels: tuple[str, ...]


class Trail(NamedTuple):
    """The last decisions of a body, oldest first: at most about 20 s of simulated time.

    Of a fast run only stretches of consecutive decisions are sampled; `decision` tells which.

    - `activation`: of each actuator; `action`: what the policy chose; both take effect from this decision on.
    - `contacts`: the force of each foot's touch sensor (`Session.feet`), in N.
    """

    decision: Int[np.ndarray, " n"]
    seconds: Float[np.ndarray, " n"]
    position: Float[np.ndarray, "n nq"]
    velocity: Float[np.ndarray, "n nv"]
    activation: Float[np.ndarray, "n nu"]
    action: Float[np.ndarray, "n actions"]
    reward: Float[np.ndarray, " n"]
    contacts: Float[np.ndarray, "n feet"]
    observation: Float[np.ndarray, "n observations"]
    probability: Float[np.ndarray, "n actions"]


class Curve(NamedTuple):
    """The learning curve since the start, of at most 2,000 points: means over the decisions before each point.

    - `values`: by name, `reward`, then the task's metrics (`apex`, `speed`, …), NaN where one did not occur.
    - `frozen`: whether learning was off.
    """

    decision: Int[np.ndarray, " points"]
    seconds: Float[np.ndarray, " points"]
    reward: Float[np.ndarray, " points"]
    values: dict[str, Float[np.ndarray, " points"]]
    frozen: Bool[np.ndarray, " points"]

    def until(self, decision: int) -> "Curve":
        """What was known at a decision: of a run that went back, the curve also has what followed."""
        count = int(np.searchsorted(self.decision, decision, side="right"))
        values = {name: column[:count] for name, column in self.values.items()}
        return Curve(self.decision[:count], self.seconds[:count], self.reward[:count], values, self.frozen[:count])


Sample = dict[str, np.ndarray]
"""One moment, by the names of `Snapshot`'s arrays and `action` and `contacts`, with a leading axis of bodies."""


class Tally(NamedTuple):
    """Means and counts since the last tally: of the reward of a decision, then of the task's metrics."""

    values: np.ndarray
    counts: np.ndarray


class Sizes(NamedTuple):
    """The sizes of all arrays; the worker determines them and sends them to the session."""

    position: int
    velocity: int
    activation: int
    control: int
    observation: int
    action: int
    parameters: int
    feet: int
    trail: int
    metrics: int
    marks: int
    memory: int = 0
    fixed: int = 0


POINTS = 2_000
NUMBERS = ("decision", "seconds", "playing", "frozen", "speed", "reset_count", "oldest", "newest", "bodies")
COUNTS = ("decision", "reset_count", "oldest", "newest")
ARRAYS = (
    "position",
    "velocity",
    "activation",
    "control",
    "observation",
    "memory",
    "probability",
    "parameters",
    "fixed",
    "marks",
)
SCALARS = ("reward", "baseline", "gradient_norm")


def layout(sizes: Sizes) -> dict[str, dict[str, tuple[int, ...]]]:
    """The shapes of the arrays in shared memory, by part; all are double precision."""
    named = sizes._asdict() | {"probability": sizes.action, "contacts": sizes.feet}
    moment: dict[str, tuple[int, ...]] = dict.fromkeys(NUMBERS, ())
    moment |= {name: (MAX_BODIES, named[name]) for name in ARRAYS}
    moment |= dict.fromkeys(SCALARS, (MAX_BODIES,))
    moment["labels"] = (MAX_BODIES, MAX_LABEL_CHARACTERS)
    n = sizes.trail
    trail: dict[str, tuple[int, ...]] = dict.fromkeys(("decision", "seconds", "reward"), (n,))
    trail |= {"activation": (n, sizes.control)}
    trail |= {name: (n, named[name]) for name in ("position", "velocity", "action", "contacts")}
    trail |= {name: (n, named[name]) for name in ("observation", "probability")}
    points: dict[str, tuple[int, ...]] = dict.fromkeys(("decision", "seconds", "frozen"), (POINTS,))
    curve = points | {"count": (), "values": (1 + sizes.metrics, POINTS)}
    of_body = {"trail": trail | {"count": (), "next": ()}, "curve": curve}
    return {"moment": moment} | {part_of(name, row): of_body[name] for name in of_body for row in range(MAX_BODIES)}


def part_of(name: str, row: int) -> str:
    """The name of the shared part with the "trail" or the "curve" of a body."""
    return f"{name} {row}" if row else name


def encoded(labels: Sequence[str]) -> np.ndarray:
    """Labels as numbers, for shared memory; long labels are cut."""
    codes = np.zeros((len(labels), MAX_LABEL_CHARACTERS))
    for row, label in enumerate(labels):
        points = [ord(letter) for letter in label[:MAX_LABEL_CHARACTERS]]
        codes[row, : len(points)] = points
    return codes


def decoded(codes: np.ndarray) -> tuple[str, ...]:
    """The inverse of `encoded`."""
    return tuple("".join(chr(int(code)) for code in row if code) for row in codes)


WORD = 8  # bytes of a double, and of the sequence count
PATIENCE = 10.0  # s; far longer than a write takes, even on an overloaded machine


class SharedArrays:
    """Named arrays of doubles in one block of shared memory, guarded by a sequence lock.

    The count in the first word is odd while the writer is at work; a reader that finds it odd, or changed, reads again.
    The writer never waits.

    **Arguments:** `shapes`: of the arrays, by name; `name`: of an existing block to attach to, or None to create one.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]], name: str | None = None):
        size = WORD * (1 + sum(math.prod(shape) for shape in shapes.values()))
        self._memory = SharedMemory(name, create=name is None, size=size)
        self.owner = name is None
        self.name = self._memory.name
        memory: Any = self._memory.buf
        self._sequence = np.frombuffer(memory, np.int64, 1)
        self.arrays: dict[str, np.ndarray] = {}
        place = WORD
        for key, shape in shapes.items():
            count = math.prod(shape)
            self.arrays[key] = np.frombuffer(memory, np.float64, count, place).reshape(shape)
            place += WORD * count

    @contextmanager
    def writing(self) -> Iterator[dict[str, np.ndarray]]:
        """The arrays, for writing; readers discard what they read meanwhile."""
        self._sequence[0] += 1
        try:
            yield self.arrays
        finally:
            self._sequence[0] += 1

    def read(self) -> dict[str, np.ndarray]:
        """Consistent copies of the arrays.

        **Raises** `RuntimeError` where the writer died in the middle of a write.
        """
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            before = int(self._sequence[0])
            if before % 2 == 0:
                copies = {name: array.copy() for name, array in self.arrays.items()}
                if int(self._sequence[0]) == before:
                    return copies
            time.sleep(0)
        raise RuntimeError("shared memory: the simulation stopped while it was writing")

    def close(self) -> None:
        """Detach from the block; its creator also removes it."""
        self.arrays.clear()
        self._sequence = np.empty(0)
        with contextlib.suppress(BufferError):  # a reader still holds a view; the memory goes with it
            self._memory.close()
        if self.owner:
            self._memory.unlink()


ROWS = ("position", "velocity", "action", "contacts", "observation", "probability")


class TrailRecorder:
    """Writes the last decisions of the body in a `row` to a ring buffer."""

    def __init__(self, shared: SharedArrays, sizes: Sizes, period: float, row: int = 0):
        self._shared, self._room, self._period, self._row = shared, sizes.trail, period, row
        self._count = self._next = 0

    def add(self, decision: int, samples: Sequence[Sample]) -> None:
        """Append consecutive decisions, the last of which is `decision`."""
        if not samples:
            return
        body = self._row
        with self._shared.writing() as arrays:
            for number, sample in zip(range(decision - len(samples) + 1, decision + 1), samples, strict=True):
                row = self._next
                arrays["decision"][row] = number
                arrays["seconds"][row] = number * self._period
                arrays["reward"][row] = sample["reward"][body]
                arrays["activation"][row] = sample["control"][body]
                for name in ROWS:
                    arrays[name][row] = sample[name][body]
                self._next = (row + 1) % self._room
                self._count = min(self._count + 1, self._room)
            self._publish(arrays)

    def drop_after(self, decision: int) -> None:
        """Drop the decisions after this one."""
        with self._shared.writing() as arrays:
            while self._count and arrays["decision"][(self._next - 1) % self._room] > decision:
                self._next = (self._next - 1) % self._room
                self._count = self._count - 1
            self._publish(arrays)

    def _publish(self, arrays: dict[str, np.ndarray]) -> None:
        arrays["count"][...], arrays["next"][...] = self._count, self._next


class CurveRecorder:
    """Writes the learning curve, in points of equally many decisions; when full, pairs of points are merged."""

    def __init__(self, shared: SharedArrays, sizes: Sizes, period: float):
        self._shared, self._period = shared, period
        self._ends = np.zeros(POINTS, np.int64)
        self._frozen = np.zeros(POINTS)
        self._sums, self._counts = (np.zeros((1 + sizes.metrics, POINTS)) for _ in range(2))
        self._points = self._begin = 0
        self._first = self.window = max(1, round(1.0 / period))

    @property
    def end(self) -> int:
        """The last decision that is in the curve."""
        return int(self._ends[self._points - 1]) if self._points else self._begin

    @property
    def saved(self) -> tuple[tuple[np.ndarray, ...], int, int]:
        """The whole curve, copied, for `restore`."""
        n = self._points
        rows = (self._ends[:n], self._frozen[:n], self._sums[:, :n], self._counts[:, :n])
        return tuple(row.copy() for row in rows), self.window, self._begin

    def restore(self, saved: tuple[tuple[np.ndarray, ...], int, int]) -> None:
        """Replace the curve with a saved one."""
        (ends, frozen, sums, counts), self.window, self._begin = saved
        n = self._points = len(ends)
        self._ends[:n], self._frozen[:n], self._sums[:, :n], self._counts[:, :n] = ends, frozen, sums, counts
        self._publish()

    def add(self, decision: int, tally: Tally, frozen: bool) -> None:
        """Add what happened since the last call to the last point, or begin the next one."""
        last = self._points - 1
        begun = self._begin if last < 1 else self._ends[last - 1]
        if last < 0 or self._ends[last] - begun >= self.window:
            last = last + 1
            self._points = self._points + 1
            self._sums[:, last] = self._counts[:, last] = 0
        self._sums[:, last] += np.where(tally.counts > 0, tally.values * tally.counts, 0.0)
        self._counts[:, last] += tally.counts
        self._ends[last], self._frozen[last] = decision, frozen
        if self._points == POINTS:
            self._thin()
        self._publish()

    def drop_after(self, decision: int) -> None:
        """Drop the points that end after this decision."""
        self._points = int(np.searchsorted(self._ends[: self._points], decision, side="right"))
        self._publish()

    def clear(self, begin: int = 0) -> None:
        """Drop all points; the curve begins with a decision."""
        self._points = 0
        self._begin = begin
        self.window = self._first
        self._publish()

    def _thin(self) -> None:
        half = POINTS // 2
        for array in (self._sums, self._counts):
            array[:, :half] = array[:, ::2] + array[:, 1::2]
        self._ends[:half] = self._ends[1::2]
        self._frozen[:half] = self._frozen[1::2]
        self._points = half
        self.window = 2 * self.window

    def _publish(self) -> None:
        n = self._points
        with self._shared.writing() as arrays:
            arrays["count"][...] = n
            arrays["decision"][:n] = self._ends[:n]
            arrays["frozen"][:n] = self._frozen[:n]
            arrays["seconds"][:n] = self._ends[:n] * self._period
            seen = self._counts[:, :n] > 0
            means = np.divide(self._sums[:, :n], self._counts[:, :n], out=np.full((len(seen), n), np.nan), where=seen)
            arrays["values"][:, :n] = means
