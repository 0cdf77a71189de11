"""Ray on this machine, for this process and nobody else."""

import contextlib
import ipaddress
import secrets
import warnings
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from motorgrad._processes import SAFE, environment

ALONE = {
    "RAY_AUTH_MODE": "token",
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # as by default on these systems: it listens on loopback
}
WANTED = "start it yourself with `ray start --head`, and give the address auto"


@contextlib.contextmanager
def ray_alone(ray: ModuleType, processors: int, **options: Any) -> Iterator[None]:
    """Ray, from here to the end of the context. It listens to this machine alone, and to nobody without a token that is
    drawn here; it has no dashboard, and reports nothing to its makers.

    **Arguments:** the module; the number of processors; `options` of `ray.init`.

    **Raises** `RuntimeError` where it would listen to other machines.
    """
    with _settings(ray), contextlib.ExitStack() as started:
        started.callback(ray.shutdown)
        with warnings.catch_warnings():  # Ray forks, and executes a program at once
            warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
            ray.init("local", num_cpus=processors, include_dashboard=False, **options)
        address = ray.util.get_node_ip_address()
        if not ipaddress.ip_address(address).is_loopback:
            raise RuntimeError(f"Ray {ray.__version__} listens on {address}, beyond this machine; {WANTED}")
        yield


@contextlib.contextmanager
def _settings(ray: ModuleType) -> Iterator[None]:
    """Let Ray have these settings, which it is made to read again: it has done so when it was imported."""
    try:
        from ray._private import ray_constants as constants  # type: ignore[import-not-found]
        from ray._raylet import AuthenticationTokenLoader, Config  # type: ignore[import-not-found]
    except ImportError as error:
        raise RuntimeError(f"Ray {ray.__version__} takes no token where it is started from Python; {WANTED}") from error

    def read() -> None:
        Config.initialize("")
        AuthenticationTokenLoader.instance().reset_cache()

    clusters = constants.ENABLE_RAY_CLUSTER
    try:
        with environment({**SAFE, **ALONE, "RAY_AUTH_TOKEN": secrets.token_hex(32)}):
            constants.ENABLE_RAY_CLUSTER = False
            read()
            yield
    finally:
        constants.ENABLE_RAY_CLUSTER = clusters
        read()
