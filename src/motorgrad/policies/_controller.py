"""Finite-state controllers: a memory of a few internal states, whose transitions are drawn and learned."""

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._layered import Draws, Sequential
from motorgrad.policies._output_units import output_units
from motorgrad.policies._policy import Policy, check_plain
from motorgrad.policies._softmax import Softmax
from motorgrad.policies._starting import Initial, InitialPolicy, function_of
from motorgrad.schema import count, static


class FiniteStateController(Sequential):
    r"""A policy with $G$ internal states, which it moves between at random.

    At every decision, in the internal state $g$ and on the observation $y$, it first draws the next internal state $g'
    \sim \omega(g' \mid \phi, g, y)$, then the action $u \sim \mu(u \mid \theta, g', y)$ (Aberdeen & Baxter, 2002;
    Meuleau et al., 1999). Both are policies of their own. An episode begins in state 0.

    The drawn state belongs to the action, and the present one to what the units see, so every estimator learns $\phi$
    and $\theta$ as if the memory were a part of the world: $\log\pi = \log\omega + \log\mu$. Critics see the internal
    state. Each internal state has parameters of its own: both policies see the observation in the place of their
    internal state, among zeros, as $e_g \otimes y$. So the observation should have a constant input, or be one-hot.

    **Where nothing is remembered at first, nothing is learned.** If all internal states act alike and are left alike,
    the gradient with respect to $\phi$ is zero, and no state becomes different from the others. Aberdeen & Baxter's
    remedy is many internal states with few transitions from each: different pasts then lead to different states by
    chance, $\mu$ learns to use what they tell, and $\omega$ learns to tell more. See `links` of
    `finite_state_controller`.

    **Arguments:** `transition` $\omega$, a discrete policy with one alternative for each internal state; `act` $\mu$,
    any policy without a memory. Both have an input for every observed number in every internal state.

    **Example:**

    ```python
    controller = FiniteStateController(Softmax(jnp.zeros((2, 6))), Hyperplanes(jnp.zeros((1, 6)), [0.0]))
    memory = controller.initial_memory()  # [1.0, 0.0], the internal state as a one-hot vector
    seen = controller.observation_with_memory(memory, jnp.array([0.0, 1.0, 0.0]))
    action = controller.sample(seen, jax.random.uniform(key, (controller.uniforms,)))
    controller.task_action(action)  # what the task gets
    memory = controller.remember(seen, action)
    ```
    """

    transition: Policy
    act: Policy  # pyright: ignore[reportIncompatibleMethodOverride]  # with a memory, it acts by `Actor` alone

    def __check_init__(self) -> None:
        check_plain("transition", self.transition)
        check(not abilities.has_memory(self.act), "act", type(self.act).__name__, "a policy without a memory")
        kind = self.transition.actions
        check(kind == "discrete", "transition", kind, "a policy of discrete actions, such as Softmax")
        size, states = self.transition.inputs, self.states
        check(size % states == 0, "transition.inputs", size, f"a multiple of the {states} internal states")
        check(self.act.inputs == size, "act.inputs", self.act.inputs, f"{size}, those of the transition")

    @property
    def states(self) -> int:
        """The number of internal states $G$."""
        return self.transition.outputs

    @property
    def observation_size(self) -> int:
        return self.transition.inputs // self.states

    @property
    def pools(self) -> tuple[Policy, ...]:
        return (self.transition, self.act)

    @property
    def inputs(self) -> int:
        return self.observation_size + self.states

    def view(self, observation: Float[Array, " inputs"], drawn: Draws) -> Float[Array, " _"]:
        shown = observation[: self.observation_size]
        state = observation[self.observation_size :]
        state = self._one_hot(drawn[0], observation.dtype) if drawn else state
        return (state[:, None] * shown).ravel()

    def initial_memory(self) -> Float[Array, " states"]:
        return self._one_hot(jnp.zeros((), jnp.int32), jax.tree.leaves(self.transition)[0].dtype)

    def observation_with_memory(
        self, memory: Float[Array, " states"] | None, observation: Float[Array, " observation"]
    ) -> Float[Array, " inputs"]:
        assert memory is not None
        return jnp.concatenate([observation, memory.astype(observation.dtype)])

    def remember(self, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " states"]:
        return self._one_hot(self.drawn(action)[0], jax.tree.leaves(self.transition)[0].dtype)

    def table(self, observations: Float[Array, "kinds observation"]) -> Float[Array, "kinds states states"]:
        r"""$\omega(g' \mid g, y)$ for each of some observations: from the internal state of the row to that of the
        column."""
        states = jnp.eye(self.states)

        def row(observation: Array, state: Array) -> Array:
            return self.transition.prob(self.view(jnp.concatenate([observation, state]), []))

        return jax.vmap(jax.vmap(row, (None, 0)), (0, None))(jnp.asarray(observations), states)

    def _one_hot(self, state: Array, dtype: DTypeLike) -> Float[Array, " states"]:
        return jax.nn.one_hot(state, self.states, dtype=dtype)


class InitialFiniteStateController(InitialPolicy):
    r"""A controller with internal states, of which each at first leads to few others.

    From every internal state, `links` next states are drawn for every observed number. Their weights start at
    `strength`, all others at 0. So on a one-hot observation, a linked state is $e^{\text{strength}}$ times as probable
    as another. `links` of 0, or a strength of 0, leave all transitions equally probable; then the gradient with respect
    to the transitions is zero, and stays so but for chance (Aberdeen & Baxter, 2002).
    """

    units: int | None = count(None, 1, help="the number of output units, by default one for each action of the task")
    states: int = count(4, 1, 10_000, help="the number of internal states")
    links: int = count(1, 0, help="how many next states are favoured at first, from every state and on every input")
    strength: float = static(3.0, help="how strongly they are favoured, as a difference of weights")
    output: str = static("", help="the output units, a name of an initial policy; by default as of `layered`")

    def validate(self) -> None:
        super().validate()
        check(self.links <= self.states, "links", self.links, f"at most the {self.states} states")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, _ = sizes(task, self.units)
        make, _ = output_units(task, self.units, self.output)

        def made(key: jax.Array) -> FiniteStateController:
            chance = jax.random.uniform(key, (self.states, self.states * inputs))
            rank = jnp.argsort(jnp.argsort(chance, axis=0), axis=0)
            transition = Softmax(jnp.where(rank < self.links, self.strength, 0.0))
            return FiniteStateController(transition, make(self.states * inputs, jax.random.fold_in(key, 1)))

        made(jax.random.key(0))  # refuses impossible settings at once, not only when a key arrives
        return made


finite_state_controller = function_of(InitialFiniteStateController)
