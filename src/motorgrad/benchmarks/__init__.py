"""The speed table: ratios measured side by side in one run, against bare physics and hand-written loops."""

from collections.abc import Iterator

from motorgrad.benchmarks._measure import Row, in_turn, rate

__all__ = ["ROWS", "Row", "in_turn", "rate", "speed_table"]

ROWS = "motorgrad.benchmarks"
"""The group of entry points of applications that have rows of their own: functions of whether they be quick, and of how
many pairs to measure."""


def speed_table(quick: bool = False) -> Iterator[Row]:
    """Measure the speed table, and yield its rows one by one. `quick` makes it small enough for a smoke test."""
    from motorgrad._applications import entries
    from motorgrad.benchmarks import _bodies, _learners, _measure, _networks
    from motorgrad.benchmarks._arm18 import reach18
    from motorgrad.tasks import Hexapod, HexapodSynergy, Hopper, from_gymnasium

    pairs = 2 if quick else 7
    yield _bodies.body_row("hopper", Hopper(), 16, 50 if quick else 1500, pairs, "≥ 0.8")
    yield _bodies.body_row("hopper", Hopper(), 1, 100 if quick else 8000, pairs, "≥ 0.65")
    for name, task in (("hexapod on synergies", HexapodSynergy()), ("hexapod on 24 muscles", Hexapod())):
        row = _bodies.body_row(name, task, 16, 20 if quick else 640, pairs, "≥ 0.9")
        yield row
        yield _bodies.simulated_row(row, task)
    arm = "composed reach, arm of 18 muscles"
    yield from _bodies.composed_rows(arm, reach18(), 16, 20 if quick else 640, pairs, "≥ 0.85")
    yield from _bodies.suite_rows("myoFingerPoseRandom-v0", 16, 20 if quick else 1000, pairs, "≥ 0.85")
    yield from _bodies.tendon_rows(1, 20 if quick else 2000, pairs)
    yield _learners.three_state_row(1, 10_000 if quick else 2_000_000, pairs, "≥ 0.4")
    yield _learners.three_state_row(1024, 100 if quick else 5000, pairs, "≥ 0.8")
    yield _learners.sweep_row(10 if quick else 100, 16, 100 if quick else 4000, pairs, "≥ 0.9")
    yield _learners.recruitment_row(1, 10_000 if quick else 1_000_000, pairs, "≥ 0.35")
    yield _learners.recruitment_row(1024, 100 if quick else 2000, pairs, "≥ 0.8")
    yield _learners.natural_row(1, 5_000 if quick else 300_000, pairs)
    yield _learners.natural_row(1024, 50 if quick else 500, pairs)
    yield _learners.particle_row(1, 5_000 if quick else 300_000, pairs, "≥ 0.2")
    yield _learners.particle_row(1024, 50 if quick else 1000, pairs, "≥ 0.8")
    yield _learners.local_learning_row(20, 20 if quick else 2000, "≤ 15")
    yield _learners.index_row(64 if quick else 4096, 1, 200 if quick else 5_000, pairs, "≥ 8")
    yield _learners.index_row(64 if quick else 4096, 20, 20 if quick else 500, pairs)
    yield _networks.network_row(100 if quick else 10_000, 20 if quick else 1_000, pairs, "≥ 10,000")
    yield _bodies.vector_row(16, 20 if quick else 1500, pairs)
    yield _bodies.single_row(50 if quick else 5000, pairs)
    yield _bodies.foreign_row(10, 50 if quick else 5000, pairs)
    for name, task in (("Pendulum-v1", from_gymnasium("Pendulum-v1")), ("hopper", Hopper())):
        yield _bodies.shared_row(name, task, 16, 20 if quick else 500, pairs)
    for offer in entries(ROWS).values():
        yield from offer.load()(quick, pairs)
    yield _measure.start_row("import motorgrad", ["-c", "import motorgrad"], "≤ 0.3")
    yield _measure.start_row("motorgrad --help", ["-m", "motorgrad", "--help"], "≤ 0.6")
    yield _measure.memory_row("≤ 1.5")
    yield _measure.seed_memory_row()
    yield from _bodies.learning_rows(2 if quick else 16, 50.0 if quick else 1500.0)
