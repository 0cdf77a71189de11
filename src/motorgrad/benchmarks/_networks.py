"""A policy and a critic of 2 × 128 hidden units that learn from every decision, beside the same learner in torch."""

import dataclasses
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._extras import installed
from motorgrad.benchmarks._measure import Figures, in_turn
from motorgrad.learning import SGD, Agent, Estimator, Exponential, NetworkCritic, OvershootingBound
from motorgrad.policies import MultilayerPerceptron, graded_hyperplanes
from motorgrad.tasks import Task
from motorgrad.training import stepper_for
from motorgrad.worlds import World

HIDDEN = (128, 128)
# as of many walkers
OBSERVED = 17
ACTED = 6
DISCOUNT = 0.99
DECAY = 0.8
FLOOR = 0.02
SCALING = {"policy": 3.0, "critic": 2.0}  # κ


class Noise(World):
    """A stream of observations that no action changes: next to no work beside the learner's."""

    uniforms: ClassVar[int] = OBSERVED
    reset_uniforms: ClassVar[int] = OBSERVED

    def reset(self, uniforms: Float[Array, " observed"]) -> Float[Array, " observed"]:
        return uniforms

    def step(self, state: Array, action: Array, uniforms: Float[Array, " observed"]) -> Float[Array, " observed"]:
        return uniforms


@dataclasses.dataclass(frozen=True)
class Stream(Task):
    """Numbers from −1 to 1 are observed, and the reward is minus the mean square of the actions."""

    name: ClassVar[str] = "stream"
    actions: ClassVar[Any] = "continuous"

    @property
    def dynamics(self) -> World:
        return Noise()

    @property
    def observation_size(self) -> int:
        return OBSERVED

    @property
    def action_size(self) -> int:
        return ACTED

    def observe(self, memory: PyTree, state: Array, uniforms: Array) -> tuple[PyTree, Array]:
        return memory, 2 * state - 1

    def reward(self, memory: PyTree, state: Array, action: Array) -> Any:
        return memory, -jnp.mean(action * action), False


def learner(hidden: tuple[int, ...] = HIDDEN) -> Agent:
    """The actor-critic with traces of Elsayed, Vasan & Mahmood (2024), without entropy."""
    layers = MultilayerPerceptron(hidden)
    critic = NetworkCritic(network=layers, discount=DISCOUNT, decay=DECAY)
    trace = Exponential(DISCOUNT * DECAY)
    bound = OvershootingBound(SCALING["policy"])
    policy = graded_hyperplanes(OBSERVED, ACTED, floor=FLOOR, network=layers)
    return Agent(policy, Estimator(trace, critic, bound=bound), SGD(1.0))


class TorchLearner:
    """The same learner in torch, as one writes it there: modules, automatic differentiation, and loops over parameters.
    It begins with the numbers of ours: the `policy` and the weights of the `critic` of one seed."""

    def __init__(self, policy: Any, critic: Any):
        import torch  # pyright: ignore[reportMissingImports]

        torch.set_num_threads(1)
        self._torch = torch

        def layers(module: Any) -> list[Any]:
            made: list[Any] = []
            for linear in module.layers[::3]:
                layer = torch.nn.Linear(linear.weight.shape[1], linear.weight.shape[0])
                copy(layer, linear.weight, linear.bias)
                made += [layer, torch.nn.LayerNorm(layer.out_features, elementwise_affine=False), torch.nn.LeakyReLU()]
            return made

        def copy(layer: Any, weight: Array, bias: Array) -> None:
            layer.weight.data = torch.tensor(np.array(weight))
            layer.bias.data = torch.tensor(np.array(bias))

        width = policy.pool.weights.shape[1]
        means = torch.nn.Linear(width, ACTED)
        value = torch.nn.Linear(width, 1)
        copy(means, policy.pool.weights, policy.pool.bias)
        copy(value, critic.weights[None], critic.bias[None])
        self.policy = torch.nn.Sequential(*layers(policy.module), means)
        self.critic = torch.nn.Sequential(*layers(critic.layers), value)
        self.log_deviation = torch.nn.Parameter(torch.tensor(np.array(policy.pool.log_deviation)))
        self.of_policy = [*self.policy.parameters(), self.log_deviation]
        self.of_critic = [*self.critic.parameters()]
        self._traces = [[torch.zeros_like(p) for p in each] for each in (self.of_policy, self.of_critic)]

    def step(self, observation: Any, noise: Any, following: Any) -> None:
        """One decision on an observation, with standard normal `noise`, that leads to the `following` observation."""
        torch = self._torch
        mean = self.policy(observation)
        deviation = FLOOR + torch.exp(self.log_deviation)
        action = (mean + deviation * noise).detach()
        log_prob = torch.distributions.Normal(mean, deviation, validate_args=False).log_prob(action).sum()
        scores = torch.autograd.grad(log_prob, self.of_policy)
        value = self.critic(observation)[0]
        slopes = torch.autograd.grad(value, self.of_critic)
        with torch.no_grad():
            error = -(action * action).mean() + DISCOUNT * self.critic(following)[0] - value
            for name, parameters, gradients, traces in (
                ("policy", self.of_policy, scores, self._traces[0]),
                ("critic", self.of_critic, slopes, self._traces[1]),
            ):
                length = 0.0
                for trace, gradient in zip(traces, gradients, strict=True):
                    trace.mul_(DISCOUNT * DECAY).add_(gradient)
                    length += trace.abs().sum().item()
                rate = 1 / max(1, SCALING[name] * max(abs(error.item()), 1) * length)
                for parameter, trace in zip(parameters, traces, strict=True):
                    parameter.add_(trace, alpha=rate * error.item())

    def run(self, steps: int) -> None:
        """So many decisions on random observations."""
        torch = self._torch
        observations = 2 * torch.rand(steps + 1, OBSERVED) - 1
        noise = torch.randn(steps, ACTED)
        for t in range(steps):
            self.step(observations[t], noise[t], observations[t + 1])


def network(decisions: int, peer_decisions: int, pairs: int = 5) -> Figures:
    """Learning steps per second of one stream on one core, against the learner in torch, if that is installed."""
    agent = learner()
    ours = stepper_for(Stream(), agent, [0])
    ours.advance(decisions)  # compiles
    if not installed("torch"):
        also = "torch is not installed: extra peers"
        return in_turn("steps/s", decisions, lambda: ours.advance(decisions), pairs=pairs, also=also)
    state = agent.init(jax.random.key(0))
    peer = TorchLearner(state.policy, state.estimator.baseline.weights)
    peer.run(math.ceil(peer_decisions / 10))
    both = (lambda: ours.advance(decisions), lambda: peer.run(peer_decisions))
    return in_turn("steps/s", decisions, *both, peer_decisions, pairs)
