"""Gymnasium environments in worker processes, each with a share of the rows of a batch."""

import contextlib
import os
import pickle
import subprocess
import sys
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
from jaxtyping import Float

from motorgrad._arrays import AnyArray
from motorgrad._consent import allow
from motorgrad._processes import environment
from motorgrad._signals import leave_to_parent
from motorgrad.tasks.gymnasium._batch import EnvironmentBatch, EnvironmentState

COMMAND = (sys.executable, "-c", "from motorgrad.tasks.gymnasium._workers import serve; serve()")
PATIENCE = 5.0  # s, after which a worker that does not end is killed


class WorkerBatch:
    """As `EnvironmentBatch`, with the environments shared out to processes, which step them at the same time.

    An environment depends on its seed and its actions alone, so the number of processes changes no number. A process is
    started anew rather than forked, as a fork of a process with threads may hang. It knows the environments that are
    registered here.

    **Arguments:** the number of `workers`, at most one per seed; then as `EnvironmentBatch`.
    """

    def __init__(self, workers: int, env_id: str, kwargs: Mapping[str, Any], seeds: Sequence[int], *settings: object):
        import cloudpickle
        import gymnasium

        self.seeds = [int(seed) for seed in seeds]
        self.lost = False
        shares = np.array_split(np.arange(len(self.seeds)), min(workers, len(self.seeds)))
        self._ends = [0, *(int(share[-1]) + 1 for share in shares)]
        spec = gymnasium.registry.get(env_id)
        self._workers = [_Worker() for _ in shares]
        self._close = weakref.finalize(self, _stop, self._workers)
        for worker, share in zip(self._workers, shares, strict=True):
            own = [self.seeds[row] for row in share]
            worker.send((sys.path, cloudpickle.dumps((spec, (env_id, kwargs, own, *settings)))))
        parts = [worker.receive() for worker in self._workers]
        self._unpack = parts[0][1]
        self.packed = np.concatenate([packed for packed, _ in parts])

    def step(self, actions: Float[np.ndarray, "seeds size"]) -> None:
        self._take(self._ask("step", [(np.array(part),) for part in self._parted(actions)]))

    def reset(self, rows: Sequence[int] | np.ndarray | None = None) -> None:
        """Start a new episode; an environment's random numbers continue."""
        wanted = np.arange(len(self.seeds)) if rows is None else np.asarray(rows, int)
        bounds = list(zip(self._ends, self._ends[1:], strict=False))
        asked = [(wanted[(first <= wanted) & (wanted < end)] - first,) for first, end in bounds]
        self._take(self._ask("reset", asked))

    @property
    def unpack(self) -> Callable[[Float[AnyArray, "*rows width"]], EnvironmentState]:
        return self._unpack

    def snapshot(self) -> dict[str, np.ndarray]:
        """As `EnvironmentBatch.snapshot`."""
        parts = [found for found, _ in self._ask("snapshot", [()] * len(self._workers))]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """As `EnvironmentBatch.restore`."""
        parts = {name: self._parted(snapshot[name]) for name in snapshot}
        self._take(
            self._ask("restore", [({n: part[i] for n, part in parts.items()},) for i in range(len(self._workers))])
        )

    def _parted(self, rows: np.ndarray) -> list[np.ndarray]:
        return np.split(rows, self._ends[1:-1])

    def _ask(self, method: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """The answers of all workers, which work at the same time. **Raises** the first error of one."""
        for worker, given in zip(self._workers, arguments, strict=True):
            worker.send((method, given))
        answers = [worker.receive(method) for worker in self._workers]
        for _, error in answers:
            if isinstance(error, Exception):
                raise error
        return answers

    def _take(self, answers: list[Any]) -> None:
        for (packed, _), first, end in zip(answers, self._ends, self._ends[1:], strict=False):
            self.packed[first:end] = packed
        self.lost = bool((self.packed[:, -1] > 0).any())


class _Worker:
    """The process of a share, and the pipes to it."""

    def __init__(self) -> None:
        with environment():
            self.process = subprocess.Popen(COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def send(self, message: object) -> None:
        assert self.process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # `receive` says what happened
            pickle.dump(message, self.process.stdin, protocol=pickle.HIGHEST_PROTOCOL)
            self.process.stdin.flush()

    def receive(self, method: str = "the start") -> Any:
        assert self.process.stdout is not None
        try:
            answer, error = pickle.load(self.process.stdout)
        except EOFError:
            status = self.process.wait()
            raise RuntimeError(f"a worker process ended during {method} with status {status}") from None
        if isinstance(error, Exception) and method == "the start":
            raise error
        return answer, error


def _stop(workers: Sequence[_Worker]) -> None:
    """End the processes: a worker whose input ends closes its environments."""
    for worker in workers:
        with contextlib.suppress(OSError):
            worker.process.stdin.close()  # type: ignore[union-attr]
    for worker in workers:
        try:
            worker.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            worker.process.kill()
            worker.process.wait()
        worker.process.stdout.close()  # type: ignore[union-attr]


def serve() -> None:
    """Run a worker: obey the orders at the standard input until it ends, and answer at the standard output."""
    leave_to_parent()
    orders = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what environments print must not come between the answers
    sys.path[:], payload = pickle.load(orders)
    try:
        batch = _made(payload)
        first = None
    except Exception as error:
        batch = None
        first = _sendable(error)
    _answer(answers, (None, first) if batch is None else (batch.packed, batch.unpack))
    while batch is not None:
        try:
            method, given = pickle.load(orders)
        except EOFError:
            return
        try:
            found = getattr(batch, method)(*given)
            _answer(answers, (batch.packed if found is None else found, None))
        except Exception as error:
            _answer(answers, (None, _sendable(error)))


def _made(payload: bytes) -> EnvironmentBatch:
    import cloudpickle
    import gymnasium

    spec, arguments = cloudpickle.loads(payload)
    if spec is not None:
        gymnasium.registry.setdefault(spec.id, spec)
    env_id, kwargs, *_ = arguments
    allow([env_id, *(value for value in kwargs.values() if isinstance(value, str))])  # as they are in the parent
    return EnvironmentBatch(*arguments)


def _answer(pipe: BinaryIO, message: object) -> None:
    pickle.dump(message, pipe, protocol=pickle.HIGHEST_PROTOCOL)
    pipe.flush()


def _sendable(error: Exception) -> Exception:
    """The error if the parent can read it, else one that says the same."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        failure = RuntimeError(f"{type(error).__name__}: {error}")
        for note in getattr(error, "__notes__", ()):
            failure.add_note(note)
        return failure
    return error
