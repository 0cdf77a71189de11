"""`motorgrad completion SHELL`: completion of commands, names and options in a shell."""

import contextlib
import dataclasses
import io
import re
import shlex
from typing import Literal, NamedTuple

from motorgrad._applications import LISTS, entries
from motorgrad._extras import MissingExtra
from motorgrad.commands import COMMANDS, command_named
from motorgrad.learning import Learner
from motorgrad.options import HELP_ALL, parse
from motorgrad.policies import INITIAL
from motorgrad.schema import Settings, static
from motorgrad.tasks import TASKS

Shell = Literal["bash", "zsh", "fish"]
OPTION = re.compile(r"^ +((?:--?[\w.-]+,? ?)+)", re.MULTILINE)
ABOUT_TASK = ("train", "sim")
POLICY = "--agent.policy"
"""The option whose values are completed, too."""


@dataclasses.dataclass(frozen=True)
class Completion(Settings):
    """Print a script that completes commands, tasks, experiments and options in a shell.

    bash: add `eval "$(motorgrad completion bash)"` to ~/.bashrc. zsh: the same, with zsh, in ~/.zshrc after compinit.
    fish: motorgrad completion fish > ~/.config/fish/completions/motorgrad.fish
    """

    shell: Shell = static(positional="SHELL", help="The shell: bash, zsh or fish")


class Words(NamedTuple):
    """What may follow a command: names, such as tasks, and options."""

    names: tuple[str, ...]
    options: tuple[str, ...]


def run(arguments: list[str]) -> int:
    options = parse(Completion, arguments, "completion")
    words = {name: Words(_names(name), _options(name)) for name in COMMANDS}
    print({"bash": _bash, "zsh": _zsh, "fish": _fish}[options.shell](COMMANDS, words), end="")
    return 0


def _names(command: str) -> tuple[str, ...]:
    if command in ABOUT_TASK:
        return tuple(sorted(TASKS))
    if command == "reproduce":
        return ("all", *(offer.load()() if (offer := entries(LISTS).get("experiments")) else ()))
    return ("bash", "zsh", "fish") if command == "completion" else ()


def _options(command: str) -> tuple[str, ...]:
    """The options in a command's own help; of a learner only the short names, as the others depend on the task."""
    said = io.StringIO()
    subject = ["hopper", HELP_ALL] if command in ABOUT_TASK else ["--help"]
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit, MissingExtra):
        command_named(command)(subject)
    found = {word for line in OPTION.findall(said.getvalue()) for word in re.findall(r"--[\w.-]+", line)}
    own = {word for word in found if not word.startswith(("--task.", "--agent."))}
    if command in ABOUT_TASK:
        short_names = {short for kind in Learner.kinds().values() for short in getattr(kind, "aliases", {})}
        own |= {f"--agent.{short.replace('_', '-')}" for short in short_names} | {POLICY, HELP_ALL}
    return tuple(sorted(own))


def _bash(commands: dict[str, str], words: dict[str, Words]) -> str:
    cases = "\n".join(f"        {name}) words={_quoted(*of)} ;;" for name, of in words.items())
    return f"""\
# completion of motorgrad in bash: eval "$(motorgrad completion bash)"
_motorgrad() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" words=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        words={_quoted(commands, ("--help", "--version"))}
    elif [ "${{COMP_WORDS[COMP_CWORD-1]}}" = "{POLICY}" ]; then
        words={_quoted(INITIAL)}
    else
        case "${{COMP_WORDS[1]}}" in
{cases}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _motorgrad motorgrad
"""


def _zsh(commands: dict[str, str], words: dict[str, Words]) -> str:
    described = "\n".join(f"            {shlex.quote(f'{name}:{what}')}" for name, what in commands.items())
    cases = "\n".join(
        f"            {name}) compadd -- {' '.join((*of.names, *of.options))} ;;" for name, of in words.items()
    )
    return f"""\
#compdef motorgrad
# completion of motorgrad in zsh: eval "$(motorgrad completion zsh)", after compinit
_motorgrad() {{
    if (( CURRENT == 2 )); then
        local -a found
        found=(
{described}
        )
        _describe command found
    elif [[ ${{words[CURRENT-1]}} == {POLICY} ]]; then
        compadd -- {" ".join(INITIAL)}
    else
        case ${{words[2]}} in
{cases}
        esac
        _files
    fi
}}
compdef _motorgrad motorgrad
"""


def _fish(commands: dict[str, str], words: dict[str, Words]) -> str:
    lines = ["# completion of motorgrad in fish: save it as ~/.config/fish/completions/motorgrad.fish"]
    start = "complete -c motorgrad -n"
    lines += [f"{start} __fish_use_subcommand -f -a {name} -d {shlex.quote(what)}" for name, what in commands.items()]
    for name, of in words.items():
        after = f"{start} '__fish_seen_subcommand_from {name}'"
        closed = "" if name in ABOUT_TASK else " -f"  # a task may be a file, too
        lines += [f"{after}{closed} -a {_quoted(of.names)}"] if of.names else []
        lines += [f"{after} -l {option.removeprefix('--')}" for option in of.options if option != POLICY]
        lines += [f"{after} -l {POLICY.removeprefix('--')} -x -a {_quoted(INITIAL)}"] if POLICY in of.options else []
    return "\n".join([*lines, ""])


def _quoted(*groups: object) -> str:
    """Words as one quoted word of a shell."""
    return shlex.quote(" ".join(str(word) for group in groups for word in group))  # type: ignore[attr-defined]
