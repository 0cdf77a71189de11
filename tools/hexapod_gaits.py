"""How fast the hexapod's body can walk by a rhythm: `python -m tools.hexapod_gaits`, from the root of a checkout.

    python -m tools.hexapod_gaits runs/gaits   # CMA-ES, two seeds; a quarter of an hour; continues if it is stopped

Nothing is learned and nothing is sensed: each muscle is active for a part of a cycle. The left legs do half a cycle
later what the right ones do. CMA-ES searches for the frequency, and for the phase and the duty of the twelve muscles of
one side. It starts from tripods in alternation. What it finds tells what speed muscles, joints and the time between
decisions allow, for comparison with what a learner without such knowledge reaches (docs/reproduction-muscles.md).
"""

import argparse
from pathlib import Path

import numpy as np

from motorgrad.environments import TaskVectorEnv
from motorgrad.search import CmaEs, Range, Space, search
from motorgrad.tasks import Hexapod

COURSE = 100_000  # decisions: one direction for all of a walk
# decisions: before the speed counts, and in all
SETTLING = 30
LENGTH = 120
POPULATION = 48
ROUNDS = 120
STARTS = (4.0, 6.0, 8.0)  # Hz, of the seeds in turn
LONG = 3_000  # decisions of the last evaluation, a minute
TASK = Hexapod(course=COURSE)
GROUPS: list[str] = list(TASK.body.groups)
RIGHT = [name for name in GROUPS if "_right_" in name]
RHYTHM_SETTINGS = ("phase", "duty")
LEFT = [name.replace("_right_", "_left_") for name in RIGHT]


def space(frequency: float) -> Space:
    """Frequency, phases and duties, from this frequency on, with tripods in alternation."""
    ranges = {"frequency": Range(2.0, 10.0, start=frequency)}
    for name in RIGHT:
        middle = "middle" in name
        stance = name.startswith(("retractor", "depressor"))
        ranges[f"phase {name}"] = Range(-0.5, 1.0, start=0.5 * (middle != stance))
        ranges[f"duty {name}"] = Range(0.0, 1.0, start=0.5)
    return Space(ranges)


def walk(rhythms: list[dict[str, float]], decisions: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Walks by rhythms, from a standing start: velocities along the first heading and along the present one,
    (decisions, rhythms) in m/s, and whether each has fallen."""
    environment = TaskVectorEnv(len(rhythms), TASK)
    environment.reset(seed=0)
    frequency = np.array([each["frequency"] for each in rhythms])
    phases, duties = (
        np.array([[each[f"{kind} {name}"] for name in RIGHT] for each in rhythms]) for kind in RHYTHM_SETTINGS
    )
    action = np.zeros((len(rhythms), len(GROUPS)), np.int8)
    straight, speed = np.zeros((2, decisions, len(rhythms)))
    fallen = np.zeros(len(rhythms), bool)
    for k in range(decisions):
        cycles = frequency * k * TASK.period
        for names, lag in ((RIGHT, 0.0), (LEFT, 0.5)):
            places = [GROUPS.index(name) for name in names]
            action[:, places] = (cycles[:, None] - lag - phases) % 1 < duties
        _, reward, terminated, truncated, info = environment.step(action)
        straight[k] = reward / TASK.reward_scale
        speed[k] = info["speed"]
        fallen |= terminated | truncated
    environment.close()
    return straight, speed, fallen


def score(rhythms: list[dict[str, float]], random: np.random.Generator) -> np.ndarray:
    """The mean velocity along the first heading, in m/s; NaN for a body that falls."""
    del random  # a rhythm and its body have no chance
    straight, _, fallen = walk(rhythms, LENGTH)
    return np.where(fallen, np.nan, straight[SETTLING:].mean(axis=0))


def main(arguments: list[str] | None = None) -> None:
    """Search, and print how fast the best rhythm of each seed walks for a minute."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.hexapod_gaits", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("out", type=Path, help="directory of the searches, which continue there")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    method = CmaEs(population=POPULATION, width=0.12)
    for seed in range(given.seeds):
        start = space(STARTS[seed % len(STARTS)])
        out = given.out / f"{seed}.npz"
        found = search(score, start, method, evaluations=POPULATION * given.rounds, seed=seed, out=out)
        straight, speed, fallen = walk([found.best], LONG)
        print(f"seed {seed}: {np.nanmax(found.scores):.2f} m/s at {found.best['frequency']:.1f} Hz;", end=" ")
        print(f"a minute: {speed.mean():.2f} m/s along the heading, {straight.mean():.2f} m/s net", end="")
        print(", with falls" if fallen[0] else "", flush=True)


if __name__ == "__main__":
    main()
