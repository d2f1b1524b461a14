"""Sweeps into a store: what is there already, what is left, and who computes it.

The order of what is written makes an interrupted sweep one that can go on: the plan before the
arrays, the data of a tile before its mark, the marks before the plan says that a part is complete.
The file by which a finished map opens is written before the plan that names it, and tiles change
only under a plan that names none.
"""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from phasekit.cells.numbered import warn_unproved
from phasekit.cells.progress import progress_bar
from phasekit.cells.request import Request
from phasekit.errors import StoreError, warn
from phasekit.maps import workers as run
from phasekit.maps.clusters import connected, on_cluster
from phasekit.maps.damage import describe
from phasekit.maps.estimate import SAMPLE_CELLS, refuse_too_large_for, sample_cells
from phasekit.maps.job import Job, plan_job
from phasekit.maps.marks import read_marks
from phasekit.maps.options import StoreOptions
from phasekit.maps.place import Place
from phasekit.maps.plan import CLEARED, PLAN_KEY, plan_bytes
from phasekit.maps.stored_arrays import NO_MEMORY, prepare, read_plan, write_plan
from phasekit.maps.tile import Tile, finish_writing, is_marked, release_buffers
from phasekit.maps.unfinished import write_packed
from phasekit.numerics.interrupts import deferred_interrupts

#: Seconds of work for which worker processes are not worth their start.
FEW_SECONDS = 4.0

#: Cells from which on they are started before it is known how long the work takes.
MANY_CELLS = 10_000_000


def sweep_into(
    place: Place, request: Request, options: StoreOptions, progress: bool | None = None
) -> None:
    """Compute what a store does not hold yet."""
    place.refuse_file()
    refused = place.unwritable()
    if refused is not None:
        if options.overwrite or _to_do(place, request, options):
            raise StoreError(refused)
        return  # complete, so that nothing is to be written
    with _written(place), place.locked():
        job = plan_job(place, request, options, verify=True)
        _say_damaged(job)
        _carry_out(job, options, progress)
        while request.is_open and job.count:  # tiles may need more columns than the arrays have
            job = plan_job(place, request, replace(options, overwrite=False))
            _carry_out(job, options, progress)
        _finish(job)
        if request.is_open:
            _say_unproved(job)


def _say_unproved(job: Job) -> None:
    """Say where in a map it is not proved that there are no more equilibria."""
    asked = {row.name for row in job.request.rows}
    for part in job.plan.parts:
        if not asked.isdisjoint(part.quantities):
            marks = read_marks(job.place.open(read_only=True), part).values()
            found = [mark.unproved for mark in marks if mark.unproved]
            if found:
                low, high = max((one[:2] for one in found), key=lambda ends: ends[1] - ends[0])
                number, systems = (int(sum(one[i] for one in found)) for i in (2, 3))
                shape = [job.plan.sizes[dim] for dim in part.dims]
                warn_unproved(job.request.system, (low, high, number, systems), shape)
                return


def _carry_out(job: Job, options: StoreOptions, progress: bool | None) -> None:
    """Make the arrays those of the plan, and compute the tiles that are left."""
    tally = Tally(job)
    with contextlib.ExitStack() as stack:
        stack.enter_context(_interrupt_report(tally))
        client, workers = options.client, options.workers
        if client is not None:
            client = stack.enter_context(connected(client))
        most = _most(job, workers, client)
        early = most > 1 and (workers is not None or job.cells > MANY_CELLS)
        staff = stack.enter_context(run.hired(most)) if early else None
        processes = _weigh(job, most, workers, options.force, early)
        if job.old is None:
            job.place.clear({PLAN_KEY: plan_bytes(CLEARED)})
        if job.plan != job.old:
            prepare(job.place, job.old, job.plan, job.request, options.compressor)
        _compute(tally, staff or processes, client, progress)


def _most(job: Job, workers: int | None, client: Any) -> int:
    """Return how many processes there may be; refuse what cannot run in others."""
    from phasekit.numerics.launch import cpus

    most = 1 if client is not None else min(workers or cpus(), job.count)
    if most > 1 or client is not None:
        here = run.keeps_here(next(job.tiles())) if job.count else None
        if not job.place.shared:
            here = f"{job.place.name} lies in the memory of this process"
        elif client is None and multiprocessing.current_process().daemon:
            here = "this process is daemonic and may not start others"
        if here is not None:
            if workers is not None or client is not None:
                raise StoreError(
                    f"store: the map cannot be computed in other processes: {here}; pass "
                    "workers=1 and no client=, or choose another store"
                )
            most = 1
    return most


