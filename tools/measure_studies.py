"""Measure what studies cost beside learning: python tools/measure_studies.py outside|workers|ray [--small].

- `outside`: the share of the time outside learning, 10,000 settings × 10 seeds of a small world in one process.
- `workers`: how much faster two processes of one thread each are than one.
- `ray`: the overhead of 500 jobs of some two seconds on Ray, on this machine.

Learning is what `wall_time` of the runs counts, with compiling. Let nothing else run on the machine.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import motorgrad as mg
from motorgrad.studies import Results, Study

RATES = {"low": 1e-4, "high": 1.0, "scale": "log"}


def rates(count: int, **more: Any) -> Study:
    """A study of learning rates on a small world."""
    given: dict[str, Any] = {"task": "three-state", "agent": {"learning_rate": RATES}}
    return Study(**given, design={"kind": "random", "count": count}, **more)  # type: ignore[arg-type]


def run(study: Study, **options: Any) -> tuple[float, float]:
    """The seconds that a study takes, from its checks on, and those of learning in all its jobs."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.monotonic()
        results = study.run(Path(folder) / "study", progress=False, **options)
        took = time.monotonic() - start
        assert results.complete, results.failures
        return took, learned(results)


def learned(results: Results) -> float:
    """The seconds of learning in all jobs."""
    paths = (results.path / "jobs" / job.name for job in results.study.jobs)
    return sum(float(mg.load(path).metrics["wall_time"][-1].as_py()) for path in paths)


def outside(small: bool) -> None:
    """Print the share of the time outside learning."""
    study = rates(200 if small else 10_000, seeds=10, steps=1_000 if small else 100_000)
    took, learning = run(study)
    print(
        f"{len(study.jobs)} jobs: {took:.1f} s, learning {learning:.1f} s: {1 - learning / took:.1%} outside learning"
    )


def workers(small: bool) -> None:
    """Print how much faster two processes are than one."""
    study = rates(8 if small else 40, seeds=10, steps=10_000 if small else 4_000_000, lanes=20)
    one, _ = run(study, on="processes", workers=1, threads=1)
    two, _ = run(study, on="processes", workers=2, threads=1)
    print(f"{len(study.jobs)} jobs: one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} times as fast")


def ray(small: bool) -> None:
    """Print the overhead of jobs on Ray."""
    import ray as library  # type: ignore[import-not-found]

    library.init(address="local", include_dashboard=False, log_to_driver=False)
    count = int(library.cluster_resources()["CPU"])
    steps = 10_000 if small else calibrated(2.0)
    study = rates(4 if small else 500, seeds=1, steps=steps, lanes=1)
    run(rates(count, seeds=1, steps=1_000, lanes=1), on="ray", threads=1)  # the workers load and compile
    took, learning = run(study, on="ray", threads=1)
    print(f"{len(study.jobs)} jobs on {count} workers: {took:.1f} s, learning {learning:.1f} s: overhead ", end="")
    print(f"{took * count / learning - 1:.1%}")


def calibrated(seconds: float) -> int:
    """The decisions of one seed that take so many seconds here."""
    steps = 5_000_000
    mg.train("three-state", steps=1_000, threads=1, progress=False)  # compiles
    made = mg.train("three-state", steps=steps, threads=1, progress=False)
    return round(steps * seconds / float(made.metrics["wall_time"][-1].as_py()))


if __name__ == "__main__":
    {"outside": outside, "workers": workers, "ray": ray}[sys.argv[1]]("--small" in sys.argv)
