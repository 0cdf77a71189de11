"""A diagram as a Gymnasium environment, and as a policy."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, unknown
from motorgrad.environments import as_array, check_action
from timlab.diagram import Diagram, Inlet, Outlet, Port, Record
from timlab.engine._run import Run


class _RunningDiagram:
    """A running diagram with one input and some outputs."""

    def __init__(self, diagram: Diagram, inlet: str, outlets: dict[str, str | None], seed: int):
        own = diagram.copy()
        self.input = _port(own, inlet, Inlet)
        self.outputs = {what: _port(own, name, Outlet) for what, name in outlets.items() if name is not None}
        self._names = {what: f"{name}.u" for what, name in outlets.items()}
        block = own.nodes[inlet].block
        assert isinstance(block, Inlet)
        resting = np.broadcast_to(block.value, self.input.shape)
        own.replace(
            inlet, Inlet(resting.tolist(), shape=block.shape, kind=block.kind, every=block.every, period=block.period)
        )
        self.run = Run(own, [seed])
        self._inlet = f"{inlet}.value"
        self._resting = resting

    def restart(self, seed: int) -> None:
        """Restart, with the input at rest."""
        self.run[self._inlet] = self._resting.tolist()
        self.run.reset([seed])

    def set_input(self, value: np.ndarray) -> None:
        """Set the input."""
        self.run[self._inlet] = np.asarray(value).tolist()

    def read(self, record: Record, what: str) -> np.ndarray:
        """An output, sample by sample."""
        return record[self._names[what]][0]


class DiagramEnv(gymnasium.Env[np.ndarray, Any]):
    """A diagram as a `gymnasium.Env`: an inlet receives the action, outlets give observation, reward and termination.

        env = DiagramEnv(diagram, decision=5, limit=200)
        observation, info = env.reset(seed=0)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    A step sets the action, runs `decision` ticks and then reads the outlets, so the observation is that of the state
    which the action led to. The reward is the sum over these ticks of the reward outlet after the action was set,
    including the final reading. The episode is truncated after `limit` steps, and never terminates without an outlet
    for termination.

    **Observation:** unbounded `Box` of float32, or `MultiBinary`, in the outlet's shape, `(1,)` for a scalar.
    **Action:** for an inlet of floats `Box` from `low` to `high`; of bools `MultiBinary`. **Info:** `time` (s), the
    simulated time since the episode began.

    **Arguments:**

    - `diagram`: for example one that `extract` returned.
    - `action`, `observation`, `reward`, `terminated`: names of its inlet and outlets.
    - `decision`: ticks per step.
    - `low`, `high`: the range of an action.
    - `limit`: steps per episode, `None` for no limit.

    **Raises** `ValueError` for unknown names and impossible numbers; `DiagramError` for a diagram that cannot run;
    `gymnasium.error.ResetNeeded` for a step before `reset` or after the end of the episode.
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
        check_arguments(DiagramEnv, locals())
        for name, value in (("decision", decision), ("limit", limit)):
            whole = isinstance(value, int) and not isinstance(value, bool) and value >= 1
            check(whole or (name == "limit" and value is None), name, value, "an integer from 1")
        check(
            np.isfinite(low) and np.isfinite(high) and low < high, "low, high", (low, high), "finite and in this order"
        )
        outlets = {"observation": observation, "reward": reward, "terminated": terminated}
        self._diagram = _RunningDiagram(diagram, action, outlets, 0)
        for what in ("reward", "terminated"):
            shape = self._diagram.outputs[what].shape if what in self._diagram.outputs else ()
            check(shape == (), f"{outlets[what]}.shape", shape, "(), a scalar")
        self.decision, self.limit = decision, limit
        self.observation_space = _space(self._diagram.outputs["observation"], -np.inf, np.inf)
        self._space = _space(self._diagram.input, low, high)
        self.action_space = self._space
        self._steps: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode. A `seed` restarts the random numbers, otherwise they continue. There are no `options`."""
        check(not options, "options", options, "None or empty")
        super().reset(seed=seed)
        self._diagram.restart(int(self.np_random.integers(2**31)))
        self._steps = 0
        return self._observed(self._diagram.run.peek()), {"time": 0.0}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Make one step."""
        if self._steps is None:
            raise gymnasium.error.ResetNeeded("no episode has begun: call reset() before step()")
        check_action(self._space, action)
        self._diagram.set_input(np.reshape(action, self._diagram.input.shape))
        made = self._diagram.run.advance(self.decision)
        after = self._diagram.run.peek()
        self._steps += 1
        reward = self._diagram.read(made, "reward")[1:].sum() + self._diagram.read(after, "reward")[0]
        ends = "terminated" in self._diagram.outputs and bool(self._diagram.read(after, "terminated")[0])
        truncated = self.limit is not None and self._steps >= self.limit
        info = {"time": self._diagram.run.tick * self._diagram.run.plan.tick}
        if ends or truncated:
            self._steps = None
        return self._observed(after), float(reward), ends, truncated, info

    def close(self) -> None:
        """Release simulators. Closing twice has no effect."""
        self._diagram.run.close()

    def _observed(self, record: Record) -> np.ndarray:
        space = self.observation_space
        return self._diagram.read(record, "observation")[0].reshape(space.shape).astype(space.dtype)


class DiagramPolicy:
    """A diagram as a policy: calling it with an observation returns an action and advances its state by one tick.

        policy = DiagramPolicy(diagram)
        action = policy(observation)

    **Arguments:**

    - `diagram`: for example one that `extract` returned.
    - `observation`, `action`: names of its inlet and outlet.
    - `seed`: of its random numbers.

    **Raises** `ValueError` for unknown names; `DiagramError` for a diagram that cannot run.
    """

    def __init__(self, diagram: Diagram, *, observation: str = "observation", action: str = "action", seed: int = 0):
        check_arguments(DiagramPolicy, locals())
        self._diagram = _RunningDiagram(diagram, observation, {"action": action}, seed)
        self._seed = seed

    def __call__(self, observation: Any) -> np.ndarray:
        """The action for an observation. Both have the shapes of inlet and outlet. **Raises** `ValueError` for another
        shape.
        """
        given = as_array("observation", observation)
        shape = self._diagram.input.shape
        check(given.dtype.kind in "biuf", "observation.dtype", given.dtype, "a number's")
        check(given.size == np.prod(shape, dtype=int), "observation.shape", given.shape, str(shape))
        check(np.isfinite(given).all(), "observation", given.tolist(), "finite numbers")
        self._diagram.set_input(given.reshape(shape))
        return self._diagram.read(self._diagram.run.advance(1), "action")[0]

    def reset(self, seed: int | None = None) -> None:
        """Restart, with the same seed or another one."""
        self._seed = self._seed if seed is None else seed
        self._diagram.restart(self._seed)


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
