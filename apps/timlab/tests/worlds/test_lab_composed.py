"""A composed task as a block of a diagram: what the engine of training sees, and nothing else."""

import zlib

import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
import timlab
from timlab.compiler import draw_span, draw_start

SETTINGS = """
body = "arm6"
targets = ["reach"]
observe = ["joint-positions", "target-error", "activations"]
reward = ["distance"]
reset = ["random-joints"]
actions = "binary"
scaling = "none"
time_limit = 0.08
"""


@pytest.mark.ci
def test_a_block_begins_and_ends_episodes_as_the_task_says():
    block = timlab.Body("composed", SETTINGS)
    task = block.instance
    made = timlab.Diagram(tick=task.period)
    made.add("world", block)
    made.add("policy", timlab.Hyperplanes(task.action_size, task.observation_size))
    made.connect("world.observation", "policy.observation")
    made.connect("policy.action", "world.action")
    record = timlab.Run(made, [4, 9], watch=["world.observation", "policy.action", "world.ended"]).advance(10)
    seen, ended = record.signals["world.observation"], record.signals["world.ended"]
    assert np.flatnonzero(ended[0]).tolist() == [4, 8]
    name = np.uint32(zlib.crc32(b"world"))
    for row, seed in enumerate((4, 9)):
        first = np.asarray(draw_start(seed, name, task.init_uniforms))
        drawn = np.asarray(draw_span(seed, name, 0, task.init_uniforms))
        for tick, numbers in ((0, first), (4, drawn[3])):
            batch = task.batch([0], threads=1)
            batch.reset(None, **task.begin(numbers[None]))
            state = batch.unpack(batch.packed[0])
            wanted = task.observe(task.init(jnp.asarray(numbers)), state, jnp.zeros(0))[1]
            np.testing.assert_allclose(seen[row, tick], wanted, atol=1e-6)
    assert np.ptp(seen[:, :, 5:]) > 0
    assert mg.tasks.Composed in {type(task)}
