"""Block types of a user's own file, by a decorator."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any, TypeVar, overload

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from timlab.diagram._block import BLOCKS, Block

B = TypeVar("B", bound=type[Block])
TAKEN = {"diagram"}  # the type of a subsystem in files
CATEGORY = "mathematics"


@overload
def block(kind: B) -> B: ...
@overload
def block(*, name: str = "", category: str = "") -> Callable[[B], B]: ...
def block(kind: Any = None, *, name: str = "", category: str = "") -> Any:
    """Register a class as a block type: a decorator for classes under `Block`, `Sink` or `HostBlock`.

    The class becomes a frozen dataclass if it is none. The editor lists it, and diagram files know it by its name,
    wherever its file is imported first: `motorgrad lab diagram.json --import my_blocks.py`.

    **Arguments:**

    - `name`: of the type in files; by default the class's own `name`, or the words of the class's name.
    - `category`: the heading in the editor; by default the class's own `category`, or "mathematics".

    **Raises:** `ValueError` for what is no block, and for a name that another type has.

    ```python
    @timlab.block
    class Double(timlab.Block):
        inputs = {"u": timlab.Port()}
        outputs = {"y": timlab.Port()}

        def output(self, state, inputs, now):
            return {"y": 2 * inputs["u"]}
    ```
    """
    check_arguments(block, locals())

    def registered(kind: type[Block]) -> type[Block]:
        check(isinstance(kind, type) and issubclass(kind, Block), "block", kind, "a class under timlab.Block")
        own = kind if "__dataclass_params__" in vars(kind) else dataclasses.dataclass(frozen=True)(kind)
        frozen = vars(own)["__dataclass_params__"].frozen
        check(frozen, "block", kind.__name__, "a frozen dataclass")
        words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind.__name__).lower()
        own.name = name or getattr(own, "name", words)
        own.category = category or getattr(own, "category", CATEGORY)
        other = BLOCKS.get(own.name)
        same = other is not None and (other.__module__, other.__qualname__) == (own.__module__, own.__qualname__)
        check((other is None or same) and own.name not in TAKEN, "name", own.name, "a name that no other type has")
        BLOCKS[own.name] = own
        return own

    return registered if kind is None else registered(kind)
