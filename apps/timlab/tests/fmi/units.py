"""Functional Mock-up Units of our own C, built with the headers that fmpy has."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")

FOLDER = Path(__file__).parent
OTHERS = {"fmi3ActivateModelPartition", "fmi3InstantiateScheduledExecution"}
SAVES = 'canGetAndSetFMUstate="true" canSerializeFMUstate="true"'


def built(folder, version, saves=True, change=("", "")):
    """A unit of a bouncing ball, in a folder: `ball2.c` or `ball3.c`, with another text in place of one in its code."""
    import fmpy
    from fmpy.fmi2 import FMU2Model, FMU2Slave
    from fmpy.fmi3 import FMU3Model, FMU3Slave

    headers = Path(fmpy.__file__).parent / "c-code"
    place = fmpy.platform if version == "2.0" else fmpy.platform_tuple
    name, library = f"ball{version[0]}", folder / "ball.so"
    source, rest = folder / f"{name}.c", folder / "rest.c"
    source.write_text((FOLDER / source.name).read_text().replace(*change))
    # fmpy wants all functions of the standard: those that the ball does not have refuse
    prefix, kinds = ("fmi2", (FMU2Slave, FMU2Model)) if version == "2.0" else ("fmi3", (FMU3Slave, FMU3Model))
    names = {each for kind in kinds for each in dir(kind) if each.startswith(prefix)} | OTHERS
    missing = sorted(each for each in names if f" {each}(" not in source.read_text())
    rest.write_text("\n".join(f"int {each}() {{ return 3; }}" for each in missing if each.startswith(prefix)))
    subprocess.run([COMPILER, "-w", "-shared", "-fPIC", f"-I{headers}", "-o", library, source, rest, "-lm"], check=True)
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", (FOLDER / f"{name}.xml").read_text().replace("SAVES", SAVES * saves))
        archive.write(library, f"binaries/{place}/ball.so")
    return path
