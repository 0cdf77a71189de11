"""The build hook: whatever is installed or distributed has the pages of TimLab's editor.

`pip install .` and `python -m build` build the pages where those of the checkout are missing or older than their
sources: with the machine's Node.js, or with one that is fetched for the build. A source distribution holds the pages.
Where they cannot be built, a build fails and says why; an installation by pip, most of which needs no pages, warns,
and `motorgrad lab` says what to do. An editable installation uses the checkout's own pages, which `make editor` builds.
"""

import importlib.util
import os
import shutil
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# by its path: `tools` itself may be another package where this is built
_SPEC = importlib.util.spec_from_file_location("build_editor", Path(__file__).with_name("build_editor.py"))
assert _SPEC is not None
assert _SPEC.loader is not None
build_editor: Any = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(build_editor)

BY_PIP = "PIP_BUILD_TRACKER"  # pip sets it for the builds that it starts


class EditorPages(BuildHookInterface):
    """Builds the pages where they are missing."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """What the build needs beside hatchling: a Node, where pages are to be built and the machine has none."""
        fits = build_editor.fits(shutil.which("node")) and shutil.which("npm")
        return [] if fits or not build_editor.outdated() else [build_editor.PACKAGED]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable" or not build_editor.outdated():
            return
        try:
            status = build_editor.main(install=False)
            why = f"npm ended with status {status}" if status else ""
        except (ImportError, OSError) as error:
            why = str(error)
        if not why:
            return
        node = ".".join(map(str, build_editor.MIN_NODE_VERSION))
        message = (
            f"The pages of TimLab's editor could not be built: {why}. Node.js {node} or later builds them, and npm "
            "fetches packages for it: see the output above, or run "
            "`python apps/timlab/tools/build_editor.py` in the checkout."
        )
        if BY_PIP not in os.environ:
            raise RuntimeError(message)
        self.app.display_warning(f"{message} Everything but `motorgrad lab` works without them.")
