"""Where a page is reached, and by whom."""

import socket
import warnings

from motorgrad._errors import check

HERE = "127.0.0.1"
PORT = 8080


class ExposedWarning(UserWarning):
    """The page can be reached from elsewhere."""


def warn_of(host: str) -> None:
    """Say what another host than this machine's own means."""
    if host not in (HERE, "localhost", "::1"):
        said = f"host = {host!r}: whoever reaches this port can drive the simulation, and read and write policy files"
        warnings.warn(said, ExposedWarning, stacklevel=3)


def check_port(host: str, port: int | None) -> None:
    """Refuse a port that cannot be had. **Raises** `ValueError`."""
    if port is None:
        return
    check(isinstance(port, int) and 1 <= port <= 65535, "port", port, "from 1 to 65535")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            why = error.strerror or str(error)
            raise ValueError(f"port = {port}: cannot be listened at on {host}: {why.lower()}") from None
