"""Optional packages, and the error that names the extra that installs them."""

import importlib.util

FILM = ("a film needs", "imageio_ffmpeg", "video")
"""What `require` is given before a film (.mp4) is made."""


class MissingExtra(RuntimeError):
    """A package is missing that an extra of motorgrad installs."""


def installed(package: str) -> bool:
    """Whether a package can be imported. It is not imported."""
    return importlib.util.find_spec(package) is not None


def install(extra: str) -> str:
    """What to type to install an extra."""
    return f"pip install 'motorgrad[{extra}]', or in a checkout python tools/install.py {extra}"


def missing(what: str, package: str, extra: str) -> MissingExtra:
    """The error where `what` needs a package of an extra. `what` begins the message, with its verb: "TimSim needs"."""
    return MissingExtra(f"{what} the package {package}: {install(extra)}")


def require(what: str, package: str, extra: str) -> None:
    """Raise `MissingExtra` unless a package can be imported, without importing it. Arguments as of `missing`."""
    if not installed(package):
        raise missing(what, package, extra)