def _weigh(job: Job, most: int, workers: int | None, force: bool, hired: bool) -> int:
    """Refuse what will not fit, and return how many processes the work is worth."""
    freed = (job.place.size() or 0) if job.old is None and not job.place.empty else 0
    free = job.place.free_bytes()
    most_bytes = sum(left.raw + left.overhead for left in job.left if len(left))
    tight = not force and free is not None and most_bytes > free + freed
    few = min((sample_cells(left.part.rows) for left in job.left), default=SAMPLE_CELLS)
    # Processes that are hired already would wait for samples that decide nothing.
    if not tight and (most <= 1 or hired or job.cells <= few):
        return 1 if workers is None else most
    # Kernels that are not compiled yet are compiled here, before many processes do so.
    needed = job.estimate()
    if not force:
        refuse_too_large_for(job.place, needed, freed)
    return 1 if workers is None and needed.seconds < FEW_SECONDS else most


class Tally:
    """How far a job is."""

    def __init__(self, job: Job) -> None:
        self.job, self.finished = job, 0
        self.under_way: dict[tuple[str, tuple[int, ...]], Tile] = {}

    def tiles(self) -> Iterator[Tile]:
        """Return the tiles that are left."""
        for tile in self.job.tiles():
            self.under_way[tile.part, tile.index] = tile
            yield tile

    def finish(self, tile: Tile) -> None:
        """Count a tile."""
        self.finished += self.under_way.pop((tile.part, tile.index), None) is not None

    def settle(self) -> None:
        """Count those that were finished when an error or an interrupt came."""
        finish_writing()
        for tile in list(self.under_way.values()):
            if is_marked(tile):
                self.finish(tile)
        release_buffers()

    @property
    def left(self) -> int:
        """Number of tiles that are left."""
        return self.job.count - self.finished


@contextlib.contextmanager
def _interrupt_report(tally: Tally) -> Iterator[None]:
    """Say how far a job is when it is interrupted."""
    try:
        yield
    except KeyboardInterrupt:
        with contextlib.suppress(KeyboardInterrupt):  # a second one ends this, too
            with deferred_interrupts():
                tally.settle()
            if tally.under_way:
                tally.job.place.sweep_leftovers()
        total = tally.job.total
        raise KeyboardInterrupt(
            f"{total - tally.left} of {total} tiles are done; the same call resumes the map"
        ) from None


def _compute(tally: Tally, processes: int | run.Staff, client: Any, progress: bool | None) -> None:
    """Compute the tiles that are left."""
    job = tally.job
    if not job.count:
        return
    tiles = tally.tiles()
    if client is not None:
        results = on_cluster(tiles, client)
    elif isinstance(processes, run.Staff):
        results = processes.compute(tiles)
    elif processes > 1:
        results = run.in_processes(tiles, processes)
    else:
        results = run.in_this_process(tiles)
    total = sum(left.part.cells(job.plan.sizes) for left in job.left)
    try:
        with progress_bar(total, progress, total - job.cells) as bar, contextlib.closing(results):
            for tile in results:
                tally.finish(tile)
                bar.update(tile.cells)
    except StoreError as error:
        tally.settle()
        raise StoreError(
            f"store: {job.place.name}: {error}; {tally.left} of {job.count} tiles "
            "are left; what is done is kept, and the same call resumes the map from there"
        ) from error


def _finish(job: Job) -> None:
    """Say that what was computed is complete, after removing what killed processes left."""
    complete = {left.part.name for left in job.left}
    plan = read_plan(job.place.open(read_only=True))
    if plan is None or plan.generation != job.plan.generation:
        raise StoreError(
            f"store: {job.place.name} was removed or replaced while the map was being computed; "
            f"repeat the call"
        )
    parts = tuple(
        replace(part, complete=part.complete or part.name in complete) for part in plan.parts
    )
    earlier = () if all(part.complete for part in parts) else plan.earlier
    done = replace(plan, parts=parts, earlier=earlier)
    if done != plan:
        job.place.sweep_leftovers()
    if not done.packed:
        done = replace(done, packed=write_packed(job.place, done))
    if done != plan:
        write_plan(job.place, done)


def _to_do(place: Place, request: Request, options: StoreOptions) -> bool:
    """Whether a call has anything to write."""
    if place.path is not None and not place.path.is_dir():
        return True
    job = plan_job(place, request, options)
    return job.plan != job.old or job.count > 0


def _say_damaged(job: Job) -> None:
    if job.damaged:
        warn(
            f"store: {job.place.name} is damaged: {describe(job.damaged, job.plan.sizes)}; the "
            f"damaged tiles are computed again",
        )


@contextlib.contextmanager
def _written(place: Place) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if isinstance(error, StoreError):
            raise
        raise StoreError(f"store: {place.name} cannot be written: {error}") from error
    except MemoryError as error:
        raise StoreError(
            f"store: {place.name} was not finished: {NO_MEMORY}; what is done is kept, and the "
            f"same call resumes the map from there"
        ) from error
