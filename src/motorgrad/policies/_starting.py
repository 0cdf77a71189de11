"""Initial policies as parts: the settings from which the policy of every seed is built for a task."""

import abc
import inspect
from collections.abc import Callable
from typing import Any, ClassVar, Self

import equinox as eqx
import jax

from motorgrad._errors import check, unknown
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._policy import Policy
from motorgrad.schema import PART_CLASSES, Part, Range, check_fields, count, fields_of

MAX_POLICY_WEIGHTS = 100_000_000  # of the units for each observed number
POSITIVE = Range(0, open_low=True)
SHARE_ABOVE_0 = Range(0, 1, open_low=True)
Initial = Policy | Callable[[jax.Array], Policy]
"""A policy, or a function from a seed's key to a policy."""


class _Bound:
    """The task that an initial policy is for. Programs differ by the settings of a policy and by its structure, not by
    this: the task is a part of their keys by itself."""

    def __init__(self, task: Any):
        self.task = task

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Bound) and (self.task is other.task or self.task == other.task)

    def __hash__(self) -> int:
        return hash(type(self.task))


class InitialPolicy(Part):
    """The settings of an initial policy.

    A subclass declares its settings and defines `start`. Registered (`motorgrad.learning.register`), it can be chosen
    by name. As the `policy` of an `Agent` it must be bound to the task (`bound`), as `agent_for` does; then it is a
    function from a seed's key to the policy of this seed.
    """

    brief: ClassVar[bool] = True
    """A stored table has only what is not as by default."""

    units: int | None = count(None, 1, help="the number of units, by default one for each action of the task")
    _task: _Bound | None = eqx.field(static=True, default=None, init=False, repr=False)

    def __check_init__(self) -> None:
        check_fields(self)

    @abc.abstractmethod
    def start(self, task: Any) -> Initial:
        """The initial policy for a `task`: anything with `observation_size` and `action_size`, or a number of inputs.

        **Returns** a policy, or, where it is random, a function from a seed's key to a policy.

        **Raises** `ValueError` for settings that are impossible for the task.
        """

    def build(self, task: SizedTask | int, key: jax.Array) -> Policy:
        """The policy of the seed that has this key, for a task."""
        made = self.start(task)
        return made if isinstance(made, Policy) else made(key)

    def bound(self, task: SizedTask) -> Self:
        """These settings for this task. **Raises** `ValueError` for what is impossible for it."""
        most = MAX_POLICY_WEIGHTS // sizes(task, self.units)[0]
        check(self.units is None or self.units <= most, "policy.units", self.units, f"at most {most} here")
        try:
            self.start(task)
        except ValueError as error:
            named = str(error).split()[0].strip(",") in fields_of(type(self))
            raise ValueError(f"policy.{error}" if named else str(error)) from None
        made = object.__new__(type(self))
        for name in (*fields_of(type(self)), "_task"):
            object.__setattr__(made, name, _Bound(task) if name == "_task" else getattr(self, name))
        return made

    def __call__(self, key: jax.Array) -> Policy:
        if self._task is None:
            raise ValueError(f"policy = {self}: must be bound to a task first, as agent_for and bound do")
        return self.build(self._task.task, key)

    @property
    def task(self) -> Any:
        """The task that it is bound to; `None` without one."""
        return None if self._task is None else self._task.task


TASK = "a task, or anything with `observation_size` and `action_size`; or a number of inputs."
INITIAL: dict[str, type[InitialPolicy]] = {}
"""The kinds of initial policies by name, as used in configurations and on the command line."""
PART_CLASSES[InitialPolicy] = INITIAL


def function_of(kind: type[InitialPolicy]) -> Callable[..., Any]:
    """The initial policy of a kind as a function of a task and the settings: `tiles(task, units=8, copies=2)`."""

    def function(task: Any, *values: Any, **settings: Any) -> Any:
        return kind(*values, **settings).start(task)

    name = "".join(f"_{c.lower()}" if c.isupper() else c for c in kind.__name__.removeprefix("Initial")).lstrip("_")
    function.__name__ = function.__qualname__ = name
    function.__module__ = kind.__module__
    arguments = "**Arguments:**\n\n"
    function.__doc__ = (kind.__doc__ or "").replace(arguments, f"{arguments}- `task`: {TASK}\n", 1)
    settings = list(inspect.signature(kind).parameters.values())
    first = inspect.Parameter("task", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    function.__signature__ = inspect.Signature([first, *settings])  # type: ignore[attr-defined]
    return function


def then(function: Callable[[Policy], Policy], made: Any) -> Initial:
    """What a function makes of an initial policy: again a policy, or a function from a seed's key to one."""
    return function(made) if isinstance(made, Policy) else lambda key: function(made(key))


def check_interval(low: Any, high: Any) -> None:
    """Refuse two ends of which the lower is not below the other."""
    check(low < high, "low, high", (low, high), "an interval, low < high")


def initial(name: str, task: SizedTask | int, **settings: Any) -> Any:
    """The initial policy called `name` for a task.

    **Arguments:**

    - `name`: a name in `INITIAL`.
    - `task`: a task, or anything with `observation_size` and `action_size`; or a number of inputs.
    - `settings`: those of the kind of this name, such as `units`.

    **Returns:** a policy, or, where it is random, a function from a seed's key to a policy.

    **Raises:** `ValueError` for an unknown name, suggesting the closest one.

    **Example:**

    ```python
    initial("tiles", motorgrad.make("particle"), copies=2, width=0.2)
    initial("motoneurons", 1, units=4)(jax.random.key(0))  # one input, four units, random thresholds
    ```
    """
    if name not in INITIAL:
        raise unknown("policy", name, INITIAL, registered=True)
    return INITIAL[name](**settings).start(task)
