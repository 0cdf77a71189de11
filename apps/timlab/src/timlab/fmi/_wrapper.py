"""The C around a diagram's tick that makes it a Functional Mock-up Unit, written from the standard's prose."""

import string
from collections.abc import Mapping
from pathlib import Path

REFUSED2 = (
    *("GetDirectionalDerivative", "SetRealInputDerivatives", "GetRealOutputDerivatives", "GetStatus", "GetRealStatus"),
    *("GetIntegerStatus", "GetBooleanStatus", "GetStringStatus"),
)
_OTHER = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "String", "Binary", "Clock")
REFUSED3 = (
    *(f"{way}{kind}" for way in ("Get", "Set") for kind in _OTHER),
    *("EnterEventMode", "GetNumberOfVariableDependencies", "GetVariableDependencies", "GetDirectionalDerivative"),
    *("GetAdjointDerivative", "EnterConfigurationMode", "ExitConfigurationMode", "GetIntervalDecimal"),
    *("GetIntervalFraction", "GetShiftDecimal", "GetShiftFraction", "SetIntervalDecimal", "SetIntervalFraction"),
    *("SetShiftDecimal", "SetShiftFraction", "EvaluateDiscreteStates", "UpdateDiscreteStates"),
    *("EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime", "SetContinuousStates"),
    *("GetContinuousStateDerivatives", "GetEventIndicators", "GetContinuousStates", "GetNominalsOfContinuousStates"),
    *("GetNumberOfEventIndicators", "GetNumberOfContinuousStates", "GetOutputDerivatives", "ActivateModelPartition"),
)
EXCHANGED3 = (
    *("EnterEventMode", "UpdateDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime"),
    *("SetContinuousStates", "GetContinuousStateDerivatives", "GetEventIndicators", "GetContinuousStates"),
    *("GetNominalsOfContinuousStates", "GetNumberOfEventIndicators", "GetNumberOfContinuousStates"),
)
"""What a unit for model exchange does offer."""
FOLDER = Path(__file__).parent


def wrapper(version: str, guid: str, kind: str, parts: Mapping[str, str]) -> str:
    """The C of the functions of the standard, for `"2.0"` or `"3.0"`, of a `kind` of unit: `"ticks"`, for
    co-simulation, or `"slopes"`, for model exchange. `parts` are those that the files of common C leave open.
    """
    prefix, refused = ("fmi2", REFUSED2) if version == "2.0" else ("fmi3", REFUSED3)
    if kind == "slopes" and version == "3.0":
        refused = (*(name for name in refused if name not in EXCHANGED3), "DoStep", "EnterStepMode")
    names = ("common", kind, f"{kind}{prefix[-1]}", prefix)
    common, inner, interface, own = ((FOLDER / f"{name}.c").read_text(encoding="utf-8") for name in names)
    type = "1" if kind == "ticks" else "0"
    refusals = "\n".join(f"EXPORT int {prefix}{name}() {{ return 3; }}" for name in refused)
    given = {"guid": guid, "refused": refusals, "interface": interface, "type": type}
    return "\n".join((string.Template(common + "\n" + inner).substitute(parts), string.Template(own).substitute(given)))
