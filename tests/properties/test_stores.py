"""However a map is made, it is the same: the same values to the last bit, labels and attributes.

Ways: in memory, lazily from chunked axes, in a store by this process, by worker processes, by a
cluster; continued after failing, extended by an axis or by quantities, opened again.
"""

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from witnesses.kill_harness import content, local_cluster

import phasekit as pk
from phasekit.maps import tile as tiles

pytest.importorskip("zarr")
pytest.importorskip("dask")

EXAMPLES = int(os.environ.get("PHASEKIT_MAPS", "2"))
few = settings(
    max_examples=EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5, m=1.5, half_span=0.1)
REDUCED = pk.Reduced(0.4, 0.3, 2.0)
#: Values of each axis, some of which are not valid.
AXES = {
    "beta": np.linspace(-0.1, 1.5, 7),
    "a": np.array([0.0, 0.01, 0.05, np.nan, 0.02]),
    "omega1": np.array([2.5, 0.0, -1.0, 1e200]),
    "lam": np.array([0.0, 0.5, 1.0, -2.0]),
    "psi": np.linspace(0.0, 1.0, 5),
    "state_phi": np.array([-1.0, 0.0, np.pi, 2.5]),
}
STATES = {"state_phi": 0.4, "state_dphi": 0.7, "time": 3.0}
#: What is computed, on which of the axes, and with which states.
SUBJECTS = [
    (DISK, ("beta", "a"), ("equilibria", "separatrices"), ()),
    (DISK, ("beta", "a", "omega1"), ("n_equilibria", "topology", "figure_eight", "kind"), ()),
    (DISK, ("a", "beta"), ("phi", "equilibrium_forces"), ()),
    (DISK, ("beta", "a", "state_phi"), ("fold_margin", "orbits"), ("state_dphi",)),
    (DISK, ("omega1", "state_phi"), ("motion", "equilibria"), ("state_dphi", "time")),
    (REDUCED, ("psi", "lam"), ("separatrices", "phi"), ()),
    (REDUCED, ("lam",), ("orbits",), ("state_phi", "state_dphi")),
]


@st.composite
def calls(draw):
    """Draw a call of sweep, and chunks for it."""
    system, names, of, states = draw(st.sampled_from(SUBJECTS))
    axes = {name: AXES[name][: draw(st.integers(1, len(AXES[name])))] for name in names}
    axes.update({name: STATES[name] for name in states})
    chunks = {name: draw(st.sampled_from([1, 2, 3, -1])) for name in names}
    dtype = draw(st.sampled_from([None, None, "float32"]))
    return system, axes, {"of": of, "dtype": dtype}, chunks


def assert_same(left: xr.Dataset, right: xr.Dataset) -> None:
    """Identical, to the bits and to the types of attributes, in the same order."""
    left, right = left.compute(), right.compute()
    xr.testing.assert_identical(left, right)
    assert list(left.data_vars) == list(right.data_vars)
    assert left.sizes == right.sizes
    for name in left.variables:
        one, other = left[name], right[name]
        assert one.dtype == other.dtype, name
        assert one.dims == other.dims, name
        if one.dtype.kind in "fib":
            assert one.values.tobytes() == other.values.tobytes(), name
        for key, value in one.attrs.items():
            assert type(value) is type(other.attrs[key]), (name, key)
            assert getattr(value, "dtype", None) == getattr(other.attrs[key], "dtype", None)
    assert list(left.attrs.items()) == list(right.attrs.items())


@pytest.fixture
def folder():
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@pytest.fixture(scope="module")
def client():
    pytest.importorskip("distributed")
    with local_cluster(2) as connected:
        yield connected


def fresh(folder: Path) -> Path:
    return Path(tempfile.mkdtemp(dir=folder)) / "map.zarr"


@few
@given(calls())
def test_in_one_process_and_opened_again(folder, call):
    system, axes, options, chunks = call
    expected = pk.sweep(system, axes, **options)
    store = fresh(folder)
    assert_same(expected, pk.sweep(system, axes, store=store, chunks=chunks, workers=1, **options))
    assert_same(expected, pk.open_map(store))
    assert_same(expected, pk.open_map(str(store), chunks={}))
    before = content(store)
    assert_same(expected, pk.sweep(system, axes, store=store, chunks=chunks, workers=1, **options))
    assert content(store) == before


@few
@given(calls(), st.randoms(use_true_random=False))
def test_lazily(call, random):
    system, axes, options, chunks = call
    options = {**options, "dtype": None}
    expected = pk.sweep(system, axes, **options)
    lazy = {
        name: value
        if np.ndim(value) == 0 or random.random() < 0.2
        else xr.DataArray(value, dims=name).chunk({name: chunks[name]})
        for name, value in axes.items()
    }
    assert_same(expected, pk.sweep(system, lazy, **options))


