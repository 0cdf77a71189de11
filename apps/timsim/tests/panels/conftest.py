"""Real sessions to watch."""

from pathlib import Path

import mujoco
import pytest

from timsim.live import Session, Setup, setup_of

LEG = Path(__file__).parents[1] / "leg.xml"


@pytest.fixture(scope="module")
def hopping():
    """A hopper that learns, four times as fast as the clock."""
    from patience import until

    with Session(setup_of("hopper", seed=3), speed=4.0) as session:
        assert until(lambda: session.snapshot().decision > 450)
        yield session


@pytest.fixture(scope="module")
def legged():
    """A bare model with four muscles."""
    from patience import until

    model = mujoco.MjModel.from_xml_path(str(LEG))
    with Session(Setup("leg", model=model)) as session:
        assert until(lambda: session.snapshot().decision > 20)
        yield session
