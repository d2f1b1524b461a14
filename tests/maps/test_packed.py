"""The file by which a finished map opens: few requests, and never older than its tiles."""

import dataclasses
import itertools
import json
import os
import random

import numpy as np
import pytest
import xarray as xr
from zarr.storage import MemoryStore, WrapperStore

import phasekit as pk
from phasekit.cli import main
from phasekit.errors import StoreError
from phasekit.labelled.info import map_info
from phasekit.maps.keys import PACKED
from phasekit.maps.plan import PLAN_KEY, plan_bytes, plan_from

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
AXES = {"beta": np.linspace(0.1, 1.5, 5), "a": np.array([0.0, 0.02, 0.05])}
LONGER = {**AXES, "a": np.array([0.0, 0.02, 0.05, 0.07])}
CALL = {"of": ["n_equilibria", "phi"], "chunks": {"beta": 2, "a": 2}, "workers": 1}
EXPECTED = pk.sweep(DISK, AXES, of=CALL["of"])


#: Writes between two stops; those of the plan come close together, at both ends.
STEP = 1 if "PHASEKIT_KILLS" in os.environ else 5


class Stopped(OSError):
    pass


class Watched(WrapperStore):
    """A store that counts requests, fails after some writes, and looks at the plan before each."""

    def __init__(self, kept=None, writes=None):
        self.files = {} if kept is None else kept
        super().__init__(MemoryStore(self.files))
        self.asked, self.stale = [], []
        self.left = itertools.count() if writes is None else iter(range(writes))

    def with_read_only(self, read_only=False):
        return self

    def _write(self, key):
        if next(self.left, None) is None:
            raise Stopped("stopped")
        plan = self.files.get(PLAN_KEY)
        if plan is not None and key != PLAN_KEY and "packed" in plan_of(self.files):
            self.stale.append(key)

    async def get(self, key, prototype, byte_range=None):
        self.asked.append(f"get {key}")
        return await super().get(key, prototype, byte_range)

    async def set(self, key, value):
        self._write(key)
        await super().set(key, value)

    async def delete(self, key):
        self._write(key)
        await super().delete(key)

    async def delete_dir(self, prefix):
        self._write(prefix)
        await super().delete_dir(prefix)

    async def list(self):
        self.asked.append("list")
        async for key in super().list():
            yield key

    async def list_dir(self, prefix):
        self.asked.append(f"list {prefix}")
        async for key in super().list_dir(prefix):
            yield key


def plan_of(kept):
    return json.loads(kept[PLAN_KEY].to_bytes())["attributes"]["plan"]


def content(kept):
    return {key: value.to_bytes() for key, value in kept.items()}


def sweep(store, axes=AXES, **options):
    return pk.sweep(DISK, axes, store=store, **{**CALL, **options})


@pytest.fixture(scope="module")
def made():
    kept = {}
    sweep(MemoryStore(kept))
    return kept


def put(kept, key, data):
    kept[key] = type(kept[PLAN_KEY]).from_bytes(data)


@pytest.mark.parametrize("length", [2, 8, pytest.param(20, marks=pytest.mark.slow)])
def test_a_finished_map_opens_by_few_requests(length):
    far = Watched()
    axes = {"beta": np.linspace(0.1, 1.4, length), "a": np.linspace(0.0, 0.05, length)}
    pk.sweep(DISK, axes, of="n_equilibria", store=far, chunks=1, workers=1)
    assert sum(key.startswith("sweep/part0/c.") for key in far.files) == length**2
    far.asked.clear()
    ds = pk.open_map(far)
    assert far.asked == [f"get {PLAN_KEY}", f"get {PACKED}"]
    xr.testing.assert_identical(ds.load(), pk.sweep(DISK, axes, of="n_equilibria"))
    far.asked.clear()
    assert f"{length**2} of {length**2} tiles are done" in str(map_info(far))
    assert 0 < len(far.asked) <= 20


def test_parts_of_fewer_dims():
    """One without any has one tile."""
    states = {"state_phi": [0.1, 0.2, 0.3], "state_dphi": 0.0}
    of = ["n_equilibria", "period", "phi"]
    far = Watched()
    pk.sweep(DISK, states, of=of, store=far, chunks=2, workers=1)
    assert [key for key in far.files if "/c" in key and "sweep" in key] == [
        "sweep/part0/c", "sweep/part1/c.0", "sweep/part1/c.1"
    ]  # fmt: skip
    far.asked.clear()
    assert pk.open_map(far).load().identical(pk.sweep(DISK, states, of=of))
    assert not any("part" in key for key in far.asked)
    pk.open_map(far, verify=True)


def damaged(kind, data):
    chosen = random.Random(kind)
    places = sorted(chosen.sample(range(len(data)), 12)) + [0, len(data) - 1]
    if kind == "flipped":
        for place in places:
            yield bytes([*data[:place], data[place] ^ 1 << chosen.randrange(8), *data[place + 1 :]])
    elif kind == "cut":
        yield from (data[:place] for place in places)
    elif kind == "another's":
        other = {}
        pk.sweep(DISK.replace(e=0.02), AXES, store=MemoryStore(other), **CALL)
        yield other[PACKED].to_bytes()
        yield other[PLAN_KEY].to_bytes()
    else:
        yield None


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["flipped", "cut", "another's", "removed"])
def test_a_damaged_one_is_not_used(kind, made):
    data, tried = made[PACKED].to_bytes(), 0
    for wrong in damaged(kind, data):
        assert wrong != data
        tried += 1
        kept = dict(made)
        if wrong is None:
            del kept[PACKED]
        else:
            put(kept, PACKED, wrong)
        store = MemoryStore(kept)
        assert pk.open_map(store).load().identical(EXPECTED)
        with pytest.raises(StoreError, match=f"{PACKED} (is gone|has changed)"):
            pk.open_map(store, verify=True)
        if tried == 1:
            assert sweep(store).load().identical(EXPECTED)
            assert content(kept) == content(made)
    assert tried == {"flipped": 14, "cut": 14, "another's": 2, "removed": 1}[kind]


