"""The C around a diagram's tick that makes it a Functional Mock-up Unit, written from the standard's prose."""

import string
from collections.abc import Mapping, Sequence
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
FOLDER = Path(__file__).parent


def wrapper(version: str, guid: str, parts: Mapping[str, str]) -> str:
    """The C of the functions of the standard, for `"2.0"` or `"3.0"`. `parts` are those that `common.c` leaves open."""
    prefix, refused = ("fmi2", REFUSED2) if version == "2.0" else ("fmi3", REFUSED3)
    common, own = ((FOLDER / f"{name}.c").read_text(encoding="utf-8") for name in ("common", prefix))
    given = {"guid": guid, "refused": _refusals(prefix, refused)}
    return string.Template(common).substitute(parts) + "\n" + string.Template(own).substitute(given)


def _refusals(prefix: str, names: Sequence[str]) -> str:
    return "\n".join(f"EXPORT int {prefix}{name}() {{ return 3; }}" for name in names)
