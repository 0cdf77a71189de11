"""A run without a page: a worker in this process, driven by hand."""

import math
import multiprocessing
import threading

import pytest

from timsim.live import setup_of
from timsim.live._snapshot import SharedArrays, layout
from timsim.live._worker import Worker


class Driven:
    """A worker that does what it is told and nothing by itself, and what it has put into shared memory."""

    def __init__(self, setup):
        self._pipe, theirs = multiprocessing.Pipe()
        self.blocks = {}
        answer = threading.Thread(target=self._answer)
        answer.start()
        self.worker = Worker(setup, theirs, False, math.inf)
        answer.join()

    def _answer(self):
        about = self._pipe.recv()
        self.blocks = {part: SharedArrays(shapes) for part, shapes in layout(about.sizes).items()}
        self._pipe.send({part: block.name for part, block in self.blocks.items()})

    def __call__(self, *orders):
        """Obey; the lines that came back, as (kind, text)."""
        for order in orders:
            self.worker.obey(order)
        said = []
        while self._pipe.poll(0):
            event = self._pipe.recv().event
            said += [(event.kind, event.text)] if event.text else []
        return said

    def seen(self, part="moment"):
        return self.blocks[part].read()

    def close(self):
        self.worker.close()
        for block in self.blocks.values():
            block.close()


@pytest.fixture(scope="module")
def hopper():
    """A hopper that learns, some decisions old; tests go on where others stopped."""
    driven = Driven(setup_of("hopper", seed=3))
    yield driven
    driven.close()


@pytest.fixture
def driven():
    """Makes workers, and closes them."""
    made = []

    def make(setup):
        made.append(Driven(setup))
        return made[-1]

    yield make
    for each in made:
        each.close()
