"""`motorgrad export RUN FILE`: a learned policy as a file that needs no motorgrad."""

import dataclasses
from pathlib import Path

from motorgrad._applications import offered
from motorgrad._errors import check, plain
from motorgrad.options import parse
from motorgrad.schema import Settings, count, static
from motorgrad.training import load


@dataclasses.dataclass(frozen=True)
class Export(Settings):
    """Write the learned policy of a run as C source, as an ONNX model, as arrays for NumPy, or as a Functional Mock-up
    Unit."""

    run: Path = static(positional="RUN", help="The run directory")
    file: Path = static(positional="FILE", help="The file to write: .c, .onnx, .npz or .fmu")
    seed: int | None = count(None, help="The seed whose policy is exported; by default the first")
    only: tuple[str, ...] | None = static(None, help="The functions to write to the file, such as mode; by default all")
    allow_changed: bool = static(False, help="Export even if config.toml was changed since the run was made")


def run(arguments: list[str]) -> int:
    options = parse(Export, arguments, "export")
    trained = load(options.run, allow_changed=options.allow_changed)
    policy = trained.policy(options.seed)
    if options.file.suffix == ".fmu":
        write_fmu = offered("functional mock-up unit", "a Functional Mock-up Unit needs", "lab")
        check(options.only is None, "only", options.only, "left out for an FMU, which gives the most probable action")
        path = write_fmu(policy, options.file)
    else:
        path = policy.export(options.file, options.only)
    print(f"{plain(path)}: {path.stat().st_size:,} bytes")
    return 0
