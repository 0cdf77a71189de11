"""A view of what the user has, from Python."""

from typing import Any

from motorgrad.sim.live import Session, Speed, Stage, setup_of
from motorgrad.sim.page._address import HERE, check_port, warn_of
from motorgrad.sim.page._page import Page
from motorgrad.sim.planet import Planet


def show(
    subject: Any,
    agent: Any = None,
    seed: int = 0,
    run: Any = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
    playing: bool = True,
    speed: float = 1.0,
    host: str = HERE,
    port: int | None = None,
) -> Page:
    """`motorgrad.sim.view`."""
    Speed(speed)  # refuses at once what is impossible
    check_port(host, port)
    setup = setup_of(subject, agent, seed, run=run, frozen=frozen, stage=stage, planet=planet)
    warn_of(host)
    session = Session(setup, playing=playing, speed=speed)
    try:
        return Page(session, host, port)
    except BaseException:
        session.close()
        raise
