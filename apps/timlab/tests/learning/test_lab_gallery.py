"""Every diagram of the gallery runs and can be kept; learners learn, and the others do what their comments say."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import timlab
from timlab.gallery import GALLERY, example

SEEDS = 16
GAINS = {
    "motoneuron-pool": (20_000, 0.2),
    "spiking-pool": (40_000, 0.01),
    "linear-recruitment": (20_000, 0.2),
    "particle": (12_000, 0.05),
    "constructive-pool": (24_000, 0.01),
    "orbit": (20_000, 0.02),
    "chain": (6_000, 0.02),
    "hopper": (6_000, 0.03),
    "network": (6_000, 0.02),
    "memory": (40_000, 0.05),
    "leg-controller": (6_000, 0.1),
}
"""For how many ticks, and by how much the reward is to rise from the first eighth of them to the last."""
SHARE = ("motoneuron-pool", "leg-controller")  # the others take minutes


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.ci if n in SHARE else pytest.mark.slow) for n in GAINS]
)
def test_it_learns(name):
    ticks, rise = GAINS[name]
    made = example(name)
    reward = "reward.y" if "reward" in made.nodes else "world.reward"
    seen = timlab.Run(made, SEEDS, watch=[reward]).advance(ticks)[reward]
    parts = seen.reshape(SEEDS, 8, -1).mean(2)
    gained = parts[:, -1] - parts[:, 0]
    assert gained.mean() > rise
    assert gained.mean() > 3 * gained.std(ddof=1) / np.sqrt(SEEDS)


ALIKE = ("constructive-pool", "orbit", "particle")  # pools in a world, as others are


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.ci if n in ALIKE else ()) for n in GALLERY])
def test_it_is_sound_and_lasts(name):
    made = example(name)
    assert timlab.problems(made) == []
    assert made.title
    assert len(made.comment) > 100
    assert timlab.loads(timlab.dumps(made)) == made
    assert example(name) is not made


def test_an_unknown_one_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="did you mean 'hopper'"):
        example("hoper")


@pytest.mark.ci
def test_without_anti_windup_the_process_overshoots():
    seen = timlab.Run(example("pid")).advance(4000)
    assert seen["response.tracked"].max() < 1.02
    assert seen["response.wound_up"].max() > 1.25
    commands = {name: np.abs(seen[f"command.{name}"]).max() for name in ("tracked", "wound_up")}
    assert commands["tracked"] <= np.float32(1.6) < commands["wound_up"]


@pytest.mark.ci
def test_the_lorenz_system_follows_its_equations_and_forgets_its_start():
    seen = timlab.Run(example("lorenz")).advance(4001)

    def slope(_, state):
        x, y, z = state
        return [10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z]

    exact = solve_ivp(slope, (0, 5), [1.0, 1.0, 20.0], rtol=1e-10, atol=1e-10, t_eval=np.arange(0, 5, 0.01))
    x = seen["over time.x"][0]
    np.testing.assert_allclose(x[:500, 0], exact.y[0], atol=2e-2)
    apart = np.abs(x[:, 0] - x[:, 1])
    assert apart[:100].max() < 0.01
    assert apart[1500:].max() > 10


@pytest.mark.ci
def test_the_ball_bounces_at_last_as_high_as_its_plate_throws_it():
    height = timlab.Run(example("ball")).advance(1500)["flight.height"][0]
    assert height.min() > -1e-4  # hits are located between ticks
    np.testing.assert_allclose(height[-200:].max(), 2.0**2 / (2 * 9.81), rtol=1e-3)


@pytest.mark.ci
def test_the_pendulum_is_balanced_and_swings_freely_without_its_regulator():
    run = timlab.Run(example("pendulum"), watch=["position.y", "speed.y", "angle.y", "rate.y"])
    assert np.abs(run.advance(600)["angle.y"][0, 500:]).max() < 0.1
    run.reset()
    run["strength.gain"], run["push.high"] = 0.0, 0.0
    seen = run.advance(500)
    speed, angle, rate = (seen[f"{name}.y"][0].astype(float) for name in ("speed", "angle", "rate"))
    bob = (speed + 0.5 * rate * np.cos(angle)) ** 2 + (0.5 * rate * np.sin(angle)) ** 2
    energy = 0.5 * 1.0 * speed**2 + 0.5 * 0.2 * bob + 0.2 * 9.81 * 0.5 * np.cos(angle)
    np.testing.assert_allclose(energy, energy[0], rtol=2e-3)  # nothing brakes it
    assert np.abs(angle).max() > 3


def test_a_neuron_without_synapses_fires_at_the_rate_of_its_closed_form():
    made = example("spiking")
    run = timlab.Run(made)
    run["coupling.gain"] = 0.0
    fired = run.advance(6000)["spikes.u"][0] > 0
    drives = np.asarray(made.nodes["bias"].block.value)
    for neuron in np.flatnonzero(np.abs(drives - 1) > 0.01):
        times = np.flatnonzero(fired[:, neuron])
        if drives[neuron] < 1:
            assert len(times) <= 1
            continue
        period = 0.02 * np.log(drives[neuron] / (drives[neuron] - 1)) / 0.0005  # ticks, from 0 to the threshold
        assert np.ptp(np.diff(times)) <= 1
        assert abs(np.diff(times).mean() - (np.ceil(period) + 1)) <= 1  # the tick of the reset, and rounding
    run.reset()
    run["coupling.gain"] = 15.0
    assert (run.advance(4000)["spikes.u"][0] > 0).sum() > 2 * fired[:4000].sum()
