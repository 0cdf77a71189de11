"""Ray, as a study starts it: for this machine and this process alone."""

import ipaddress
import os
import subprocess
import sys

import pytest
from study_examples import failing_study

pytestmark = [pytest.mark.needs("motorgrad[ray]"), pytest.mark.ci, pytest.mark.filterwarnings("ignore:os.fork")]
STRANGER = """
import sys
from ray._raylet import GcsClient
try:
    GcsClient(address=sys.argv[1]).get_all_node_info()
except Exception as error:
    print(type(error).__name__)
else:
    print("in")
"""


def asks(address, **settings):
    """What another process is told that asks Ray at this address for its nodes."""
    bare = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    told = subprocess.run(
        [sys.executable, "-c", STRANGER, address], env=bare | settings, capture_output=True, text=True
    )
    return told.stdout.strip()


def ray_settings():
    return {name: value for name, value in os.environ.items() if name.startswith("RAY_")}


def test_it_serves_this_machine_and_who_has_its_token(tmp_path, monkeypatch):
    import psutil
    import ray

    from motorgrad.studies._jobs import Work
    from motorgrad.studies._ray import Ray

    monkeypatch.setenv("HOME", str(tmp_path))  # where a token of all of the user's clusters would be
    before = ray_settings()
    place = Ray(tmp_path, 1, Work())
    try:
        me = psutil.Process()
        ports = [port for each in (me, *me.children(recursive=True)) for port in each.net_connections("inet")]
        listens = [ipaddress.ip_address(port.laddr.ip) for port in ports if port.status == psutil.CONN_LISTEN]
        assert len(listens) >= 4
        assert all((getattr(place, "ipv4_mapped", None) or place).is_loopback for place in listens)
        address, token = ray.get_runtime_context().gcs_address, os.environ["RAY_AUTH_TOKEN"]
        assert asks(address, RAY_AUTH_MODE="token", RAY_AUTH_TOKEN=token) == "in"
        assert asks(address, RAY_AUTH_MODE="token", RAY_AUTH_TOKEN="0" * 64) == "AuthenticationError"
        assert asks(address, RAY_AUTH_MODE="disabled") == "AuthenticationError"
        assert ray._private.worker._global_node.webui_url in ("", None)
        from ray._common.usage import usage_lib

        assert not usage_lib.usage_stats_enabled()
    finally:
        place.close()
    assert not ray.is_initialized()
    assert ray_settings() == before
    assert not (tmp_path / ".ray").exists()


def test_a_study_runs_on_it(tmp_path):
    (failure,) = failing_study(tmp_path / "study", on="ray").failures
    assert "holds other files (letter.txt)" in failure["message"]
