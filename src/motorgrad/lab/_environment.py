"""A diagram as a Gymnasium environment, and as a policy."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from motorgrad._errors import check, unknown
from motorgrad.lab._diagram import Diagram
from motorgrad.lab._port import Port
from motorgrad.lab._run import Run
from motorgrad.lab.blocks._boundary import Inlet, Outlet


class _Boundary:
    """A diagram with one number coming in and some going out, in motion."""

    def __init__(self, diagram: Diagram, inlet: str, outlets: dict[str, str | None], seed: int):
        own = diagram.copy()
        self.given = _port(own, inlet, Inlet)
        self.seen = {what: _port(own, name, Outlet) for what, name in outlets.items() if name is not None}
        self._names = {what: f"{name}.u" for what, name in outlets.items()}
        block = own.nodes[inlet].block
        assert isinstance(block, Inlet)
        resting = np.broadcast_to(block.value, self.given.shape)
        own.replace(
            inlet, Inlet(resting.tolist(), shape=block.shape, kind=block.kind, every=block.every, period=block.period)
        )
        self.run, self._inlet, self._resting = Run(own, [seed]), f"{inlet}.value", resting

    def begin(self, seed: int) -> None:
        """Begin again, with nothing come in yet."""
        self.run[self._inlet] = self._resting.tolist()
        self.run.reset([seed])

    def put(self, value: Any) -> None:
        """Set the number that comes in."""
        self.run[self._inlet] = np.asarray(value).tolist()

    def read(self, record: Any, what: str) -> np.ndarray:
        """What went out, sample by sample."""
        return record[self._names[what]][0]


class DiagramEnv(gymnasium.Env[np.ndarray, Any]):
    """A diagram as a `gymnasium.Env`: an inlet takes the action, outlets give observation, reward and the end.

    A step sets the action, makes `decision` ticks, and then looks at the outlets: the observation is that of the state
    which the action led to. The reward is the sum of what its outlet shows at these ticks after the one at which the
    action was set, up to the look. The episode is truncated after `limit` steps; it never ends by itself without an
    outlet that says so.

    **Observation:** `Box` of float32 without bounds, or `MultiBinary`, in the outlet's shape, `(1,)` for one number.
    **Action:** for an inlet of floats `Box` from `low` to `high`; of bools `MultiBinary`.
    **Info:** `time`, in simulated seconds since the episode began.

    **Arguments:** the diagram (one that `cut` made will do); the names of its inlet and outlets; ticks in a decision;
    the range of an action; decisions in an episode, `None` for no limit.

    **Raises** `ValueError` for names that there are not, and impossible numbers; `DiagramError` for a diagram that
    cannot run; `gymnasium.error.ResetNeeded` for a step before `reset` or after the episode's end.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium has it so)

    def __init__(
        self,
        diagram: Diagram,
        *,
        action: str = "action",
        observation: str = "observation",
        reward: str = "reward",
        terminated: str | None = None,
        decision: int = 1,
        low: float = -1.0,
        high: float = 1.0,
        limit: int | None = None,
    ):
        for name, value in (("decision", decision), ("limit", limit)):
            whole = isinstance(value, int) and not isinstance(value, bool) and value >= 1
            check(whole or (name == "limit" and value is None), name, value, "a whole number from 1")
        check(
            np.isfinite(low) and np.isfinite(high) and low < high, "low, high", (low, high), "finite and in this order"
        )
        outlets = {"observation": observation, "reward": reward, "terminated": terminated}
        self._diagram = _Boundary(diagram, action, outlets, 0)
        for what in ("reward", "terminated"):
            shape = self._diagram.seen[what].shape if what in self._diagram.seen else ()
            check(shape == (), f"{outlets[what]}.shape", shape, "(), one number")
        self.decision, self.limit = decision, limit
        self.observation_space = _space(self._diagram.seen["observation"], -np.inf, np.inf)
        self.action_space = _space(self._diagram.given, low, high)
        self._steps: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode. With a `seed` the random numbers begin anew, else they go on. There are no `options`."""
        check(not options, "options", options, "None or empty")
        super().reset(seed=seed)
        self._diagram.begin(int(self.np_random.integers(2**31)))
        self._steps = 0
        return self._observed(self._diagram.run.look()), {"time": 0.0}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One decision."""
        if self._steps is None:
            raise gymnasium.error.ResetNeeded("no episode is under way: call reset() before step()")
        given = np.asarray(action)
        check(
            self.action_space.contains(given.astype(self.action_space.dtype)),
            "action",
            given.tolist(),
            f"in {self.action_space}",
        )
        self._diagram.put(given.reshape(self._diagram.given.shape))
        made, after = self._diagram.run.advance(self.decision), self._diagram.run.look()
        self._steps += 1
        paid = self._diagram.read(made, "reward")[1:].sum() + self._diagram.read(after, "reward")[0]
        ends = "terminated" in self._diagram.seen and bool(self._diagram.read(after, "terminated")[0])
        truncated = self.limit is not None and self._steps >= self.limit
        info = {"time": self._diagram.run.tick * self._diagram.run.plan.tick}
        if ends or truncated:
            self._steps = None
        return self._observed(after), float(paid), ends, truncated, info

    def close(self) -> None:
        """Let go of simulators; a second time does nothing."""
        self._diagram.run.close()

    def _observed(self, record: Any) -> np.ndarray:
        space = self.observation_space
        return self._diagram.read(record, "observation")[0].reshape(space.shape).astype(space.dtype)


class DiagramPolicy:
    """A diagram as a policy: called with an observation it gives an action, and its state moves on by a tick.

    **Arguments:** the diagram (one that `cut` made will do); the names of its inlet and its outlet; the seed of what is
    random in it.

    **Raises** `ValueError` for names that there are not; `DiagramError` for a diagram that cannot run.
    """

    def __init__(self, diagram: Diagram, *, observation: str = "observation", action: str = "action", seed: int = 0):
        self._diagram = _Boundary(diagram, observation, {"action": action}, seed)
        self._seed = seed

    def __call__(self, observation: Any) -> np.ndarray:
        """The action for an observation of the inlet's shape, in the outlet's. **Raises** `ValueError` for another."""
        given = np.asarray(observation)
        shape = self._diagram.given.shape
        check(given.size == np.prod(shape, dtype=int), "observation.shape", given.shape, str(shape))
        check(np.isfinite(given).all(), "observation", given.tolist(), "finite numbers")
        self._diagram.put(given.reshape(shape))
        return self._diagram.read(self._diagram.run.advance(1), "action")[0]

    def reset(self, seed: int | None = None) -> None:
        """Begin again, with the same seed or another."""
        self._seed = self._seed if seed is None else seed
        self._diagram.begin(self._seed)


def _port(diagram: Diagram, name: str, kind: type[Inlet] | type[Outlet]) -> Port:
    known = [own for own, node in diagram.nodes.items() if isinstance(node.block, kind)]
    if name not in known:
        raise unknown(kind.name, name, known)
    block = diagram.nodes[name].block
    assert isinstance(block, Inlet | Outlet)
    return block.port


def _space(port: Port, low: float, high: float) -> spaces.Box | spaces.MultiBinary:
    shape = port.shape or (1,)
    check(port.kind != "int", "kind", port.kind, "float or bool")
    return spaces.MultiBinary(shape) if port.kind == "bool" else spaces.Box(low, high, shape, np.float32)
