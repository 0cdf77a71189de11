"""Collect the licences of what viser's client is made of, which recorded scenes have (`timsim.panels`):
`python -m tools.viser_licences`, once another version of viser is in constraints.txt.

To see what is in it, the client of the installed viser is built once more, in a temporary folder.
"""

import importlib.metadata
import shutil
import sys
import tempfile
from pathlib import Path

import viser

from apps.timlab.tools.build_editor import SOURCES, npm

LICENCES = Path(__file__).parents[1] / "apps" / "timsim" / "src" / "timsim" / "panels" / "viser-licences.txt"
MIN_NODE_VERSION = (22, 15)  # the first Node with zstd, by which the client is compressed
CONFIG = """
import { writeFileSync } from "node:fs";
import own from "./vite.config.mts";
import { licencesOf } from "./licences.mts";

const modules = new Set();
const collect = () => ({
  name: "licences",
  generateBundle(_, bundle) {
    for (const part of Object.values(bundle)) Object.keys(part.modules ?? {}).forEach((id) => modules.add(id));
    writeFileSync("licences.txt", licencesOf(modules));
  },
});
export default (environment) => {
  const { plugins, worker, ...rest } = own(environment);
  const inner = { ...worker, plugins: () => [collect(), ...worker.plugins()] };
  return { ...rest, plugins: [collect(), ...plugins], worker: inner };
};
"""


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        client = Path(folder) / "client"
        package = Path(viser.__file__).parent
        shutil.copytree(package / "client", client)
        shutil.copytree(package / "_assets", Path(folder) / "_assets")
        shutil.copy(SOURCES / "licences.ts", client / "licences.mts")
        (client / "with-licences.mts").write_text(CONFIG)
        get = ["ci", "--ignore-scripts", "--no-audit", "--no-fund"]
        build = ["exec", "--", "vite", "build", "--config", "with-licences.mts"]
        if code := npm(client, get, build, least=MIN_NODE_VERSION):
            return code
        found = (client / "licences.txt").read_text(encoding="utf-8")
    own = importlib.metadata.distribution("viser")
    text = next(file.read_text() for file in own.files or () if file.name == "LICENSE").strip()
    parts = f"viser {own.version}: as below", text, "-" * 80, found
    LICENCES.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
