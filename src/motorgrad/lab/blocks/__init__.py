"""Every type of block. One line here registers and exports a new one.

A block is a class in one of these files, or in a file of its own. Its line below puts it into `BLOCKS`, and with that
into `motorgrad.lab`, the editor's palette, diagram files, the documentation and the tests of all blocks.
"""

from typing import Any

from motorgrad.lab.blocks._control import PID as PID
from motorgrad.lab.blocks._control import Backlash as Backlash
from motorgrad.lab.blocks._control import DeadZone as DeadZone
from motorgrad.lab.blocks._control import DiscretePID as DiscretePID
from motorgrad.lab.blocks._control import Quantiser as Quantiser
from motorgrad.lab.blocks._control import RateLimit as RateLimit
from motorgrad.lab.blocks._control import Relay as Relay
from motorgrad.lab.blocks._control import Saturation as Saturation
from motorgrad.lab.blocks._friction import DryFriction as DryFriction
from motorgrad.lab.blocks._linear import Delay as Delay
from motorgrad.lab.blocks._linear import DiscreteIntegrator as DiscreteIntegrator
from motorgrad.lab.blocks._linear import DiscreteLag as DiscreteLag
from motorgrad.lab.blocks._linear import DiscreteStateSpace as DiscreteStateSpace
from motorgrad.lab.blocks._linear import DiscreteTransferFunction as DiscreteTransferFunction
from motorgrad.lab.blocks._linear import Integrator as Integrator
from motorgrad.lab.blocks._linear import Lag as Lag
from motorgrad.lab.blocks._linear import StateSpace as StateSpace
from motorgrad.lab.blocks._linear import TransferFunction as TransferFunction
from motorgrad.lab.blocks._linear import UnitDelay as UnitDelay
from motorgrad.lab.blocks._logic import Compare as Compare
from motorgrad.lab.blocks._logic import Counter as Counter
from motorgrad.lab.blocks._logic import Logic as Logic
from motorgrad.lab.blocks._logic import MultiSwitch as MultiSwitch
from motorgrad.lab.blocks._logic import Not as Not
from motorgrad.lab.blocks._logic import SampleAndHold as SampleAndHold
from motorgrad.lab.blocks._logic import StateMachine as StateMachine
from motorgrad.lab.blocks._logic import Switch as Switch
from motorgrad.lab.blocks._maths import Expression as Expression
from motorgrad.lab.blocks._maths import Function as Function
from motorgrad.lab.blocks._maths import Gain as Gain
from motorgrad.lab.blocks._maths import Join as Join
from motorgrad.lab.blocks._maths import MatrixGain as MatrixGain
from motorgrad.lab.blocks._maths import Product as Product
from motorgrad.lab.blocks._maths import Reduce as Reduce
from motorgrad.lab.blocks._maths import Select as Select
from motorgrad.lab.blocks._maths import Sum as Sum
from motorgrad.lab.blocks._policy_map import PolicyMap as PolicyMap
from motorgrad.lab.blocks._recorder import Recorder as Recorder
from motorgrad.lab.blocks._scopes import Histogram as Histogram
from motorgrad.lab.blocks._scopes import Portrait as Portrait
from motorgrad.lab.blocks._scopes import Raster as Raster
from motorgrad.lab.blocks._scopes import Scope as Scope
from motorgrad.lab.blocks._sources import Chirp as Chirp
from motorgrad.lab.blocks._sources import Constant as Constant
from motorgrad.lab.blocks._sources import NormalNoise as NormalNoise
from motorgrad.lab.blocks._sources import Pulse as Pulse
from motorgrad.lab.blocks._sources import Ramp as Ramp
from motorgrad.lab.blocks._sources import Sine as Sine
from motorgrad.lab.blocks._sources import Step as Step
from motorgrad.lab.blocks._sources import UniformNoise as UniformNoise
from motorgrad.lab.blocks._tables import DataFile as DataFile
from motorgrad.lab.blocks._tables import LookUp as LookUp
from motorgrad.lab.blocks._tables import LookUp2D as LookUp2D
from motorgrad.lab.blocks.learning import PART_BLOCKS
from motorgrad.lab.blocks.learning import Gaussians as Gaussians
from motorgrad.lab.blocks.learning import GradientMean as GradientMean
from motorgrad.lab.blocks.learning import GradientSample as GradientSample
from motorgrad.lab.blocks.learning import GrowingGaussians as GrowingGaussians
from motorgrad.lab.blocks.learning import Hyperplanes as Hyperplanes
from motorgrad.lab.blocks.learning import Learner as Learner
from motorgrad.lab.blocks.learning import Motoneurons as Motoneurons
from motorgrad.lab.blocks.learning import NamedPolicy as NamedPolicy
from motorgrad.lab.blocks.learning import Network as Network
from motorgrad.lab.blocks.learning import Softmax as Softmax
from motorgrad.lab.blocks.learning import WeightDecay as WeightDecay
from motorgrad.lab.blocks.worlds._fmu import Fmu as Fmu
from motorgrad.lab.blocks.worlds._hill import HillMuscle as HillMuscle
from motorgrad.lab.blocks.worlds._mujoco import MujocoModel as MujocoModel
from motorgrad.lab.blocks.worlds._mujoco import MuscleLaw as MuscleLaw
from motorgrad.lab.blocks.worlds._python_function import PythonFunction as PythonFunction
from motorgrad.lab.blocks.worlds._tasks import Body as Body
from motorgrad.lab.blocks.worlds._tasks import Environment as Environment
from motorgrad.lab.blocks.worlds._tasks import World as World
from motorgrad.lab.diagram import BLOCKS, Block
from motorgrad.lab.diagram import Enable as Enable
from motorgrad.lab.diagram import From as From
from motorgrad.lab.diagram import Goto as Goto
from motorgrad.lab.diagram import Inlet as Inlet
from motorgrad.lab.diagram import Outlet as Outlet
from motorgrad.lab.diagram import Trigger as Trigger

BLOCKS.update(
    (kind.name, kind)
    for kind in list(vars().values())
    if isinstance(kind, type) and issubclass(kind, Block) and kind is not Block
)
# Set through globals(), so that static tools, which cannot evaluate it, take the imports above as the list.
globals()["__all__"] = sorted(kind.__name__ for kind in BLOCKS.values())
BLOCKS.maps.append(PART_BLOCKS)  # type: ignore[arg-type]  # derived from the registered parts of learners


def __getattr__(title: str) -> Any:
    """The block of a registered part of a learner by the name of its class, such as `EligibilityTrace`."""
    return PART_BLOCKS.by_title(title)
