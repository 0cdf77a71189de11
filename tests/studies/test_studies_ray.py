"""Studies on Ray: a cluster of several nodes on this machine, of which one is killed in the middle."""

import threading

import pytest
from study_examples import assert_same_study, checkpoints, failing_study, small, wait_for

from motorgrad.studies import run_study

ray = pytest.importorskip("ray", reason="needs motorgrad[ray]")
# JAX warns where Ray starts a node, which forks and executes a program at once
pytestmark = [
    pytest.mark.needs("motorgrad[ray]"),
    pytest.mark.slow,
    pytest.mark.ci,
    pytest.mark.filterwarnings("ignore:os.fork"),
]


@pytest.fixture(scope="module")
def cluster():
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def test_a_node_that_is_killed_costs_nothing_but_time(cluster, tmp_path):
    study = small(steps=400_000, window=100_000)
    wanted = study.run(tmp_path / "wanted", progress=False)
    lost = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, log_to_driver=False)
    folder, killed = tmp_path / "study", []

    def kill():
        wait_for(lambda: len(checkpoints(folder)) > 2)
        cluster.remove_node(lost, allow_graceful=False)
        killed.append(lost)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    results = run_study(study, folder, on="ray", checkpoint_every=0.2, progress=False)
    killer.join()
    assert killed
    assert not results.failures
    assert_same_study(folder, wanted.path)


def test_a_job_that_fails_on_ray_is_set_aside_with_its_reason(cluster, tmp_path):
    if not ray.is_initialized():
        ray.init(address=cluster.address, log_to_driver=False)
    results = failing_study(tmp_path / "study", on="ray")
    (failure,) = results.failures
    assert failure["message"].startswith("RunDirectoryError: ")
    assert "holds other files (letter.txt)" in failure["message"]
    assert failure["attempts"] == 2
