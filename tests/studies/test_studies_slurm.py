"""Studies on Slurm: submitit's executor on this machine, and the batch script that it would submit."""

from pathlib import Path

import pytest
from study_examples import assert_same_study, failing_study, small

from motorgrad.studies import _slurm, run_study
from motorgrad.studies._executors import Work

submitit = pytest.importorskip("submitit", reason="needs motorgrad[slurm]")
pytestmark = pytest.mark.needs("motorgrad[slurm]")


@pytest.mark.slow
@pytest.mark.ci
def test_jobs_of_submitit_make_the_same_numbers(tmp_path):
    wanted = small().run(tmp_path / "wanted", progress=False)
    results = run_study(
        small(), tmp_path / "study", on="slurm", workers=2, progress=False, options={"cluster": "local"}
    )
    assert not results.failures
    assert_same_study(results.path, wanted.path)


@pytest.mark.slow
@pytest.mark.ci
def test_a_job_that_fails_is_set_aside_with_its_reason(tmp_path):
    results = failing_study(tmp_path / "study", on="slurm", options={"cluster": "local"})
    (failure,) = results.failures
    assert "holds other files (letter.txt)" in failure["traceback"]
    assert failure["attempts"] == 2


def test_the_batch_script_says_what_was_asked_for(tmp_path, monkeypatch):
    # there is no Slurm here; nothing of it is needed to write the script
    monkeypatch.setattr(submitit.SlurmExecutor, "affinity", classmethod(lambda cls: 1))
    executor = _slurm.Slurm(
        tmp_path, 0, Work(threads=3), parameters={"partition": "long", "timeout_min": 90, "mem_gb": 4, "account": "me"}
    )
    script = executor.executor._executor._make_submission_file_text("python -m work", "0")
    lines = script.splitlines()
    for line in (
        "#SBATCH --partition=long",
        "#SBATCH --time=90",
        "#SBATCH --mem=4GB",
        "#SBATCH --account=me",
        "#SBATCH --cpus-per-task=3",
        "#SBATCH --job-name=motorgrad",
        "#SBATCH --nodes=1",
        "export NPROC=3",
        "export OMP_NUM_THREADS=3",
        "export PYTHONSAFEPATH=1",
    ):
        assert line in lines, script
    assert any(line.startswith("#SBATCH --signal=USR2@") for line in lines)  # a warning before the time is over
    assert f"srun --unbuffered --output {tmp_path}/slurm/" in script
    assert "python -m work" in lines[-1]


def test_what_slurm_does_not_know_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(submitit.SlurmExecutor, "affinity", classmethod(lambda cls: 1))
    with pytest.raises(ValueError, match="Unknown argument 'partitoin'"):
        _slurm.Slurm(tmp_path, 0, Work(), parameters={"partitoin": "long"})
    with pytest.raises(ValueError, match=r"cluster = 'slrum': must be 'slurm' or 'local'"):
        _slurm.Slurm(tmp_path, 0, Work(), cluster="slrum")


def test_a_job_that_slurm_stops_is_submitted_again(tmp_path):
    again = _slurm.ResumableWork().checkpoint("job", Path("path"), 1)
    assert isinstance(again, submitit.helpers.DelayedSubmission)
    assert again.args == ("job", Path("path"), 1)
    assert isinstance(again.function, _slurm.ResumableWork)
