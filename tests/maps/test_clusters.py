"""Tiles on a dask cluster: several a task, so that the scheduler costs little of each."""

import threading
import time
from dataclasses import dataclass

import pytest

from phasekit.errors import StoreError
from phasekit.maps import clusters

distributed = pytest.importorskip("distributed", reason="clusters need dask")


@dataclass
class Small:
    index: int


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def counted(monkeypatch, client, name):
    calls = []
    function = getattr(client, name)

    def call(*args, **kwargs):
        calls.append(args)
        return function(*args, **kwargs)

    monkeypatch.setattr(client, name, call)
    return calls


@pytest.mark.parametrize("number", [1, 7, 3000])
def test_the_scheduler_is_not_called_after_each_tile(monkeypatch, client, number):
    monkeypatch.setattr(clusters, "compute", lambda tile: None)
    looks, tasks = (counted(monkeypatch, client, name) for name in ("nthreads", "submit"))
    began = time.monotonic()
    done = list(clusters.on_cluster(map(Small, range(number)), client))
    took = time.monotonic() - began
    assert sorted(tile.index for tile in done) == list(range(number))
    assert 1 <= len(looks) <= 2 + took / clusters.LOOK
    assert len(tasks) <= 24 + number / 100


def test_tiles_that_take_long_go_one_a_task(monkeypatch, client):
    monkeypatch.setattr(clusters, "compute", lambda tile: time.sleep(0.02))
    monkeypatch.setattr(clusters, "TASK", 0.03)
    tasks = counted(monkeypatch, client, "submit")
    assert len(list(clusters.on_cluster(map(Small, range(9)), client))) == 9
    assert len(tasks) == 9


@pytest.mark.slow
def test_a_tile_that_fails_ends_its_task_and_the_call(monkeypatch, client):
    done, lock = [], threading.Lock()

    def compute(tile):
        if tile.index == 57:
            raise StoreError("the tile 57 failed")
        with lock:
            done.append(tile.index)

    monkeypatch.setattr(clusters, "compute", compute)
    with pytest.raises(StoreError, match="the tile 57 failed"):
        list(clusters.on_cluster(map(Small, range(3_000_000)), client))
    assert 57 not in done
    assert len(done) < 1_500_000  # many seconds' worth: a busy machine hears of the failure late
