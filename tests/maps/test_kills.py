"""Sweeps that are killed go on where they were, and end with the store of one that was not.

Each kill is a SIGKILL with at least one tile done and at least one in flight. A hundred of them,
at random moments, half of them with tiles large enough for kills to land in writing, are
``PHASEKIT_KILLS=100 pytest -s tests/maps/test_kills.py -k at_random``.
"""

import itertools
import os
import random
import signal
import time
from collections import Counter
from pathlib import Path

import pytest
from witnesses.kill_harness import LOG, Group, Map, content, processes_of, stamps, wait_for

import phasekit as pk

pytest.importorskip("zarr")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc"),
]

SMALL, DELAY = Map(), 0.25
LARGE = Map((360, 330), (100, 90))
WORKERS = 2


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The files of sweeps that were not interrupted, in one process, by the model itself."""
    found = {}
    for shape in (SMALL, LARGE) if "PHASEKIT_KILLS" in os.environ else (SMALL,):
        path = tmp_path_factory.mktemp("expected") / "map.zarr"
        log = path.with_suffix(".log")
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(LOG, str(log))
            shape.sweep(path, workers=1)
        assert {tile for _, tile in shape.started(log)} == shape.tiles
        assert len(shape.started(log)) == len(shape.tiles)
        found[shape] = content(path)
    return found


class Sweep:
    """A sweep that runs elsewhere, and what it has done."""

    def __init__(self, folder: Path, shape: Map, group: Group) -> None:
        self.folder, self.shape, self.group = folder, shape, group
        self.store, self.log = folder / "map.zarr", folder / "log"

    def start(self, engine: str, workers: int) -> None:
        self.cluster = []
        options = {"workers": workers}
        if engine == "distributed":
            address, self.cluster = self.group.cluster(workers)
            options = {"client": address}
        self.process = self.group.sweep(self.shape, self.store, **options)

    @property
    def done(self):
        return self.shape.done(self.store)

    @property
    def started(self):
        """What workers began; the sweep's own process only takes samples, for an estimate."""
        own = self.process.pid
        return [(pid, tile) for pid, tile in self.shape.started(self.log) if pid != own]

    def in_flight(self):
        done = self.done  # read first: what is done later counts as in flight
        return [(pid, tile) for pid, tile in self.started if tile not in done]

    def wait_until_under_way(self):
        def under_way():
            assert self.process.poll() is None, self.group.errors.read_text()
            return self.done and self.in_flight()

        wait_for(under_way, "a tile that is done and one in flight")

    def finish(self):
        self.process.wait(60)
        assert self.process.returncode == 0, self.group.errors.read_text()


def assert_goes_on(sweep: Sweep, expected: dict[str, bytes], **options: int) -> None:
    """After all are dead, the same call computes what is not done, and nothing else."""
    assert not sweep.group.alive()
    done, before = sweep.done, sweep.started
    in_flight = {tile for _, tile in before} - done
    assert len(in_flight) <= WORKERS
    assert {tile for _, tile in before} == done | in_flight
    kept = stamps(sweep.store, done)
    assert kept
    with pk.open_map(sweep.store) as ds:
        assert (ds.n_equilibria >= 0).where(ds.computed, True).all()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(LOG, str(sweep.log))
        sweep.shape.sweep(sweep.store, **options)
    after, left = sweep.started[len(before) :], sweep.shape.tiles - done
    here = min(options["workers"], len(left)) == 1  # or else only samples are computed here
    assert sorted(tile for pid, tile in after if here or pid != os.getpid()) == sorted(left)
    assert stamps(sweep.store, done) == kept
    assert content(sweep.store) == expected


def assert_went_on(sweep: Sweep, expected: dict[str, bytes]) -> int:
    """The sweep itself went on after a loss, and computed again what was in flight alone."""
    sweep.finish()
    times = Counter(tile for _, tile in sweep.started)
    assert set(times) == sweep.shape.tiles
    again = sum(times.values()) - len(times)
    assert again <= WORKERS
    assert content(sweep.store) == expected
    return again


