"""Maps on disk: memory, rate, what the rate is spent on, processes, codecs and chunks.

Run with ``pytest tests/benchmarks/bench_store.py``; the tables are printed. Stores go to the folder
``PHASEKIT_SCRATCH``, by default the system's for temporary files. ``PHASEKIT_LARGE=1`` makes the
map of 10^8 cells as well. Times of one tile are CPU times, those of whole sweeps wall times.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil
import pytest
import zarr
from zarr.codecs import BloscCodec, ZstdCodec
from zarr.storage import LocalStore, MemoryStore

import phasekit as pk
from phasekit.maps.stored_arrays import codec, codecs
from phasekit.maps.tile import PIECE, compute_cells
from phasekit.numerics.launch import one_thread
from phasekit.table.quantities import TABLE

DISK = {"beta": 0.3, "e": 0.00115, "a": 0.002, "r": 0.2, "omega1": 2.5, "m": 1.5, "half_span": 0.1}
CODES = ["n_equilibria", "topology", "figure_eight"]
SUBJECTS = {
    "codes": CODES,
    "codes and angles": [*CODES, "phi"],
    "equilibria, separatrices": ["equilibria", "separatrices"],
}

SWEEP = """
import json, sys, time
import numpy as np
import phasekit as pk
disk, sizes, options = json.loads(sys.argv[1])
spans = dict(beta=(0.01, 1.5), a=(-0.1, 0.1), omega1=(1.0, 8.0))
axes = {name: np.linspace(*spans[name], n) for name, n in sizes.items()}
start = time.perf_counter()
pk.sweep(pk.GyroRotorDisk(**disk), axes, **options)
print(time.perf_counter() - start)
"""


@pytest.fixture
def scratch() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir=os.environ.get("PHASEKIT_SCRATCH")) as folder:
        yield Path(folder)


def table(capsys: pytest.CaptureFixture[str], title: str, rows: dict[str, str]) -> None:
    with capsys.disabled():
        load = os.getloadavg()[0]
        print(f"\n{title} (load {load:.1f})")
        for name, text in rows.items():
            print(f"  {name:44s} {text}")


class Run(NamedTuple):
    """What a sweep took: seconds, CPU seconds and greatest memory of all processes, bytes."""

    seconds: float
    cpu: float
    memory: int
    size: int


def run(sizes: dict[str, int], **options: Any) -> Run:
    """Make a sweep in a process of its own."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    given = json.dumps([DISK, sizes, {**options, "store": str(options["store"])}])
    child = subprocess.Popen(
        [sys.executable, "-c", SWEEP, given], stdout=subprocess.PIPE, text=True
    )
    most = 0
    while child.poll() is None:
        most = max(most, resident(psutil.Process(child.pid)))
        time.sleep(0.05)
    assert child.stdout is not None
    out = child.stdout.read()
    child.stdout.close()
    assert child.returncode == 0
    size = bytes_of(Path(options["store"]))
    shutil.rmtree(options["store"])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return Run(float(out), cpu, most, size)


