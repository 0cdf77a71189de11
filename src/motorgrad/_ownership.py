"""Whether this user wrote something: a signature with a key that nobody else has, as Jupyter signs notebooks.

A checksum finds accidents, but anyone can compute one. The key lies in the user's data folder and is made on first use.
"""

import contextlib
import functools
import hashlib
import hmac
import os
import secrets
import stat
import sys
from pathlib import Path

KEY_BYTES = 32


def signature(content: bytes) -> str:
    """The signature of bytes that this user wrote, in hexadecimal (HMAC with SHA-256)."""
    return hmac.new(_key(_key_file()), content, hashlib.sha256).hexdigest()


def is_signed(content: bytes, mark: str) -> bool:
    """Whether `mark` is this user's signature of these bytes."""
    return hmac.compare_digest(signature(content).encode(), mark.strip().encode())


def _key_file() -> Path:
    home = Path(os.path.expanduser("~"))
    if sys.platform == "darwin":
        data = home / "Library" / "Application Support"
    else:
        named = os.environ.get("APPDATA" if os.name == "nt" else "XDG_DATA_HOME", "")
        data = Path(named) if os.path.isabs(named) else home / ".local" / "share"
    return data / "motorgrad" / "key"


@functools.cache
def _key(file: Path) -> bytes:
    """The key, made if there is none. Where it can neither be read nor kept, one for this process alone."""
    with contextlib.suppress(OSError):
        with contextlib.suppress(FileExistsError):
            file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            made = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o600)
            with os.fdopen(made, "wb") as stream:
                stream.write(secrets.token_bytes(KEY_BYTES))
        if (key := _private(file)) is not None:
            return key
    return secrets.token_bytes(KEY_BYTES)


def _private(file: Path) -> bytes | None:
    """The content of a key file; `None` if it is no file, or one that others may read, write or have made."""
    opened = os.open(file, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(opened, "rb") as found:
        about = os.fstat(found.fileno())
        ours = os.name == "nt" or (about.st_uid == os.getuid() and not about.st_mode & 0o077)
        content = found.read(KEY_BYTES + 1) if stat.S_ISREG(about.st_mode) and ours else b""
    return content if len(content) == KEY_BYTES else None
