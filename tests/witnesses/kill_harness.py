"""Sweeps that are killed: started in processes of their own, watched, and looked at afterwards.

The model here is that of the disk, with two additions: it records each tile that it begins in a
file, and it takes its time. So it is known what was in flight, and what a later call computes.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import phasekit as pk
from phasekit import cli
from phasekit.systems import disk
from phasekit.systems.system import MODELS

LOG, DELAY, FAIL = "PHASEKIT_TEST_LOG", "PHASEKIT_TEST_DELAY", "PHASEKIT_TEST_FAIL"
TESTS = Path(__file__).parents[1]

Tile = tuple[int, ...]


class Odd(Exception):
    """An exception that other processes cannot rebuild."""

    def __init__(self, what: str, why: str) -> None:
        super().__init__(f"{what} because of {why}")


class GyroRotorDisk(disk.GyroRotorDisk):
    """The disk, which records where each tile begins, and waits, or fails."""

    @classmethod
    def valid_coefficients(cls, parameters: Mapping[str, Any]) -> Any:
        corner = [float(np.ravel(parameters[name])[0]) for name in ("beta", "a")]
        if LOG in os.environ:
            file = os.open(os.environ[LOG], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            os.write(file, f"{json.dumps([os.getpid(), *corner])}\n".encode())  # in one piece
            os.close(file)
        time.sleep(float(os.environ.get(DELAY, "0")))
        beta, how = os.environ.get(FAIL, "inf raise").split()
        if corner[0] >= float(beta):
            if how == "exit":
                os._exit(9)
            raise Odd("no result", "a test")
        return super().valid_coefficients(parameters)


FIXED: dict[str, float] = {"beta": 0.3, "e": 0.0115, "a": 0.02, "r": 0.21, "omega1": 2.5, "m": 1.5}


@dataclass(frozen=True)
class Map:
    """A map of the disk over beta and a, cut into tiles."""

    sizes: tuple[int, int] = (8, 6)
    chunks: tuple[int, int] = (2, 3)

    @property
    def axes(self) -> dict[str, Any]:
        """The axes by name."""
        beta, a = self.sizes
        return {"beta": np.linspace(0.01, 1.5, beta), "a": np.linspace(0.001, 0.05, a)}

    @property
    def tiles(self) -> set[Tile]:
        """All tiles by their place in the grid of tiles."""
        counts = (-(-n // chunk) for n, chunk in zip(self.sizes, self.chunks, strict=True))
        return set(np.ndindex(*counts))

    def sweep(self, store: Path, **options: Any) -> Any:
        """Make the call, or make it again."""
        chunks = dict(zip(self.axes, self.chunks, strict=True))
        return pk.sweep(GyroRotorDisk(**FIXED), self.axes, store=store, chunks=chunks, **options)

    def started(self, log: Path) -> list[tuple[int, Tile]]:
        """Return the process and tile of each line of a record, in their order."""
        found = []
        for line in log.read_text().splitlines() if log.exists() else ():
            pid, *corner = json.loads(line)
            places = (
                np.flatnonzero(axis == value)[0] // chunk
                for value, axis, chunk in zip(corner, self.axes.values(), self.chunks, strict=True)
            )
            found.append((pid, tuple(int(place) for place in places)))
        return found

    def done(self, store: Path) -> set[Tile]:
        """Return the tiles that a store says are done; none where it cannot be opened yet."""
        try:
            with pk.open_map(store) as ds:
                if "computed" not in ds:
                    return self.tiles
                cells = ds.computed.transpose(*self.axes).values
        except pk.StoreError:
            return set()
        tiles = self.tiles
        parts = {
            tile: cells[
                tuple(slice(i * n, (i + 1) * n) for i, n in zip(tile, self.chunks, strict=True))
            ]
            for tile in tiles
        }
        assert all(part.all() == part.any() for part in parts.values())
        return {tile for tile, part in parts.items() if part.all()}


def content(store: Path) -> dict[str, bytes]:
    """Return all files of a store, hidden ones as well."""
    files = (file for file in sorted(store.rglob("*")) if not file.is_dir())
    return {str(file.relative_to(store)): file.read_bytes() for file in files}


def stamps(store: Path, tiles: set[Tile]) -> dict[str, tuple[int, int]]:
    """Return inode and time of the files that hold the data of some tiles."""
    found = {}
    for file in store.rglob("*"):
        name = str(file.relative_to(store))
        chunk = re.search(r"/c((?:[./]\d+)+)$", name)
        if chunk and tuple(map(int, re.split("[./]", chunk[1])[1:3])) in tiles:
            found[name] = (file.stat().st_ino, file.stat().st_mtime_ns)
    return found


# ------------------------------------------------------------------------------ processes


def main() -> None:
    """Make a sweep as the argument says; run in a process that is to be killed."""
    given = json.loads(sys.argv[1])
    shape = Map(tuple(given["sizes"]), tuple(given["chunks"]))
    shape.sweep(Path(given["store"]), **given["options"])


def command() -> None:
    """Run the command line, with the model that takes its time."""
    MODELS["GyroRotorDisk"] = GyroRotorDisk
    sys.exit(cli.main())


def clustered() -> None:
    """Make a sweep, as the argument says, on a cluster of processes of its own."""
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        given = json.loads(sys.argv[1])
        Map().sweep(Path(given["store"]), client=client)


def in_a_thread() -> None:
    """Make a sweep, as the argument says, in a thread that an interrupt does not reach."""
    thread = threading.Thread(target=main, daemon=True)
    thread.start()
    thread.join()


class Group:
    """Processes in a process group of their own."""

    def __init__(self, log: Path, delay: float) -> None:
        path = os.pathsep.join([str(TESTS), str(TESTS.parent)])
        self.environment = {**os.environ, LOG: str(log), DELAY: str(delay), "PYTHONPATH": path}
        self.environment["DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT"] = "30s"
        self.members: list[subprocess.Popen[bytes]] = []
        self.errors = log.with_suffix(".err")  # of the process that was started last

    def start(self, *arguments: str) -> subprocess.Popen[bytes]:
        """Start Python with these arguments; the first process leads the group."""
        self.errors.unlink(missing_ok=True)  # others go on writing to theirs
        with self.errors.open("wb") as errors:
            process = subprocess.Popen(
                [sys.executable, *arguments],
                env=self.environment,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                process_group=self.members[0].pid if self.members else 0,
            )
        self.members.append(process)
        return process

    def sweep(
        self, shape: Map, store: Path, call: str = "main", **options: Any
    ) -> subprocess.Popen[bytes]:
        """Start a sweep."""
        given = {"store": str(store), "options": options}
        given.update(sizes=shape.sizes, chunks=shape.chunks)
        return self.start(
            "-c", f"from witnesses import kill_harness; kill_harness.{call}()", json.dumps(given)
        )

    def command(self, shape: Map, store: Path, **options: Any) -> subprocess.Popen[bytes]:
        """Start a sweep from the command line."""
        chunks = dict(zip(shape.axes, shape.chunks, strict=True))
        axes = {name: axis.tolist() for name, axis in shape.axes.items()}
        fixed = {name: value for name, value in FIXED.items() if name not in axes}
        lines = [f"store = {json.dumps(str(store))}"]
        lines += [f"{name} = {value}" for name, value in options.items()]
        for table, values in {"chunks": chunks, "parameters": fixed, "axes": axes}.items():
            lines += [f"[{table}]", *(f"{name} = {value}" for name, value in values.items())]
        recipe = store.with_suffix(".toml")
        recipe.write_text("\n".join(lines))
        return self.start(
            "-c", "from witnesses import kill_harness; kill_harness.command()", "sweep", str(recipe)
        )

    def cluster(self, workers: int = 2) -> tuple[str, list[subprocess.Popen[bytes]]]:
        """Start a scheduler and workers; return its address, and them with the scheduler first."""
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        address = f"tcp://127.0.0.1:{port}"
        quiet = ["--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
        started = [
            self.start(
                "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port),
                *quiet,
            )
        ]  # fmt: skip
        for _ in range(workers):
            started.append(
                self.start(
                    "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
                    *quiet,
                )
            )  # fmt: skip
        return address, started

    def kill(self) -> None:
        """Kill all of them at once, and wait until none is left."""
        for leader in self.members[:1]:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(leader.pid, signal.SIGKILL)
        for process in self.members:
            process.wait()
        wait_for(lambda: not self.alive(), "the group to end")

    def alive(self) -> list[int]:
        """Return the processes of the group that are left, zombies not counted."""
        if not self.members:
            return []
        group = self.members[0].pid
        return [pid for pid, _, of_group in processes() if of_group == group]


def processes() -> Iterator[tuple[int, int, int]]:
    """Return process, parent and group of what runs here."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if fields[0] != "Z":
                yield int(folder.name), int(fields[1]), int(fields[2])


def wait_for(condition: Callable[[], Any], what: str, seconds: float = 60.0) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"waited {seconds} s for {what}"
        time.sleep(0.01)


@contextlib.contextmanager
def processes_of(log: Path, delay: float) -> Iterator[Group]:
    """Give a group, of which nothing is left afterwards."""
    group = Group(log, delay)
    try:
        yield group
    finally:
        group.kill()


@contextlib.contextmanager
def local_cluster(workers: int) -> Iterator[Any]:
    """Give a client of a cluster in threads of this process."""
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=False,
            dashboard_address="127.0.0.1:0",
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client
