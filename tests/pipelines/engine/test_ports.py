"""The ports on which processes of a run listen."""

import urllib.error
import urllib.request

import psutil
import pytest

from pipelines.engine.pool import local_cluster

PAGES = ("status", "info/main/workers.html", "json/counts.json", "health", "metrics")


def listening() -> set[tuple[str, int]]:
    """Addresses and ports of this process and all that it has started."""
    here = psutil.Process()
    processes = [here, *here.children(recursive=True)]
    connections = [connection for process in processes for connection in process.net_connections("inet")]
    listening = [connection.laddr for connection in connections if connection.status == psutil.CONN_LISTEN]
    return {(address.ip, address.port) for address in listening}


def status_of(page: str) -> int:
    try:
        with urllib.request.urlopen(page, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


@pytest.mark.parametrize("dashboard", [False, True])
def test_workers_listen_on_loopback_alone(dashboard: bool) -> None:
    before = listening()
    with local_cluster(2, dashboard=dashboard) as cluster:
        opened = listening() - before
        assert len(opened) >= 5
        assert {address for address, _ in opened} == {"127.0.0.1"}
        workers = cluster.client.scheduler_info(n_workers=-1)["workers"].values()
        places = [f"http://127.0.0.1:{worker['services']['dashboard']}" for worker in workers]
        places.append(cluster.client.dashboard_link.removesuffix("/status"))
        assert len(places) == 3
        found = {page for place in places for page in PAGES if status_of(f"{place}/{page}") == 200}
    assert found == (set(PAGES) if dashboard else set())
