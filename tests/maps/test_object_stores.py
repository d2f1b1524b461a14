"""Maps where each file is a request to another machine: few of them, one after the other."""

import asyncio

import numpy as np
import pytest
import zarr
from zarr.storage import MemoryStore, WrapperStore

import phasekit as pk
from phasekit.errors import StoreError
from phasekit.maps.keys import PACKED
from phasekit.maps.plan import PLAN_KEY

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)


class Far(WrapperStore):
    """A store that notes what is asked for, in rounds: requests that are under way together."""

    def __init__(self, store):
        super().__init__(store)
        self.rounds, self.under_way = [], 0

    async def _asked(self, what, answer):
        if not self.under_way:
            self.rounds.append([])
        self.under_way += 1
        self.rounds[-1].append(what)
        try:
            await asyncio.sleep(0.005)
            return await answer
        finally:
            self.under_way -= 1

    async def get(self, key, prototype, byte_range=None):
        return await self._asked(f"get {key}", super().get(key, prototype, byte_range))

    async def set(self, key, value):
        await self._asked(f"set {key}", super().set(key, value))

    async def delete(self, key):
        await self._asked(f"delete {key}", super().delete(key))

    def with_read_only(self, read_only=False):
        return self


def test_a_tile_is_written_in_two_round_trips():
    """All its data, while the plan is read, and then its mark."""
    far = Far(MemoryStore())
    of = "equilibria"
    axes = {"beta": np.linspace(0.1, 1.4, 6)}
    ds = pk.sweep(DISK, **axes, of=of, store=far, chunks=2, workers=1)
    assert ds.equals(pk.sweep(DISK, **axes, of=of))
    marks = [i for i, asked in enumerate(far.rounds) if asked[0].startswith("set sweep/part0/c.")]
    assert [far.rounds[i] for i in marks] == [[f"set sweep/part0/c.{i}"] for i in range(3)]
    for i in marks:
        before = far.rounds[i - 1]
        written = {one.split()[1].split("/")[0] for one in before if one.startswith("set ")}
        assert len(written) > 5
        assert written == set(ds.data_vars)
        assert [one for one in before if one.startswith("get ")] == [f"get {PLAN_KEY}"]
    assert np.diff(marks).tolist() == [2, 2]  # and nothing else between tiles


@pytest.mark.parametrize("happens", ["removed", "replaced"])
def test_no_tile_is_marked_in_a_map_that_is_another_by_then(happens):
    memory = {}
    store = MemoryStore(memory)

    class Other(Far):
        async def set(self, key, value):
            if key.startswith("n_equilibria/c.1"):
                if happens == "removed":
                    del memory[PLAN_KEY]
                else:
                    memory[PLAN_KEY] = other[PLAN_KEY]
            await super().set(key, value)

    other = {}
    of = "n_equilibria"
    pk.sweep(DISK, beta=[0.2, 0.3, 0.4], of=of, store=MemoryStore(other), chunks=1, workers=1)
    said = {"removed": "the map was removed", "replaced": "the map was replaced"}
    with pytest.raises(StoreError, match=said[happens]):
        pk.sweep(DISK, beta=[0.1, 0.2, 0.3], of=of, store=Other(store), chunks=1, workers=1)
    assert "sweep/part0/c.0" in memory
    assert "sweep/part0/c.1" not in memory
    assert ("n_equilibria/c.1" in memory) == (happens == "replaced")


@pytest.mark.slow
def test_marks_are_read_together():
    memory = {}
    far = Far(MemoryStore(memory))
    tiles = 60
    beta = np.linspace(0.1, 1.4, tiles)
    pk.sweep(DISK, beta=beta, of="n_equilibria", store=far, chunks=1, workers=1)
    far.rounds.clear()
    del memory[PACKED]  # by which it would open without them
    ds = pk.open_map(far)
    assert ds.n_equilibria.size == tiles
    assert sum(map(len, far.rounds)) > tiles
    assert len(far.rounds) < 20
    assert zarr.open_group(far)["n_equilibria"].shape == (tiles,)