def test_one_whose_tiles_are_damaged(made):
    """It says which files there are: one that is gone or of another map is refused when read."""
    other = {}
    pk.sweep(DISK.replace(e=0.02), AXES, store=MemoryStore(other), **CALL)
    for wrong in (None, other["phi/c.1.0.0"].to_bytes(), made["phi/c.0.1.0"].to_bytes()):
        kept = dict(made)
        if wrong is None:
            del kept["phi/c.1.0.0"]
        else:
            put(kept, "phi/c.1.0.0", wrong)
            put(kept, "sweep/part0/c.1.0", other["sweep/part0/c.1.0"].to_bytes())
        ds = pk.open_map(MemoryStore(kept))
        np.testing.assert_array_equal(ds.phi[:2], EXPECTED.phi[:2])
        with pytest.raises(StoreError, match=r"phi in the tile \[2:4, 0:2\]"):
            ds.phi.load()
        with pytest.raises(StoreError, match=r"\[2:4, 0:2\]"):
            pk.open_map(MemoryStore(kept), verify=True)


def test_a_single_mark_that_is_another_is_found_by_verifying(made):
    kept = dict(made)
    put(kept, "beta/c/0", made["a/c/0"].to_bytes())
    assert pk.open_map(MemoryStore(kept)).load().identical(EXPECTED)
    with pytest.raises(StoreError, match="beta/c/0 has changed"):
        pk.open_map(MemoryStore(kept), verify=True)
    kept = dict(made)
    del kept["sweep/part0/c.1.0"]
    with pytest.raises(StoreError, match="has no mark"):
        pk.open_map(MemoryStore(kept), verify=True)


@pytest.mark.slow
def test_verifying_a_folder_knows_it(tmp_path, capsys):
    path = tmp_path / "map.zarr"
    sweep(path)
    assert main(["info", str(path), "--verify"]) == 0
    data = (path / PACKED).read_bytes()
    for wrong in (data[:-1], None):
        (path / PACKED).unlink() if wrong is None else (path / PACKED).write_bytes(wrong)
        assert pk.open_map(path).load().identical(EXPECTED)
        capsys.readouterr()
        assert main(["info", str(path), "--verify"]) == 2
        assert PACKED in capsys.readouterr().err
        sweep(path)
        assert (path / PACKED).read_bytes() == data
        assert main(["info", str(path), "--verify"]) == 0
    sweep(path, overwrite=True)  # it is one of the map's own files
    assert (path / PACKED).read_bytes() == data


CHANGES = {
    "longer": lambda store: sweep(store, LONGER),
    "more": lambda store: sweep(store, of=[*CALL["of"], "energy"]),
    "repaired": sweep,
    "replaced": lambda store: sweep(store, LONGER, overwrite=True),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.filterwarnings("ignore:store. .* is damaged")
def test_it_is_out_of_date_before_anything_changes(change, made):
    """Stopped after some writes: what opens is the old map or the new one, as far as it is."""
    call = CHANGES[change]
    begin = dict(made)
    if change == "repaired":
        put(begin, "phi/c.1.0.0", made["phi/c.0.1.0"].to_bytes())
    whole = Watched(dict(begin))
    right = call(whole).load()
    assert whole.stale == []
    assert "packed" in plan_of(whole.files)
    assert whole.files[PACKED].to_bytes() != made[PACKED].to_bytes() or change == "repaired"
    opened = 0
    for writes in range(0, 200, STEP):
        kept = dict(begin)
        stopped = Watched(kept, writes)
        try:
            call(stopped)
        except (StoreError, Stopped):
            pass
        else:
            break
        assert stopped.stale == []
        if PLAN_KEY in kept:
            assert ("packed" in plan_of(kept)) == (kept[PLAN_KEY] == begin[PLAN_KEY])
        try:
            ds = pk.open_map(MemoryStore(kept)).load()
        except StoreError:
            pass
        else:
            opened += 1
            computed = ds.computed if "computed" in ds else True
            for name in ds.data_vars.keys() - {"computed"}:
                expected = right[name].isel({dim: slice(n) for dim, n in ds[name].sizes.items()})
                xr.testing.assert_equal(ds[name].where(computed), expected.where(computed))
        assert call(MemoryStore(kept)).load().identical(right)
        assert content(kept) == content(whole.files)
    assert writes > 5
    assert opened > 0


def test_maps_without_it_open_and_get_it(made):
    kept = dict(made)
    del kept[PACKED]
    plan = plan_of(kept)
    assert len(plan.pop("packed")) == 64
    earlier = dataclasses.replace(plan_from(kept[PLAN_KEY].to_bytes()), packed="")
    put(kept, PLAN_KEY, plan_bytes(earlier))
    assert plan_of(kept).keys() == plan.keys()
    store = MemoryStore(kept)
    assert pk.open_map(store, verify=True).load().identical(EXPECTED)
    assert sweep(store).load().identical(EXPECTED)
    assert content(kept) == content(made)
