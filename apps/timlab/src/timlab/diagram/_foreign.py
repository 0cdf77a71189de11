"""Blocks that run code from elsewhere: nothing of it runs before its user says so."""

import contextlib
import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from typing import Any, ClassVar

from motorgrad._errors import NotTrusted

HOW = "trust=True in Python, --trust on the command line"
_trusted: set[str] = set()
_refused: set[str] = set()
_source: ContextVar[str] = ContextVar("source", default="user")


@contextlib.contextmanager
def from_a_file(trust: bool) -> Iterator[None]:
    """While blocks are made of what a file says, or the editor's page, which the user trusts or not."""
    token = _source.set("trusted" if trust else "doubted")
    try:
        yield
    finally:
        _source.reset(token)


def is_from_a_file() -> bool:
    """Whether a file is being read now: nothing of it is even compiled."""
    return _source.get() != "user"


class Foreign:
    """A block that runs code which is no part of motorgrad nor imported: Python source, or a compiled library.

    Code that first appears in a file whose user does not trust it is refused, in this process and under whatever
    settings, until it is trusted; so is code that is written in the editor's page, without `--trust`. Code that first
    appears in a block made in Python is the user's own. Code is known by its content, wherever it is kept.
    """

    brings: ClassVar[str] = ""
    """The field that names the code or holds it; empty where several do."""

    @property
    def key(self) -> str:
        """A hash of what would run."""
        return hashlib.sha256(f"{type(self).__name__}\0{self.code}".encode()).hexdigest()

    @property
    def code(self) -> str:
        """What would run, as its user sees it: the source, or the library's place and hash; empty for nothing."""
        raise NotImplementedError

    @property
    def structure(self) -> Any:
        """As that of any block; a compiled diagram runs the code that it was compiled with."""
        return super().structure, self.key  # pyright: ignore[reportAttributeAccessIssue]

    def __reduce__(self) -> tuple[Any, ...]:  # code that is not trusted is not trusted where it is sent, either
        fields: Any = dataclasses.fields(self)  # pyright: ignore[reportArgumentType]
        values = {field.name: getattr(self, field.name) for field in fields}
        return _rebuild, (type(self), values, self.key if self.is_trusted else "")

    def retuned(self, values: Mapping[str, Any]) -> Any:
        """As that of any block. A library whose file was exchanged since is not trusted with it."""
        named = not self.brings or self.brings in values
        with contextlib.nullcontext() if named else from_a_file(trust=False):
            return super().retuned(values)  # pyright: ignore[reportAttributeAccessIssue]

    def _meet(self) -> None:
        """Remember where this code was seen first. A subclass calls it when a block is made."""
        key = self.key
        source = _source.get()
        if source == "doubted" and key not in _trusted:
            _refused.add(key)
        elif source == "trusted" or key not in _refused:
            _refused.discard(key)
            _trusted.add(key)

    def trust(self) -> None:
        """Let this code run, in this process."""
        _refused.discard(self.key)
        _trusted.add(self.key)

    @property
    def is_trusted(self) -> bool:
        """Whether the code may run."""
        return not self.code or self.key in _trusted

    @property
    def distrust(self) -> str:
        """Why code that is not trusted does not run, and how to let it."""
        first = next((line.strip() for line in self.code.splitlines() if line.strip()), "")
        return (
            f"the diagram brings code of its own, {first[:60]!r}; nothing of it was run. If you trust it, say so: {HOW}"
        )

    def check_trusted(self) -> None:
        """Refuse to run code that nobody has trusted. **Raises** `NotTrusted`."""
        if not self.is_trusted:
            raise NotTrusted(f"{type(self).__name__}: {self.distrust}")


def _rebuild(kind: type[Foreign], values: Mapping[str, Any], trusted: str) -> Foreign:
    with from_a_file(trust=False):
        block = kind(**values)
    if block.key == trusted:
        block.trust()
    return block
