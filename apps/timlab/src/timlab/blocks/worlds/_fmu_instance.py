"""One running Functional Mock-up Unit, by co-simulation or by model exchange."""

import abc
import ctypes
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from motorgrad._errors import check
from motorgrad._extras import missing
from motorgrad._reading import error_message

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ModelVariable  # pyright: ignore[reportMissingImports]

Result = TypeVar("Result")
MAX_EVENTS_PER_TICK = 1000
BISECTIONS = 50
MIN_STEP_SHARE = 1e-12  # what is shorter is not integrated


def fmpy_module() -> Any:
    """The package fmpy. **Raises** `ValueError` with the command that installs it."""
    try:
        import fmpy  # pyright: ignore[reportMissingImports]
        import fmpy.simulation  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ValueError(missing("Functional Mock-up Units need", "fmpy", "fmi")) from None
    return fmpy


class Instance(abc.ABC):
    """An instance of a unit, initialised at time 0.

    **Arguments:** the unit's description; the folder where it was extracted; start values, each with its
    variable; the integration steps per tick.

    **Raises:** `ValueError` where the unit has no program for this machine; `RuntimeError` that names unit, call,
    simulated time and status where it refuses a call.
    """

    kind: str

    def __init__(self, unit: "ModelDescription", folder: str, start: Sequence[tuple[Any, Any]], substeps: int):
        self.unit, self.substeps, self.next_event = unit, substeps, math.inf
        self._time = 0.0
        self.old = unit.fmiVersion == "2.0"
        try:
            make = fmpy_module().simulation.instantiate_fmu
            self.fmu = make(folder, unit, self.kind, require_functions=False)  # few units have all of them
        except Exception as error:  # fmpy raises nothing more special
            raise ValueError(
                f"the unit {unit.modelName} does not run on this machine: {error_message(error)}"
            ) from None
        self._call(self._initialise, start)

    def _initialise(self, start: Sequence[tuple[Any, Any]]) -> None:
        if self.old:
            self.fmu.setupExperiment(startTime=0.0)
        self._write(start)
        if self.old:
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def step(self, given: Sequence[tuple[Any, Any]], time: float, length: float) -> None:
        """Take inputs, each with its variable, and advance by `length` seconds from `time`."""
        self._time = time
        self._call(self._step, given, time, length)
        self._time = time + length

    @abc.abstractmethod
    def _step(self, given: Sequence[tuple[Any, Any]], time: float, length: float) -> None: ...

    def read(self, variables: Sequence[Any]) -> list[np.ndarray]:
        """The values of variables."""
        return self._call(lambda: [self._value(variable) for variable in variables])

    def saved(self) -> bytes:
        """The state."""

        def save() -> bytes:
            state = self.fmu.getFMUState()
            try:
                return self.fmu.serializeFMUState(state)
            finally:
                self.fmu.freeFMUState(state)

        return self._call(save)

    def restore(self, saved: bytes, next_event: float) -> None:
        """Return to a state."""

        def load() -> None:
            state = self.fmu.deserializeFMUState(saved)
            try:
                self.fmu.setFMUState(state)
            finally:
                self.fmu.freeFMUState(state)

        self._call(load)
        self.next_event = next_event

    def close(self) -> None:
        """Free the instance."""
        self.fmu.freeInstance()

    def _call(self, function: Callable[..., Result], *arguments: object) -> Result:
        """Call the unit; an error says which unit refuses which call, when, and with which status."""
        try:
            return function(*arguments)
        except Exception as error:  # fmpy's own, which names call and status; of ctypes for what the unit lacks
            raise RuntimeError(
                f"the unit {self.unit.modelName} at {self._time:.6g} s: {error_message(error)}"
            ) from None

    def _check_goes_on(self, over: bool) -> None:
        if over:
            raise RuntimeError("it asks to end the simulation")

    def _value(self, variable: "ModelVariable") -> np.ndarray:
        size = int(np.prod(variable.shape or ()))
        shape = tuple(variable.shape or ())
        get = getattr(self.fmu, f"get{_kind(variable)}")
        values = get([variable.valueReference]) if self.old else get([variable.valueReference], size)
        return np.asarray(list(values)).reshape(shape)

    def _write(self, given: Sequence[tuple[Any, Any]]) -> None:
        for variable, value in given:
            whole = np.broadcast_to(np.ravel(value), math.prod(variable.shape or ()))  # one value for every element
            getattr(self.fmu, f"set{_kind(variable)}")([variable.valueReference], whole.tolist())


