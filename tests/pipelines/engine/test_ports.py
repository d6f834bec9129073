"""What processes of this machine listen on."""

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
    connections = [one for process in processes for one in process.net_connections("inet")]
    return {(one.laddr.ip, one.laddr.port) for one in connections if one.status == psutil.CONN_LISTEN}


def status_of(page: str) -> int:
    try:
        with urllib.request.urlopen(page, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code
    except OSError:
        return 0  # speaks no HTTP


@pytest.mark.parametrize("dashboard", [False, True])
def test_workers_listen_on_loopback_alone(dashboard: bool) -> None:
    before = listening()
    with local_cluster(2, dashboard=dashboard):
        opened = listening() - before
        assert len(opened) >= 5
        assert {address for address, _ in opened} == {"127.0.0.1"}
        found = {page for _, port in opened for page in PAGES if status_of(f"http://127.0.0.1:{port}/{page}") == 200}
    assert found == (set(PAGES) if dashboard else set())
