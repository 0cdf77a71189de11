"""Every type of block. One line here registers and exports a new one.

A block is a class in one of these files, or in a file of its own. Its line below puts it into `BLOCKS`, and with that
into `timlab`, the editor's palette, diagram files, the documentation and the tests of all blocks.
"""

from typing import Any

from timlab.blocks._control import PID as PID
from timlab.blocks._control import Backlash as Backlash
from timlab.blocks._control import DeadZone as DeadZone
from timlab.blocks._control import DiscretePID as DiscretePID
from timlab.blocks._control import Quantiser as Quantiser
from timlab.blocks._control import RateLimit as RateLimit
from timlab.blocks._control import Relay as Relay
from timlab.blocks._control import Saturation as Saturation
from timlab.blocks._filters import KalmanFilter as KalmanFilter
from timlab.blocks._friction import DryFriction as DryFriction
from timlab.blocks._linear import Delay as Delay
from timlab.blocks._linear import DiscreteIntegrator as DiscreteIntegrator
from timlab.blocks._linear import DiscreteLag as DiscreteLag
from timlab.blocks._linear import DiscreteStateSpace as DiscreteStateSpace
from timlab.blocks._linear import DiscreteTransferFunction as DiscreteTransferFunction
from timlab.blocks._linear import Integrator as Integrator
from timlab.blocks._linear import Lag as Lag
from timlab.blocks._linear import StateSpace as StateSpace
from timlab.blocks._linear import TransferFunction as TransferFunction
from timlab.blocks._linear import UnitDelay as UnitDelay
from timlab.blocks._logic import Compare as Compare
from timlab.blocks._logic import Counter as Counter
from timlab.blocks._logic import Logic as Logic
from timlab.blocks._logic import MultiSwitch as MultiSwitch
from timlab.blocks._logic import Not as Not
from timlab.blocks._logic import SampleAndHold as SampleAndHold
from timlab.blocks._logic import StateMachine as StateMachine
from timlab.blocks._logic import Switch as Switch
from timlab.blocks._maths import Expression as Expression
from timlab.blocks._maths import Function as Function
from timlab.blocks._maths import Gain as Gain
from timlab.blocks._maths import Join as Join
from timlab.blocks._maths import MatrixGain as MatrixGain
from timlab.blocks._maths import Product as Product
from timlab.blocks._maths import Reduce as Reduce
from timlab.blocks._maths import Select as Select
from timlab.blocks._maths import Sum as Sum
from timlab.blocks._policy_map import PolicyMap as PolicyMap
from timlab.blocks._recorder import Recorder as Recorder
from timlab.blocks._scopes import Histogram as Histogram
from timlab.blocks._scopes import Portrait as Portrait
from timlab.blocks._scopes import Raster as Raster
from timlab.blocks._scopes import Scope as Scope
from timlab.blocks._sources import Chirp as Chirp
from timlab.blocks._sources import Constant as Constant
from timlab.blocks._sources import NormalNoise as NormalNoise
from timlab.blocks._sources import Pulse as Pulse
from timlab.blocks._sources import Ramp as Ramp
from timlab.blocks._sources import Sine as Sine
from timlab.blocks._sources import Step as Step
from timlab.blocks._sources import UniformNoise as UniformNoise
from timlab.blocks._tables import DataFile as DataFile
from timlab.blocks._tables import LookUp as LookUp
from timlab.blocks._tables import LookUp2D as LookUp2D
from timlab.blocks.learning import PART_BLOCKS
from timlab.blocks.learning import Gaussians as Gaussians
from timlab.blocks.learning import GradientMean as GradientMean
from timlab.blocks.learning import GradientSample as GradientSample
from timlab.blocks.learning import GrowingGaussians as GrowingGaussians
from timlab.blocks.learning import Hyperplanes as Hyperplanes
from timlab.blocks.learning import Learner as Learner
from timlab.blocks.learning import Motoneurons as Motoneurons
from timlab.blocks.learning import NamedPolicy as NamedPolicy
from timlab.blocks.learning import Network as Network
from timlab.blocks.learning import Softmax as Softmax
from timlab.blocks.learning import WeightDecay as WeightDecay
from timlab.blocks.worlds._fmu import Fmu as Fmu
from timlab.blocks.worlds._hill import HillMuscle as HillMuscle
from timlab.blocks.worlds._mujoco import MujocoModel as MujocoModel
from timlab.blocks.worlds._mujoco import MuscleLaw as MuscleLaw
from timlab.blocks.worlds._python_function import PythonFunction as PythonFunction
from timlab.blocks.worlds._tasks import Body as Body
from timlab.blocks.worlds._tasks import Environment as Environment
from timlab.blocks.worlds._tasks import World as World
from timlab.diagram import BLOCKS, Block
from timlab.diagram import Enable as Enable
from timlab.diagram import From as From
from timlab.diagram import Goto as Goto
from timlab.diagram import Inlet as Inlet
from timlab.diagram import Outlet as Outlet
from timlab.diagram import Trigger as Trigger

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
