"""Tasks on Ray: on a cluster of several nodes, one of which dies in the middle."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # loopback alone
ray = pytest.importorskip("ray", reason="the extra `ray` is not installed")

from pipeline.cluster.engine import ray_engine  # noqa: E402
from pipeline.cluster.manifest import read_manifests  # noqa: E402
from pipeline.cluster.results_folder import open_shared  # noqa: E402
from pipeline.cluster.shared_run import run_shared  # noqa: E402
from pipeline.core.errors import StadimeterError  # noqa: E402
from tests.run.test_recordings import LEVEL, write_people  # noqa: E402
from tests.run.windows.test_split import write_crossings  # noqa: E402

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head without cores, so that all tasks run on nodes that can die, and two workers."""
    from ray.cluster_utils import Cluster

    made = Cluster(
        initialize_head=True,
        head_node_args={"num_cpus": 0, "include_dashboard": False, "object_store_memory": 10**8},
    )
    for _ in range(2):
        made.add_node(num_cpus=1, object_store_memory=10**8)
    made.wait_for_nodes()
    yield made
    ray.shutdown()
    made.shutdown()


def begin_and_wait(folder: Path, name: str, seconds: float) -> str:
    (folder / f"{name}.{os.getpid()}").touch()
    time.sleep(seconds)
    return ray.get_runtime_context().get_node_id()


def test_the_node_that_dies_costs_its_task(cluster: Any, tmp_path: Path) -> None:
    """Two tasks run on two nodes; one node dies meanwhile, its task is begun again on the other."""
    doomed = cluster.add_node(num_cpus=1, object_store_memory=10**8, resources={"doomed": 1})
    cluster.wait_for_nodes()
    begun = tmp_path / "begun"
    begun.mkdir()
    with ray_engine(cluster.address, 2) as engine:
        for number in range(3):
            engine.submit(number, begin_and_wait, begun, str(number), 4.0)
        deadline = time.monotonic() + 60
        while len(list(begun.iterdir())) < 3 and time.monotonic() < deadline:
            time.sleep(0.1)
        cluster.remove_node(doomed, allow_graceful=False)
        found = dict(engine.results())
    assert set(found) == {0, 1, 2}
    assert all(isinstance(node, str) for node in found.values())
    assert doomed.node_id not in found.values()
    assert len(list(begun.iterdir())) == 4  # three tasks, one of them twice


def test_a_run_survives_a_node_and_is_finished_by_a_second_start(
    cluster: Any, tmp_path: Path
) -> None:
    doomed = cluster.add_node(num_cpus=1, object_store_memory=10**8)
    cluster.wait_for_nodes()
    paths = []
    for number in range(4):
        paths.append(tmp_path / f"{number}.mcap")
        write_people(paths[-1], frames=8 + number)
    write_crossings(tmp_path / "long.mcap", 240)
    paths.append(tmp_path / "long.mcap")

    def kill_when_begun() -> None:
        while not any((tmp_path / "parts").glob("manifests/*.json")):
            time.sleep(0.05)
        cluster.remove_node(doomed, allow_graceful=False)

    killer = threading.Thread(target=kill_when_begun)
    killer.start()
    result = run_shared(
        paths, tmp_path / "parts", LEVEL, engine="ray", address=cluster.address, window_s=80.0
    )
    killer.join()
    assert result.failed == []
    assert len(result.made) == 5
    run_shared(paths[:4] + paths[4:], tmp_path / "alone", LEVEL, window_s=0.0)
    counts = "SELECT file_name, count(*) AS n FROM current_estimates GROUP BY 1 ORDER BY 1"
    with open_shared(tmp_path / "parts") as found, open_shared(tmp_path / "alone") as expected:
        assert found.query(counts).to_pylist() == expected.query(counts).to_pylist()
    # Somebody deletes a result; a second start makes that one, on a cluster of its own.
    lost = next(iter(read_manifests(tmp_path / "parts")))
    (tmp_path / "parts" / "manifests" / f"{lost.key}.json").unlink()
    again = run_shared(
        paths, tmp_path / "parts", LEVEL, engine="ray", address=cluster.address, window_s=80.0
    )
    assert [f.path for f in again.made] == [Path(lost.source.path)]
    assert len(again.there) == 4


def test_no_cluster_at_the_address(tmp_path: Path) -> None:
    ray.shutdown()
    with (
        pytest.raises(StadimeterError, match="no Ray cluster"),
        ray_engine("127.0.0.1:1", 1),
    ):
        pass
