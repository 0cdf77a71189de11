"""Live runs: a simulation in its own process. Pages read its snapshots and send it orders.

```py
session = Session(setup_of("hopper", seed=3), speed=2.0)
session.order(Edit("agent.optimizer.learning_rate", 1e-3))
session.snapshot().decision
session.close()
```
"""

from timsim.live._beside import side_by_side
from timsim.live._branches import Alongside, Delete, Fork, Rename, Switch
from timsim.live._drive import PATTERNS, Drive, DriveRecorded, control_limits
from timsim.live._foreign import Picture
from timsim.live._messages import (
    MIN_SPEED,
    Compare,
    Control,
    Edit,
    Freeze,
    Load,
    Look,
    Order,
    Pause,
    Play,
    Push,
    Reset,
    Save,
    Scrub,
    Speed,
    Step,
    Thaw,
    Undo,
)
from timsim.live._numbers import MUSCLE_FIELDS, WORLD, field_of, geom_of, owned
from timsim.live._policy import confined
from timsim.live._replies import Branch, Event
from timsim.live._session import Session, succeed
from timsim.live._settings import declared_setting
from timsim.live._setup import (
    MYOSUITE,
    Camera,
    Setup,
    Stage,
    acting,
    is_path,
    named_subject,
    setup_of,
    with_motion,
)
from timsim.live._snapshot import MAX_BODIES, Curve, Snapshot, Trail

__all__ = [
    "MAX_BODIES",
    "MIN_SPEED",
    "MUSCLE_FIELDS",
    "MYOSUITE",
    "PATTERNS",
    "WORLD",
    "Alongside",
    "Branch",
    "Camera",
    "Compare",
    "Control",
    "Curve",
    "Delete",
    "Drive",
    "DriveRecorded",
    "Edit",
    "Event",
    "Fork",
    "Freeze",
    "Load",
    "Look",
    "Order",
    "Pause",
    "Picture",
    "Play",
    "Push",
    "Rename",
    "Reset",
    "Save",
    "Scrub",
    "Session",
    "Setup",
    "Snapshot",
    "Speed",
    "Stage",
    "Step",
    "Switch",
    "Thaw",
    "Trail",
    "Undo",
    "acting",
    "confined",
    "control_limits",
    "declared_setting",
    "field_of",
    "geom_of",
    "is_path",
    "named_subject",
    "owned",
    "setup_of",
    "side_by_side",
    "succeed",
    "with_motion",
]