@few
@given(calls(), st.data())
def test_resumed(folder, call, data):
    """Fails at some tile, more than once, and goes on."""
    system, axes, options, chunks = call
    expected = pk.sweep(system, axes, **options)
    whole, store = fresh(folder), fresh(folder)
    arguments = {"chunks": chunks, "workers": 1, **options}
    pk.sweep(system, axes, store=whole, **arguments)
    compute, computed = tiles.compute_cells, []
    left = data.draw(st.integers(0, 5), "tiles before the failure")

    def fails(*args):
        if len(computed) == left:
            raise OSError(5, "Input/output error")
        result = compute(*args)
        computed.append(args)
        return result

    total = 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tiles, "compute_cells", fails)
        while True:
            try:
                pk.sweep(system, axes, store=store, **arguments)
            except pk.StoreError as error:
                message = str(error)
            else:
                total += len(computed)
                break
            assert "Input/output error" in message
            assert "the same call resumes the map" in message
            with pk.open_map(store) as partial:
                assert_partial(partial, expected)
            total += len(computed)
            computed.clear()
            left = data.draw(st.integers(1, 9), "tiles before the next failure")
    assert_same(expected, pk.open_map(store))
    assert content(store) == content(whole)
    assert total == sum(1 for name in content(whole) if "/part" in name and "json" not in name)


def assert_partial(partial: xr.Dataset, expected: xr.Dataset) -> None:
    """What is computed is there; what is not is marked."""
    partial, expected = partial.load(), expected.load()
    assert partial.computed.dtype == bool
    assert not partial.computed.all()
    assert list(partial.drop_vars("computed")) == list(expected)
    for name, full in expected.items():
        assert partial[name].dtype == full.dtype
        assert partial[name].dims == full.dims
        assert partial[name].attrs.keys() == full.attrs.keys()
        done = partial.computed
        assert partial[name].where(done).identical(full.where(done)), name
        # Elsewhere some quantities may be there, those of fewer dims or of other calls.
        there = (partial[name] == full) | (partial[name].isnull() & full.isnull())
        if full.dtype.kind == "f":
            assert (done | there | partial[name].isnull()).all(), name
        elif -1 in full.attrs.get("flag_values", ()) or name == "n_equilibria":
            assert (done | there | (partial[name] == -1)).all(), name


@few
@given(calls(), st.data())
def test_extended(folder, call, data):
    """Begun with fewer quantities and shorter axes, which then grow in any order."""
    system, axes, options, chunks = call
    expected = pk.sweep(system, axes, **options)
    names = list(expected.data_vars)
    store = fresh(folder)
    swept = [name for name, value in axes.items() if np.ndim(value)]
    sizes = {name: data.draw(st.integers(1, len(axes[name])), name) for name in swept}
    of = names[: data.draw(st.integers(1, len(names)), "quantities to begin with")]
    while True:
        groups = {pk.quantities()[name].group for name in of}
        part = {
            name: value[: sizes[name]] if name in sizes else value
            for name, value in axes.items()
            if name not in STATES or groups & {"orbits", "motion"}
        }
        pk.sweep(system, part, store=store, workers=1, of=of, dtype=options["dtype"])
        growing = [name for name in swept if sizes[name] < len(axes[name])]
        steps = growing + (["of"] if len(of) < len(names) else [])
        if not steps:
            break
        step = data.draw(st.sampled_from(steps), "what grows")
        if step == "of":
            rest = [name for name in names if name not in of]
            of = of + rest[: data.draw(st.integers(1, len(rest)), "how many")]
        else:
            sizes[step] = data.draw(st.integers(sizes[step] + 1, len(axes[step])), step)
    assert_same(expected, pk.open_map(store))


@settings(few, max_examples=max(EXAMPLES // 3, 2))
@given(calls())
def test_in_worker_processes(folder, call):
    system, axes, options, chunks = call
    expected = pk.sweep(system, axes, **options)
    one, two = fresh(folder), fresh(folder)
    assert_same(expected, pk.sweep(system, axes, store=two, chunks=chunks, workers=2, **options))
    pk.sweep(system, axes, store=one, chunks=chunks, workers=1, **options)
    assert content(one) == content(two)


@few
@given(calls())
def test_on_a_cluster(folder, client, call):
    system, axes, options, chunks = call
    expected = pk.sweep(system, axes, **options)
    one, two = fresh(folder), fresh(folder)
    arguments = {"chunks": chunks, **options}
    assert_same(expected, pk.sweep(system, axes, store=two, client=client, **arguments))
    pk.sweep(system, axes, store=one, workers=1, **arguments)
    assert content(one) == content(two)
