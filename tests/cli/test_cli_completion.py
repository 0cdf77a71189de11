"""Completion in a shell: what the scripts offer, in the shells that are installed."""

import contextlib
import io
import shlex
import shutil
import subprocess

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


def offered(script, *words):
    """What bash offers for the last of the words."""
    line = " ".join(map(shlex.quote, words))
    ask = f"source {script}; COMP_WORDS=(motorgrad {line}); COMP_CWORD={len(words)}; _motorgrad; echo ${{COMPREPLY[@]}}"
    return set(subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True).stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes_commands_names_and_options(scripts):
    script = scripts["bash"]
    assert offered(script, "") == {*COMMANDS, "--help", "--version"}
    assert offered(script, "tr") == {"train"}
    assert offered(script, "train", "hop") == {"hopper"}
    assert set(TASKS) < offered(script, "train", "")
    assert {"--seeds", "--sweep"} <= offered(script, "train", "hopper", "--s")
    assert offered(script, "train", "hopper", "--agent.dec") == {"--agent.decay"}
    assert offered(script, "reproduce", "fig-5.5") == {"fig-5.5"}
    assert "softmax" in offered(script, "train", "chain", "--agent.policy", "")
    assert offered(script, "plot", "--quan") == {"--quantity"}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_script_names_every_command_and_the_shell_reads_it(scripts, shell):
    text = scripts[shell].read_text(encoding="utf-8")
    assert all(name in text for name in (*COMMANDS, *TASKS))
    if shutil.which(shell):
        subprocess.run([shell, "-n", scripts[shell]], check=True)


def test_another_shell_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["completion", "ksh"])
    assert ended.value.code == 2
    assert "bash" in capsys.readouterr().err
