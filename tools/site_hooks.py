"""What the documentation site needs beside its pages: pages of the API and of TimLab's blocks, pages from the root, and
formulas as MathML."""

# pyright: reportMissingImports=false
# (mkdocs and latex2mathml are of the extra `docs`)
import ast
import inspect
import re
import sys
from html import unescape
from importlib import import_module
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))  # MkDocs runs this file by itself

from tools.block_pages import GALLERY_PAGE, block_pages, navigation  # noqa: E402

MODULES = [
    "motorgrad.policies",
    "motorgrad.policies.abilities",
    "motorgrad.learning",
    "motorgrad.worlds",
    "motorgrad.worlds.oracle",
    "motorgrad.bodies",
    "motorgrad.tasks",
    "motorgrad.tasks.terms",
    "motorgrad.plane",
    "motorgrad.training",
    "motorgrad.presets",
    "motorgrad.environments",
    "motorgrad.search",
    "motorgrad.statistics",
    "motorgrad.studies",
    "motorgrad.export",
    "timsim",
    "timlab",
    "motorgrad_thesis",
]
"""The modules with a page of the API."""
OPTIONS = {"motorgrad.presets": {"show_signature": "false"}, "motorgrad.studies": {"inherited_members": "true"}}
"""How the page of a module differs from the others: a preset has the signature of a table where it stands, and studies
and comparisons have most of their members from a private class."""
START: dict[str, list[tuple[str, str]]] = {
    "Train and look": [
        ("training.train", "train a learner on a task, for many seeds"),
        ("training.Run", "the outcome: metrics, policies, curves, plots"),
        ("training.evaluate", "act without learning"),
        ("training.load", "a run from its directory"),
        ("training.agent_for", "the learner of a task, with some settings changed"),
        ("training.EarlyStopping", "end training at a goal, or when progress stops"),
    ],
    "Tasks": [
        ("tasks.make", "a task by its name"),
        ("tasks.from_gymnasium", "a Gymnasium environment, by id, class or function"),
        ("tasks.compose", "a task of terms, on any body"),
        ("tasks.Task", "what to implement for a task of your own"),
        ("bodies.Mjcf", "any MuJoCo model as a body"),
    ],
    "Learners": [
        ("presets.natural", "a learner for any task, in proportion to a budget"),
        ("presets.natural_network", "the same with a neural network"),
        ("presets.ppo", "proximal policy optimisation"),
        ("learning.Learner", "what to implement for a learner of your own"),
        ("learning.Agent", "the policy gradient: a policy, an estimator and an optimizer"),
        ("learning.Estimator", "trace, baseline and batch"),
        ("policies.Policy", "what a policy implements"),
        ("policies.Network", "any equinox module under output units"),
    ],
    "Many runs": [
        ("studies.Study", "tasks × settings × seeds, on one machine or many"),
        ("studies.compare", "methods, tuned and judged"),
    ],
    "Films and diagrams": [
        ("timsim.write_film", "a film of a motion"),
        ("timsim.view", "a live view in the browser"),
        ("timlab.Diagram", "a block diagram"),
        ("timlab.Run", "a diagram that runs, with all seeds"),
    ],
}
"""What most people need of the API, by topic. Names of the library are without its own."""
FROM_ROOT = {f"{name}.md": f"{name.lower()}.md" for name in ("README", "CONTRIBUTING", "SECURITY", "CHANGELOG")}
WORKER = "assets/iframe-worker.js"
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]+)\)")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the blocks' pages where the navigation says "Blocks"."""
    for section in config.nav or []:
        for name, entries in section.items():
            if name == "TimLab":
                entries += [{"Gallery": GALLERY_PAGE}, {"Blocks": navigation()}]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add pages of the API, of TimLab's blocks and from the root of the repository, and the script for search from the
    disk."""
    for path, text in block_pages().items():
        files.append(File.generated(config, path, content=text))
    files.append(
        File.generated(config, WORKER, content=(ROOT / "tools" / "iframe-worker.js").read_text(encoding="utf-8"))
    )
    for module in MODULES:
        text = f"# `{module}`\n\n::: {module}\n{_options(module)}"
        files.append(File.generated(config, f"api/{page_of(module)}.md", content=text))
    files.append(File.generated(config, "api/index.md", content=_start_of_api()))
    for name, path in FROM_ROOT.items():
        text = LINK.sub(_in_site, (ROOT / name).read_text(encoding="utf-8"))
        files.append(File.generated(config, path, content=text))
    return files


def page_of(module: str) -> str:
    """The name of a module's page of the API."""
    return module.removeprefix("motorgrad.").replace(".", "-")


def _whole(name: str) -> str:
    """A name of `START` with that of its package."""
    return name if name.partition(".")[0] in MODULES else f"motorgrad.{name}"


def _options(name: str) -> str:
    """The order of a module's page: first what most people need, then file by file as the module imports them, so that
    what belongs together stands together; constants and exceptions last."""
    module = import_module(name)
    if not hasattr(module, "__all__"):
        return ""
    imports = [node for node in ast.walk(ast.parse(inspect.getsource(module))) if isinstance(node, ast.ImportFrom)]
    order = dict.fromkeys(alias.asname or alias.name for node in imports for alias in node.names)
    start = [_whole(entry).removeprefix(f"{name}.") for entries in START.values() for entry, _ in entries]
    names = [name for name in (*start, *order, *module.__all__) if name in module.__all__]

    def stands_last(name: str) -> bool:
        thing = getattr(module, name)
        return name.isupper() or (isinstance(thing, type) and issubclass(thing, BaseException))

    options = {"members": sorted(dict.fromkeys(names), key=stands_last), **OPTIONS.get(name, {})}
    return "    options:\n" + "".join(f"      {option}: {value}\n" for option, value in options.items())


def _start_of_api() -> str:
    """The page on which the API starts: what most people need, by topic."""
    lines = [
        "# API: start here",
        "",
        "What most people need, by topic. Each module has a page with everything else.",
        "",
    ]
    for topic, entries in START.items():
        lines += [f"## {topic}", "", "| | |", "|---|---|"]
        for name, what in entries:
            whole = _whole(name)
            lines.append(f"| [`{name}`]({page_of(whole.rpartition('.')[0])}.md#{whole}) | {what} |")
        lines.append("")
    return "\n".join(lines)


def _in_site(link: re.Match[str]) -> str:
    """A link of a page at the root, as it is in the site; to what is not there, its words alone."""
    words, target = link.groups()
    if "://" in target or target.startswith("#"):
        return link[0]
    file, mark, place = target.partition("#")
    path = f"{FROM_ROOT[file]}{mark}{place}" if file in FROM_ROOT else None
    path = path or (target.removeprefix("docs/") if target.startswith("docs/") else None)
    return f"[{words}]({path})" if path else words


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links to the root's pages lead to their places in the site."""
    up = "../" * page.file.src_uri.count("/")
    for name, path in FROM_ROOT.items():
        markdown = re.sub(rf"\]\({re.escape(f'{up}../{name}')}(?=[)#])", f"]({up}{path}", markdown)
    return markdown


def on_page_content(html: str, **_: Any) -> str:
    """Formulas as MathML, which browsers draw by themselves."""
    return FORMULA.sub(lambda found: formula(found[2], found[1] == "div"), html)


def formula(latex: str, display: bool) -> str:
    """LaTeX as MathML."""
    return convert(unescape(latex), display="block" if display else "inline")