def _kind(variable: "ModelVariable") -> str:
    """The kind of a variable in the names of functions."""
    return "Integer" if variable.type == "Enumeration" else variable.type


class CoSimulation(Instance):
    """A unit that makes its steps itself."""

    kind = "CoSimulation"

    def _step(self, given: Sequence[tuple[Any, Any]], time: float, length: float) -> None:
        self._write(given)
        done = self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=length)
        if done is not None:  # version 3 tells more than a status
            _, over, early, reached = done
            self._check_goes_on(over)
            if early:
                raise RuntimeError(f"fmi3DoStep returned early, at {reached:.6g} s of {time + length:.6g} s")


class ModelExchange(Instance):
    """A unit that gives derivatives, and is integrated here: by RK4 between events."""

    kind = "ModelExchange"

    def _initialise(self, start: Sequence[tuple[Any, Any]]) -> None:
        super()._initialise(start)
        self._size = int(self.unit.numberOfContinuousStates)
        self._indicators = int(self.unit.numberOfEventIndicators)
        self._finish_event()

    def _step(self, given: Sequence[tuple[Any, Any]], time: float, length: float) -> None:
        self.fmu.enterEventMode()  # inputs may jump
        self._write(given)
        self._finish_event()
        end = time + length
        now = time
        step = length / self.substeps
        events = 0
        while end - now > MIN_STEP_SHARE * length:
            h = min(step, end - now)
            due = self.next_event - now <= h
            h = max(0.0, self.next_event - now) if due else h
            self._time = now
            state = self._state()
            before = self._signs()
            crossed = h > 0 and self._crosses(now, h, state, before)
            if crossed:
                h = self._until_crossing(now, h, state, before)
            now = end if end - (now + h) <= MIN_STEP_SHARE * length else now + h
            wanted, over = self.fmu.completedIntegratorStep()
            self._check_goes_on(over)
            if crossed or due or wanted:
                events += 1
                check(events <= MAX_EVENTS_PER_TICK, "events", events, f"at most {MAX_EVENTS_PER_TICK} within a tick")
                self.fmu.enterEventMode()
                self._finish_event()

    def _until_crossing(self, now: float, h: float, state: np.ndarray, before: np.ndarray) -> float:
        """The shortest step after which an event indicator has changed its sign; the unit is left there."""
        low = 0.0
        high = h
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            if not low < middle < high:
                break
            low, high = (low, middle) if self._crosses(now, middle, state, before) else (middle, high)
        self._crosses(now, high, state, before)
        return high

    def _crosses(self, now: float, h: float, state: np.ndarray, before: np.ndarray) -> bool:
        """Make one step of RK4. Returns whether an event indicator has changed its sign."""
        total = np.zeros(self._size)
        slope = np.zeros(self._size)
        for place, weight in ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)):
            slope = self._slope(now + place * h, state + place * h * slope)
            total += weight * slope
        self._place(now + h, state + h * total)
        return bool(np.any(self._signs() != before))

    def _slope(self, time: float, state: np.ndarray) -> np.ndarray:
        self._place(time, state)
        return self._array(self.fmu.getDerivatives if self.old else self.fmu.getContinuousStateDerivatives, self._size)

    def _place(self, time: float, state: np.ndarray) -> None:
        self.fmu.setTime(time)
        if self._size:
            self.fmu.setContinuousStates((ctypes.c_double * self._size)(*state), self._size)

    def _state(self) -> np.ndarray:
        return self._array(self.fmu.getContinuousStates, self._size)

    def _signs(self) -> np.ndarray:
        return self._array(self.fmu.getEventIndicators, self._indicators) > 0

    def _array(self, get: Callable[..., object], size: int) -> np.ndarray:
        values = (ctypes.c_double * size)()
        if size:
            get(values, size)
        return np.array(values)

    def _finish_event(self) -> None:
        """Update discrete states until they no longer change, and continue in continuous time."""
        defined = False
        following = math.inf
        for _ in range(MAX_EVENTS_PER_TICK):
            update = self.fmu.newDiscreteStates if self.old else self.fmu.updateDiscreteStates
            again, over, _, _, defined, following = update()
            self._check_goes_on(over)
            if not again:
                break
        else:
            raise RuntimeError(f"its discrete states still change after {MAX_EVENTS_PER_TICK} updates")
        self.next_event = following if defined else math.inf
        self.fmu.enterContinuousTimeMode()
