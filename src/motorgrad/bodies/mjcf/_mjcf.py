"""Any MuJoCo model as a body: from a file, from text, or from a description made in Python."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import base64
import dataclasses
import functools
import hashlib
import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import mujoco

from motorgrad._errors import check, unknown
from motorgrad._myosuite import composing, description
from motorgrad.bodies._body import Actuator, to_mjcf
from motorgrad.bodies.mjcf._to_hill import to_hill
from motorgrad.bodies.models._bounds import asset_files
from motorgrad.bodies.models._read import checksum_of, compile_bare, compile_spec, in_source, read_spec
from motorgrad.bodies.models._scan import Documents, read_bytes
from motorgrad.bodies.muscles._hill import Curves, Hill, Tendon
from motorgrad.bodies.muscles._muscle import Muscle
from motorgrad.schema import Settings, number, static

BUNDLED = {"arm6": Path(__file__).with_name("arm6.xml")}
"""Models that come with the library, by name."""
MYOSUITE = "myosuite:"
"""What precedes the id of an environment of MyoSuite, whose model is meant, or the name of a model."""
_SHOWN = 60  # characters of a document in its representation
_UNNAMED = ("joint", "tendon", "actuator", "sensor")


@dataclasses.dataclass(frozen=True, repr=False)
class Mjcf(Settings):
    """Any MuJoCo model as a body, with every actuator that MuJoCo has: muscles with their activation dynamics, motors,
    position and velocity servos, and general ones, on joints, tendons or sites.

    `BodyBatch` steps it, `motorgrad.tasks.compose` makes a task of it, and TimSim and TimLab show it. An action has one
    number for each actuator, its control. Joints, tendons, actuators and sensors without a name are numbered by kind:
    `joint 1`, `actuator 2`.

    **Raises:** `ValueError`, in one line, for what MuJoCo refuses, for a model beyond the limits of size (see
    `read_model`), for a keyframe that does not exist, and for a file that is not what its checksum says.

    ```python
    body = mg.bodies.Mjcf("arm6")
    batch = mg.bodies.BodyBatch(body, seeds=4)
    batch.step(np.full((4, len(body.groups)), 0.5))
    print(batch.unpack(batch.packed).activation.shape)  # → (4, 6)
    ```
    """

    source: Path | str = static(
        "arm6",
        help="the path of an MJCF or URDF file, with its meshes and textures beside it; the document itself, "
        'as text; a `mujoco.MjSpec`; `"arm6"`, a two-joint arm with six muscles that comes with the '
        "library; or, where MyoSuite is installed, the model of one of its environments, "
        '`"myosuite:myoFingerPoseRandom-v0"`, or one of its models by name, such as `"myosuite:myolegs"` '
        'or `"myosuite:myofullbody"`. Text and descriptions are kept as they are, with the files that '
        "they name, so that a run with such a body needs no other file. A path is kept as an absolute "
        "path, with a checksum; a model of MyoSuite by its name, with a checksum",
    )
    start: str | None = static(
        None,
        help="the keyframe in which simulations start; by default the first, or the model's reference pose "
        "where it has none",
    )
    timestep: float = number(
        math.nan, 0, open_low=True, unit="s", help="time step of the physics, by default the model's own"
    )
    assets: tuple[tuple[str, str], ...] = static(
        (),
        help="the content of files that a document given as text names: pairs of the file's name and its content in "
        "base64. It is filled in",
    )
    checksum: str | None = static(
        None,
        help="checksum of a file and all that it includes or names, or of a model of MyoSuite. It is filled in. A body "
        "with another one is refused, so that a run never continues with a model that has changed",
    )
    muscle_model: Literal["native", "hill"] = static(
        "native",
        help='`"native"` for MuJoCo\'s own muscles; `"hill"` to put a Hill-type muscle in place of each that is on a '
        "tendon (see the page on muscles)",
    )
    tendon: Tendon = static("compliant", help="the tendons of Hill-type muscles")
    curves: Curves = static("de-groote", help="the curves of Hill-type muscles")
    hill: tuple[tuple[str, Hill], ...] = static(
        (),
        help='the numbers of some of them: pairs of an actuator\'s name, or a pattern such as `"flexor*"`, and a '
        "`Hill`. All others resemble MuJoCo's, as `hill_of` says",
    )

    def __post_init__(self) -> None:
        source: Any = self.source
        if isinstance(source, mujoco.MjSpec):
            object.__setattr__(self, "assets", _assets_of(source, Documents(set(), set())))
            object.__setattr__(self, "source", to_mjcf(source))
        own_step = isinstance(self.timestep, float) and math.isnan(self.timestep)
        if own_step:  # until the model is read
            object.__setattr__(self, "timestep", 1.0)
        super().__post_init__()
        source = self.source
        named = isinstance(source, str) and (source in BUNDLED or source.startswith(MYOSUITE))
        if isinstance(source, str) and not named and not Path(source).suffix and "<" not in source:
            raise unknown("model", source, [*BUNDLED, "or the path of an MJCF file"])
        if isinstance(source, Path) or (not named and "<" not in source):
            object.__setattr__(self, "source", Path(source).absolute())
        in_source(self._place, lambda: self._read(own_step))

    def validate(self) -> None:
        check(not self.hill or self.muscle_model == "hill", "hill", self.hill, "left out, or muscle_model be 'hill'")

    def _read(self, own_step: bool) -> None:
        """Read the model once: to refuse it before any work, and to know what it is."""
        spec, documents = read_spec(self._place, self._content)
        suite = self._suite
        if suite is not None or isinstance(self._place, Path):
            found = checksum_of(self._place, spec, documents) if isinstance(self._place, Path) else _checksum(suite)
            wanted = f"{found!r}, the checksum of the model, which is not what it was: put it back, or leave this out"
            check(self.checksum in (None, found), "checksum", self.checksum, wanted)
            object.__setattr__(self, "checksum", found)
        else:
            check(self.checksum is None, "checksum", self.checksum, "left out for a model given as text")
            if documents.files or (not self.assets and (spec.meshes or spec.textures or spec.hfields or spec.skins)):
                assets = _assets_of(spec, documents)
                if documents.files:  # what it includes becomes part of it
                    object.__setattr__(self, "source", to_mjcf(spec))
                object.__setattr__(self, "assets", assets)
        if own_step:
            object.__setattr__(self, "timestep", float(spec.option.timestep))
        model = _compiled(self)
        names = [model.key(i).name for i in range(model.nkey)]
        if self.start is not None and self.start not in names:
            raise unknown("keyframe", self.start, filter(None, names))

    def __repr__(self) -> str:
        source = str(self.source)
        if len(source) <= _SHOWN:
            shown = source
        elif isinstance(self.source, Path):  # its end names the file
            shown = f"…{source[-_SHOWN:]}"
        else:
            shown = f"{' '.join(source[:_SHOWN].split())}…"
        return f"Mjcf({shown!r}, timestep={self.timestep:g})"

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """This library's own muscles, of which it has none: see `actuators`."""
        return ()

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """All actuators, each in a group of its own."""
        model = self.model
        return tuple(Actuator(model.actuator(i).name, model.actuator(i).name) for i in range(model.nu))

    @property
    def groups(self) -> tuple[str, ...]:
        """The names of the actuators: the components of an action."""
        return tuple(each.name for each in self.actuators)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """Sensors are read whole."""
        return {}

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model, made once. Do not change it: `compile_model` makes another."""
        return _compiled(self)

    def spec(self) -> mujoco.MjSpec:
        """A new, editable description of the model, in which everything that an action or observation may name has a
        name."""
        return in_source(self._place, lambda: self._described()[0])

    def _described(self) -> tuple[mujoco.MjSpec, Documents]:
        spec, documents = read_spec(self._place, self._content)
        spec.option.timestep = self.timestep
        for kind in _UNNAMED:
            for place, each in enumerate(getattr(spec, f"{kind}s"), 1):
                each.name = each.name or f"{kind} {place}"
        if self.muscle_model == "hill":
            to_hill(spec, compile_bare(spec, documents.folders), self.hill, self.tendon, self.curves)
        return spec, documents

    @property
    def _suite(self) -> "Mjcf | None":
        """A model of MyoSuite, as text."""
        named = isinstance(self.source, str) and self.source.startswith(MYOSUITE)
        return _of_myosuite(str(self.source).removeprefix(MYOSUITE)) if named else None

    @property
    def _place(self) -> Path | str:
        """The file, or the document."""
        if (suite := self._suite) is not None:
            return suite.source
        return BUNDLED.get(self.source, self.source) if isinstance(self.source, str) else self.source

    @property
    def _content(self) -> dict[str, bytes] | None:
        assets = self.assets if (suite := self._suite) is None else suite.assets
        return {name: base64.b64decode(content) for name, content in assets} or None


@functools.lru_cache(maxsize=32)
def _of_myosuite(name: str) -> Mjcf:
    with composing():
        warnings.simplefilter("ignore")
        return Mjcf(description(name))


def _checksum(body: Mjcf | None) -> str:
    found = hashlib.sha256()
    for part in () if body is None else (str(body.source), *(each for pair in body.assets for each in pair)):
        found.update(part.encode())
    return found.hexdigest()[:32]


@functools.lru_cache(maxsize=32)
def _compiled(body: Mjcf) -> mujoco.MjModel:
    spec, documents = body._described()
    return compile_spec(spec, documents.folders)


def _assets_of(spec: mujoco.MjSpec, documents: Documents) -> tuple[tuple[str, str], ...]:
    """The files that a description names, with their content."""
    content: dict[str, bytes] = {name: bytes(found) for name, found in dict(spec.assets).items()}
    for name, paths in asset_files(spec, documents.folders).items():
        if name not in content and paths:
            content[name] = read_bytes(paths[0])
    return tuple((name, base64.b64encode(found).decode()) for name, found in sorted(content.items()))
