"""`motorgrad lab [FILE]`: TimLab's editor, in a browser."""

import dataclasses
import sys
from pathlib import Path
from typing import ClassVar

from motorgrad._errors import check, choice
from motorgrad.options import parse
from motorgrad.schema import Settings, count, static
from timlab import gallery, load


@dataclasses.dataclass(frozen=True)
class Lab(Settings):
    """Build diagrams of blocks, run them and retune them while they run, in a browser on this machine."""

    file: Path | None = static(
        None,
        positional="[FILE]",
        help="A diagram to edit; a new file is created when saved. Without one, an empty diagram in the current folder",
    )
    gallery: str | None = static(
        None, help="Open a diagram of the gallery, such as chain or hopper, in place of a file"
    )
    trust: bool = static(
        False,
        help="Run code that the diagram's file contains or that is typed into the page: Python functions and "
        "Functional Mock-up Units. Anyone who has the page's address can then run programs",
    )
    port: int = count(0, 0, 2**16 - 1, help="The port on 127.0.0.1; 0 for a free port")
    browser: bool = static(True, help="Open the browser; otherwise only print the address")
    opened: ClassVar[tuple[str, ...]] = ("file",)

    def validate(self) -> None:
        if self.gallery is not None:
            check(self.file is None, "gallery", self.gallery, "given without a file")
            choice("diagram of the gallery", self.gallery, gallery.GALLERY)
        if self.file is not None:
            check(not self.file.is_dir(), "file", str(self.file), "a file, not a folder")
            check(self.file.suffix == ".json", "file", str(self.file), "a name that ends in .json")
            folder = self.file.absolute().parent
            check(folder.is_dir(), "file", str(self.file), "in an existing folder")


def run(arguments: list[str]) -> int:
    options = parse(Lab, arguments, "lab")
    from timlab.editor import NOT_BUILT, Server, Session

    diagram = gallery.example(options.gallery) if options.gallery else None
    if options.trust and options.file is not None and options.file.exists():
        load(options.file, trust=True)  # which vouches for the code that the session finds in it
    session = Session(diagram, options.file.absolute() if options.file else None, trust=options.trust)
    try:
        server = Server(session, options.port)
        if not server.built:
            print(NOT_BUILT, file=sys.stderr)
        print(f"TimLab is at {server.url}\nCtrl-C ends it.", flush=True)
        if options.browser and not server.open():
            print("No browser could be opened: open the address yourself.", file=sys.stderr)
        server.run()
    finally:
        session.close()
    return 0