def bytes_of(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def resident(process: psutil.Process) -> int:
    """Resident bytes of a process and its descendants; what they share counts in each."""
    total = 0
    try:
        family = [process, *process.children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0
    for one in family:
        try:
            total += one.memory_info().rss
        except psutil.NoSuchProcess:
            pass
    return total


@pytest.mark.parametrize("subject", ["codes and angles", "equilibria, separatrices"])
def test_memory_does_not_grow(
    subject: str, scratch: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sizes = {"beta": 2000, "a": 1600 if subject.startswith("codes") else 800}
    # Tiles of the size that large maps have by default; a small map has smaller ones.
    chunks = {"beta": 1000, "a": 800 if subject.startswith("codes") else 400, "omega1": 1}
    call = {"of": SUBJECTS[subject], "workers": 2, "store": scratch / "map.zarr", "chunks": chunks}
    rows, peaks = {}, []
    for name, factor in {"once": 1, "ten times": 10}.items():
        made = run({**sizes, "omega1": factor}, **call)
        cells = prod(sizes.values()) * factor
        peaks.append(made.memory)
        rows[f"{name}: {cells:.2g} cells"] = (
            f"{made.memory / 1e6:6.0f} MB at most, {made.seconds:6.1f} s, "
            f"store of {made.size / 1e6:6.0f} MB"
        )
    table(capsys, f"Memory of all processes, {subject}", rows)
    assert peaks[1] <= 1.1 * peaks[0]


@pytest.mark.parametrize("subject", SUBJECTS)
def test_two_processes_against_one(
    subject: str, scratch: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On larger maps, where starting processes counts for little; alternately, best of two.

    Two sweeps at once, of as many cells each as the one has, show what the machine has to give:
    on one that is idle they take as long as one.
    """
    few = subject.startswith("codes")
    sizes = {"beta": 2000, "a": 2000, "omega1": 12 if few else 3}
    cells = prod(sizes.values())

    def call(name: str, workers: int) -> Run:
        return run(sizes, of=SUBJECTS[subject], workers=workers, store=scratch / f"{name}.zarr")

    ones, twos, at_once = [], [], []
    for _ in range(2):
        ones.append(call("one", 1))
        twos.append(call("two", 2))
        with ThreadPoolExecutor(2) as pool:
            at_once.append(max(made.seconds for made in pool.map(call, "ab", (1, 1))))
    one, two = (min(made.seconds for made in runs) for runs in (ones, twos))
    cpu = [min(made.cpu for made in runs) / cells * 1e9 for runs in (ones, twos)]
    table(
        capsys,
        f"Processes, {subject}",
        {
            "one": f"{cells / one / 1e6:5.2f} million cells/s, {cpu[0]:4.0f} ns of CPU a cell",
            "two": f"{cells / two / 1e6:5.2f} million cells/s, {cpu[1]:4.0f} ns of CPU a cell, "
            f"{one / two:.2f} times one",
            "two sweeps at once": f"{2 * cells / min(at_once) / 1e6:5.2f} million cells/s, "
            f"{2 * one / min(at_once):.2f} times one",
        },
    )


# ------------------------------------------------------------------------------ one tile


def best(call: Callable[[], Any], repeats: int = 5) -> float:
    """Least CPU seconds of a few runs, all threads and the operating system's work included."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


class OneTile:
    """A tile of 1024 x 1024 cells, computed in one thread."""

    shape = (1024, 1024)

    def __init__(self, subject: str, dtype: str | None = None) -> None:
        disk = pk.GyroRotorDisk(**DISK)
        rows = tuple(
            row for row in TABLE.select(SUBJECTS[subject]) if disk.standing.is_within(row.of)
        )
        if dtype is not None:
            from dataclasses import replace

            rows = tuple(
                replace(row, dtype=dtype) if row.dtype == "float64" else row for row in rows
            )
        self.rows, self.passes = rows, TABLE.plan(rows)
        self.model = type(disk)
        self.inputs = {name: np.full((1, 1), value) for name, value in disk.parameters.items()}
        self.inputs["beta"] = np.linspace(0.01, 1.5, self.shape[0])[:, None]
        self.inputs["a"] = np.linspace(-0.1, 0.1, self.shape[1])[None, :]

    def compute(self) -> dict[str, Any]:
        with one_thread():
            return compute_cells(self.model, self.passes, self.rows, self.inputs, self.shape)

    def coefficients(self) -> tuple[np.ndarray, ...]:
        full = np.broadcast_arrays(*self.model.valid_coefficients(self.inputs))
        return tuple(np.ascontiguousarray(x) for x in full)

    def formula(self) -> None:
        step = PIECE // self.shape[1]
        for i in range(0, self.shape[0], step):
            piece = {name: x[i : i + step] if len(x) > 1 else x for name, x in self.inputs.items()}
            self.model.valid_coefficients(piece)

    def kernel(self, A: np.ndarray, B: np.ndarray, C: np.ndarray) -> None:
        step = PIECE // self.shape[1]
        with one_thread(), np.errstate(all="ignore"):
            for i in range(0, self.shape[0], step):
                for one in self.passes:
                    TABLE.call(one, *(x[i : i + step] for x in (A, B, C)))

    def write(self, store: Any, compressors: Any, shape: tuple[int, int] | None = None) -> None:
        results = self.compute()
        group = zarr.create_group(store, overwrite=True)
        arrays = {}
        for row in self.rows:
            arrays[row.name] = group.create_array(
                row.name,
                shape=self.shape + row.label_shape,
                chunks=(shape or self.shape) + row.label_shape,
                dtype=row.dtype,
                compressors=compressors,
                config={"write_empty_chunks": True},
            )
        self.arrays, self.results = arrays, results

    def written(self) -> None:
        for name, array in self.arrays.items():
            array[...] = self.results[name]


@pytest.mark.parametrize("subject", SUBJECTS)
def test_where_the_time_of_a_tile_goes(
    subject: str, scratch: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tile = OneTile(subject)
    cells = prod(tile.shape)
    abc = tile.coefficients()
    kernel = best(lambda: tile.kernel(*abc))
    formula = best(tile.formula)
    compute = best(tile.compute)
    tile.write(MemoryStore(), None)
    plain = best(tile.written)
    tile.write(MemoryStore(), [codec()])
    encode = best(tile.written)
    tile.write(LocalStore(scratch / "map.zarr"), [codec()])
    disk = best(tile.written)
    size = bytes_of(scratch)
    whole = compute + disk
    stages = {
        "the pure kernel": kernel,
        "coefficients from parameters": formula,
        "results into the tile's buffer": max(compute - kernel - formula, 0.0),
        "zarr, without compression": plain,
        "compression": encode - plain,
        "files": disk - encode,
    }
    rows = {
        name: f"{seconds / cells * 1e9:7.0f} ns a cell, {seconds / whole:4.0%}"
        for name, seconds in stages.items()
    }
    rows["all"] = (
        f"{whole / cells * 1e9:7.0f} ns a cell; {kernel / whole:.0%} of the pure kernel's rate; "
        f"{size / cells:.1f} of {sum(row.cell_bytes for row in tile.rows)} bytes a cell"
    )
    table(capsys, f"One tile of 2^20 cells, one process, {subject}", rows)


@pytest.mark.parametrize("side", [1024, 256])
@pytest.mark.parametrize("subject", SUBJECTS)
def test_checksums(
    subject: str, side: int, scratch: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Writing and reading a tile without and with them, alternately, and looking at them alone."""
    from phasekit.maps.marks import sound

    tile = OneTile(subject)
    cells = prod(tile.shape)
    compute = best(tile.compute)
    took: dict[str, list[float]] = {}
    for _ in range(3):
        for name, compressors in {"without": [codec()], "with": codecs()}.items():
            tile.write(LocalStore(scratch / f"{name}.zarr"), compressors, (side, side))
            write = best(tile.written, 3)
            read = best(lambda: [array[...] for array in tile.arrays.values()], 3)
            took.setdefault(f"{name}: write", []).append(write)
            took.setdefault(f"{name}: read", []).append(read)
    least = {name: min(times) for name, times in took.items()}
    files = (file for file in (scratch / "with.zarr").rglob("*") if file.is_file())
    data = [file.read_bytes() for file in files if file.name != "zarr.json"]
    assert data
    assert all(map(sound, data))
    alone = best(lambda: [sound(one) for one in data], 3)
    rows = {name: f"{t / cells * 1e9:6.1f} ns a cell" for name, t in least.items()}
    more = least["with: write"] - least["without: write"]
    rows["checksums alone"] = (
        f"{alone / cells * 1e9:6.1f} ns a cell, {sum(map(len, data)) / alone / 1e9:.1f} GB/s"
    )
    rows["cost"] = f"{more / (compute + least['without: write']):6.1%} of computing and writing"
    table(capsys, f"Checksums, {side} x {side} cells a chunk, {subject}", rows)


CODECS: dict[str, Any] = {
    "none": None,
    "lz4 1, shuffle": [BloscCodec(cname="lz4", clevel=1, shuffle="shuffle")],
    "lz4 5, shuffle": [BloscCodec(cname="lz4", clevel=5, shuffle="shuffle")],
    "lz4 9, shuffle": [BloscCodec(cname="lz4", clevel=9, shuffle="shuffle")],
    "lz4 1, bitshuffle": [BloscCodec(cname="lz4", clevel=1, shuffle="bitshuffle")],
    "lz4 5, bitshuffle": [BloscCodec(cname="lz4", clevel=5, shuffle="bitshuffle")],
    "zstd 1, shuffle": [BloscCodec(cname="zstd", clevel=1, shuffle="shuffle")],
    "zstd 5, shuffle": [BloscCodec(cname="zstd", clevel=5, shuffle="shuffle")],
    "zstd 0 (zarr's default)": [ZstdCodec(level=0)],
}


@pytest.mark.parametrize(
    ("subject", "dtype"),
    [("codes", None), ("equilibria, separatrices", None), ("equilibria, separatrices", "float32")],
)
def test_codecs(
    subject: str, dtype: str | None, scratch: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tile = OneTile(subject, dtype)
    cells = prod(tile.shape)
    cell_bytes = sum(row.cell_bytes for row in tile.rows)
    rows = {}
    for name, compressors in CODECS.items():
        tile.write(LocalStore(scratch / "map.zarr"), compressors)
        write = best(tile.written, 3)
        size = bytes_of(scratch)
        read = best(lambda: [array[...] for array in tile.arrays.values()], 3)
        shutil.rmtree(scratch / "map.zarr")
        rows[name] = (
            f"write {cells / write / 1e6:6.1f}, read {cells / read / 1e6:6.1f} million cells/s, "
            f"{size / cells:6.2f} bytes a cell, {size / cells / cell_bytes:4.0%}"
        )
    table(capsys, f"Codecs, {subject}, {dtype or 'float64'}, 2^20 cells a chunk, CPU time", rows)


@pytest.mark.parametrize("subject", ["codes", "equilibria, separatrices"])
def test_chunks(subject: str, scratch: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same map in tiles of several sizes."""
    few = subject == "codes"
    sizes = {"beta": 2048, "a": 2048, "omega1": 2 if few else 1}
    rows = {}
    for power in (7, 8, 9, 10, 11):
        chunks = {"beta": 1 << power, "a": 1 << power, "omega1": 1}
        store = scratch / "map.zarr"
        call = {"of": SUBJECTS[subject], "workers": 1, "store": store, "chunks": chunks}
        made = run(sizes, **call)
        cells = prod(sizes.values())
        rows[f"2^{2 * power} cells a chunk"] = (
            f"{made.cpu / cells * 1e9:5.0f} ns of CPU a cell, {made.memory / 1e6:5.0f} MB of "
            f"memory, {made.size / cells:6.2f} bytes a cell"
        )
    table(capsys, f"Sizes of chunks, one process, {subject}", rows)


@pytest.mark.skipif("PHASEKIT_LARGE" not in os.environ, reason="PHASEKIT_LARGE=1 runs it")
def test_a_hundred_million_cells(scratch: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sizes = {"beta": 500, "a": 500, "omega1": 400}
    made = run(sizes, of=CODES, workers=2, store=scratch / "map.zarr")
    cells = prod(sizes.values())
    table(
        capsys,
        "10^8 cells: count, topology, figure-eight; two processes",
        {
            "time": f"{made.seconds:.0f} s, {cells / made.seconds / 1e6:.2f} million cells/s",
            "CPU time": f"{made.cpu:.0f} s, {made.cpu / cells * 1e9:.0f} ns a cell",
            "size": f"{made.size / 1e6:.1f} MB, {made.size / cells:.2f} bytes a cell",
            "memory": f"{made.memory / 1e6:.0f} MB in all processes",
        },
    )
