"""Completion in a shell: what the scripts offer, in the shells that are installed."""

import contextlib
import io
import os
import pty
import shlex
import shutil
import subprocess
import time

import pytest

from motorgrad.cli import COMMANDS, main
from motorgrad.tasks import TASKS


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("completion"), {}
    for shell in ("bash", "zsh", "fish"):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            assert main(["completion", shell]) == 0
        found[shell] = folder / f"motorgrad.{shell}"
        found[shell].write_text(said.getvalue(), encoding="utf-8")
    return found


def offered(script, *lines):
    """What bash offers for the last of the words of each line."""
    ask = f"source {script}"
    for words in lines:
        line = " ".join(map(shlex.quote, words))
        ask += f"; COMP_WORDS=(motorgrad {line}); COMP_CWORD={len(words)}; _motorgrad; echo ${{COMPREPLY[@]}}"
    said = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True).stdout
    return [set(line.split()) for line in said.splitlines()]


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes_commands_names_and_options(scripts):
    exactly = {
        ("",): {*COMMANDS, "--help", "--version"},
        ("tr",): {"train"},
        ("train", "hop"): {"hopper"},
        ("train", "hopper", "--agent.dec"): {"--agent.decay"},
        ("reproduce", "fig-5.5"): {"fig-5.5"},
        ("plot", "--quan"): {"--quantity"},
    }
    among_others = {
        ("train", ""): set(TASKS),
        ("train", "hopper", "--s"): {"--seeds", "--sweep"},
        ("train", "chain", "--agent.policy", ""): {"softmax"},
    }
    found = offered(scripts["bash"], *exactly, *among_others)  # in one shell
    assert dict(zip(exactly, found[: len(exactly)], strict=True)) == exactly
    assert all(some < all_of for some, all_of in zip(among_others.values(), found[len(exactly) :], strict=True))


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish")
def test_fish_completes_commands_names_and_options(scripts, tmp_path):
    lines = ("tr", "train hop", "train hopper --see", "train chain --agent.policy soft", "reproduce fig-5.5")
    ask = f"source {scripts['fish']}; " + "; echo; ".join(f"complete -C 'motorgrad {line}'" for line in lines)
    said = subprocess.run(["fish", "--no-config", "-c", ask], capture_output=True, text=True, check=True, cwd=tmp_path)
    groups = [sorted(line.partition("\t")[0] for line in group.splitlines()) for group in said.stdout.split("\n\n")]
    assert groups == [["train"], ["hopper"], ["--seeds"], ["soft-boxes", "soft-spheres", "softmax"], ["fig-5.5"]]


@pytest.mark.skipif(shutil.which("zsh") is None, reason="needs zsh")
def test_zsh_completes_commands_names_and_options(scripts, tmp_path):
    # a terminal, in which a tab completes and another key writes the line to a file
    found = tmp_path / "found"
    (tmp_path / ".zshrc").write_text(
        f"""autoload -Uz compinit; compinit -u -d {tmp_path / "dump"}; source {scripts["zsh"]}
        tell() {{ print -r -- "$BUFFER" >> {found}; BUFFER= }}; zle -N tell; bindkey '^X' tell; touch {found}\n"""
    )
    terminal, inside = pty.openpty()
    environment = os.environ | {"ZDOTDIR": str(tmp_path), "TERM": "dumb"}
    zsh = ["zsh", "-i", "+m"]
    lines = ("tra", "train hop", "train hopper --see", "train chain --agent.policy softm", "reproduce fig-5.5")
    with subprocess.Popen(
        zsh, stdin=inside, stdout=inside, stderr=inside, env=environment, start_new_session=True
    ) as shell:
        try:
            until(found.exists)
            for number, line in enumerate(lines, 1):
                os.write(terminal, f"motorgrad {line}\t\x18".encode())
                until(lambda number=number: len(found.read_text().splitlines()) == number)
        finally:
            shell.kill()
            os.close(terminal)
            os.close(inside)
    wanted = [
        "train",
        "train hopper",
        "train hopper --seeds",
        "train chain --agent.policy softmax",
        "reproduce fig-5.5",
    ]
    assert [line.rstrip() for line in found.read_text().splitlines()] == [f"motorgrad {line}" for line in wanted]


def until(so, seconds=600):
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not so():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_script_names_every_command_and_the_shell_reads_it(scripts, shell):
    text = scripts[shell].read_text(encoding="utf-8")
    assert all(name in text for name in (*COMMANDS, *TASKS))
    if shutil.which(shell):
        subprocess.run([shell, "-n", scripts[shell]], check=True)


def test_another_shell_is_refused(capsys):
    assert main(["completion", "ksh"]) == 2
    assert "bash" in capsys.readouterr().err