def kill_group(sweep: Sweep) -> None:
    sweep.group.kill()


def kill_parent(sweep: Sweep) -> None:
    """Its workers end by themselves."""
    sweep.process.kill()
    wait_for(lambda: not sweep.group.alive(), "the workers to end", 10)


def kill_worker(sweep: Sweep) -> None:
    for pid, _ in sweep.in_flight()[-1:]:
        os.kill(pid, signal.SIGKILL)


def kill_scheduler(sweep: Sweep) -> None:
    """The sweep ends with an error that says so; the workers may finish what they have begun."""
    sweep.cluster[0].kill()
    sweep.process.wait(60)
    error = sweep.group.errors.read_text()
    assert sweep.process.returncode != 0
    assert "StoreError" in error
    assert "scheduler" in error
    assert "the same call resumes the map" in error
    sweep.group.kill()


KILLS = [
    ("processes", kill_group),
    ("processes", kill_parent),
    ("processes", kill_worker),
    ("distributed", kill_scheduler),
    ("distributed", kill_worker),
    # What was begun with a cluster goes on as what was begun with processes.
    *([("distributed", kill_group)] if "PHASEKIT_KILLS" in os.environ else []),
]


def kill_once(folder, shape, expected, engine, kill, delay, later=0.0, **options) -> int | None:
    """Kill a sweep under way and finish it; None where no tile was in flight."""
    with processes_of(folder / "log", delay) as group:
        sweep = Sweep(folder, shape, group)
        # Of a cluster whose scheduler is lost one worker is enough.
        sweep.start(engine, 1 if kill is kill_scheduler else WORKERS)
        sweep.wait_until_under_way()
        time.sleep(later)
        in_flight = len(sweep.in_flight())
        if not in_flight:
            return None
        kill(sweep)
        if kill is kill_worker:
            return assert_went_on(sweep, expected) or None
        if kill is not kill_scheduler:
            in_flight = len(sweep.in_flight())  # when all is dead
        if not in_flight:
            return None
        assert sweep.done
        assert_goes_on(sweep, expected, **options)
        return in_flight


@pytest.mark.parametrize(("engine", "kill"), KILLS)
def test_what_is_killed_goes_on(engine, kill, tmp_path, expected):
    if engine == "distributed":
        pytest.importorskip("distributed")
    # The same call; where the engine is a cluster, which is dead, without it.
    workers = WORKERS if kill is kill_group else 1
    for attempt in range(3):  # a kill between two tiles shows nothing
        folder = tmp_path / str(attempt)
        folder.mkdir()
        options = {"delay": DELAY, "workers": workers}
        if kill_once(folder, SMALL, expected[SMALL], engine, kill, **options) is not None:
            return
    pytest.fail("no kill came while a tile was in flight")


@pytest.mark.skipif("PHASEKIT_KILLS" not in os.environ, reason="PHASEKIT_KILLS says how many")
def test_kills_at_random(tmp_path, expected):
    random.seed(int(os.environ.get("PHASEKIT_SEED", "0")))
    landed: Counter[str] = Counter()
    again = 0
    kinds = itertools.cycle(KILLS)
    for number in itertools.count():
        if landed.total() == int(os.environ["PHASEKIT_KILLS"]):
            break
        engine, kill = next(kinds)
        shape, delay, most = random.choice([(SMALL, 0.25, 0.3), (LARGE, 0.0, 0.4)])
        folder = tmp_path / str(number)
        folder.mkdir()
        result = kill_once(
            folder, shape, expected[shape], engine, kill, delay, random.uniform(0.0, most),
            workers=random.choice([1, WORKERS]),
        )  # fmt: skip
        if result is not None:
            landed[f"{engine}, {kill.__name__}, {'small' if shape is SMALL else 'large'}"] += 1
            again += result
            print(landed.total(), engine, kill.__name__, result, flush=True)
    print(dict(landed), f"{again} tiles in flight", f"{number - landed.total()} between tiles")
