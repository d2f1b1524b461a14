"""Stored maps of systems whose equilibria are numbered: tile by tile, as all others."""

import functools
import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from witnesses.variants import some

import phasekit as pk
from phasekit.cli import main
from phasekit.maps import files, job, tile
from phasekit.maps.whole import WholeTarget, target_of

pytest.importorskip("zarr")

#: Systems with one equilibrium, with three, and, in another map, with none and two.
WELL = pk.Potential("x^4/4 - mu*x^2/2 - h*x", "x", {"mu": 1.0, "h": 0.0})
MU, H = np.linspace(-1.0, 1.0, 12), np.linspace(-0.5, 0.5, 7)
AXES = {"mu": MU, "h": H}
CALL = {"chunks": {"mu": 4, "h": 3}, "workers": 1}
FOUR = {"chunks": {"mu": 6, "h": 4}, "workers": 1}
SLOPE = pk.Potential("x^3/3 + mu*x", "x", {"mu": 1.0})


def content(path):
    return {f.relative_to(path): f.read_bytes() for f in Path(path).rglob("*") if f.is_file()}


@pytest.fixture(scope="module")
def expected():
    return pk.sweep(WELL, AXES)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A map in tiles, made without interruption."""
    path = tmp_path_factory.mktemp("whole") / "map.zarr"
    pk.sweep(WELL, AXES, store=path, **CALL)
    return path


@pytest.fixture(scope="module")
def four(tmp_path_factory):
    """The files of a map in four tiles."""
    path = tmp_path_factory.mktemp("four") / "map.zarr"
    pk.sweep(WELL, AXES, store=path, **FOUR)
    return content(path)


@pytest.fixture
def unforeseen(monkeypatch):
    """No column is foreseen, so that tiles find out."""
    monkeypatch.setattr(job, "columns_of_sample", lambda request: {"equilibrium": 0, "saddle": 0})


def test_tiles_are_as_in_memory(whole, expected):
    for chunks in (None, {}):
        for verify in (False, True):
            with pk.open_map(whole, chunks=chunks, verify=verify) as ds:
                xr.testing.assert_identical(ds.load(), expected)
    assert expected.x.identical(pk.open_map(whole).x.load())


def test_columns_that_were_not_foreseen(tmp_path, whole, unforeseen):
    pk.sweep(WELL, AXES, store=tmp_path / "map.zarr", **CALL)
    assert content(tmp_path / "map.zarr") == content(whole)


def test_nothing_is_solved_again_for_columns(tmp_path, unforeseen, monkeypatch):
    solved, compute = [], tile.compute_cells
    monkeypatch.setattr(tile, "compute_cells", lambda *a: solved.append(a) or compute(*a))
    pk.sweep(WELL, AXES, store=tmp_path / "map.zarr", **CALL)
    assert len(solved) == 9


@pytest.mark.parametrize("system", ["free", "perturbed"])
def test_other_systems(system, tmp_path):
    if system == "free":
        disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=6.0, m=1)
        one, call = pk.FreeGyroRotor(disk, 0.5), {"omega1": [1.0, 9.0, 30.0], "of": "equilibria"}
    else:
        one, call = pk.Perturbed(WELL, torque=0.1), {"torque": [0.0, 0.2, 2.0], "of": "equilibria"}
    stored = pk.sweep(one, **call, store=tmp_path / "map.zarr", chunks=1, workers=1)
    xr.testing.assert_identical(stored.load(), pk.sweep(one, **call))


def test_no_equilibria_at_all(tmp_path):
    stored = pk.sweep(SLOPE, mu=[1.0, 2.0], store=tmp_path / "map.zarr")
    xr.testing.assert_identical(stored.load(), pk.sweep(SLOPE, mu=[1.0, 2.0]))
    longer = [1.0, 2.0, -1.0, -2.0]  # with which there are
    stored = pk.sweep(SLOPE, mu=longer, store=tmp_path / "map.zarr")
    xr.testing.assert_identical(stored.load(), pk.sweep(SLOPE, mu=longer))


def test_more_quantities_and_states(tmp_path):
    store, at = tmp_path / "map.zarr", {"phi": [0.1, 0.3], "dphi": 0.2}
    pk.sweep(WELL, AXES, of="equilibria", store=store, **CALL)
    stored = pk.sweep(WELL, AXES, of=["equilibria", "separatrices", "period"], **at, store=store)
    want = pk.sweep(WELL, AXES, of=["equilibria", "separatrices", "period"], **at)
    xr.testing.assert_identical(stored.load(), want)


def test_lazy_axes_and_single_precision(tmp_path):
    mu = xr.DataArray(MU, dims="mu").chunk(mu=5)
    stored = pk.sweep(WELL, mu=mu, h=H, store=tmp_path / "map.zarr", dtype="float32", workers=1)
    xr.testing.assert_identical(stored.load(), pk.sweep(WELL, AXES, dtype="float32"))


class Killed(BaseException):
    """Ends a sweep where it stands, as a kill does."""


#: PHASEKIT_KILLS=1 tries three times as many.
MOMENTS = [3, 24, *range(1, 44, 4)] if "PHASEKIT_KILLS" in os.environ else [3, 13, 24, 37]


@pytest.mark.parametrize(
    ("after", "foreseen"),
    list(itertools.product(MOMENTS, [True, False]))[:: 1 if "PHASEKIT_KILLS" in os.environ else 3],
)
def test_a_sweep_that_is_killed_goes_on(tmp_path, four, monkeypatch, after, foreseen, request):
    if not foreseen:
        request.getfixturevalue("unforeseen")
    path, left, run = tmp_path / "map.zarr", [after], files.run

    def dying(coroutine):
        left[0] -= 1
        if left[0] < 0:
            coroutine.close()
            raise Killed
        return run(coroutine)

    with monkeypatch.context() as patch:
        patch.setattr(files, "run", dying)
        with pytest.raises(Killed):
            pk.sweep(WELL, AXES, store=path, **FOUR)
        tile.release_buffers()
    pk.sweep(WELL, AXES, store=path, **FOUR)
    assert content(path) == four


def test_a_map_without_arrays_says_so(tmp_path, monkeypatch, capsys):
    put, path = files.put, str(tmp_path / "map.zarr")
    monkeypatch.setattr(files, "put", lambda store, d: put(store, d) if len(d) < 4 else 1 / 0)
    with pytest.raises(ZeroDivisionError):
        pk.sweep(WELL, AXES, store=path, **CALL)
    for more in ([], ["--verify"]):
        assert main(["info", path, *more]) == 0
        assert "axes: mu 12, h 7" in (said := capsys.readouterr().out)
        assert "nothing is computed yet" in said
    with pytest.raises(pk.StoreError, match="its arrays are being created"):
        pk.open_map(path)


def test_an_unfinished_map_opens(tmp_path, expected, monkeypatch):
    compute, done = tile.compute_cells, []

    def failing(*given):
        done.append(1)
        if len(done) > 5:
            raise ValueError("a test")
        return compute(*given)

    monkeypatch.setattr(tile, "compute_cells", failing)
    with pytest.raises(pk.StoreError, match="a test"):
        pk.sweep(WELL, AXES, store=tmp_path / "map.zarr", **CALL)
    part = pk.open_map(tmp_path / "map.zarr").load()
    assert 0 < part.computed.sum() < part.computed.size
    assert main(["info", str(tmp_path / "map.zarr")]) == 0
    again = ["x", "saddle_x", "turning_x"]  # as coordinates, which stay where they are masked
    want = expected.where(part.computed).drop_vars(again)
    xr.testing.assert_equal(part.where(part.computed).drop_vars(["computed", *again]), want)


@pytest.mark.parametrize(
    "what", some(["phi/c.0.0.0", "kind/c.1.1.0", "loop/zarr.json", "equilibrium/c/0"], 2)
)
@pytest.mark.parametrize("how", ["cut", "flipped", "gone"])
def test_damage_is_noticed(tmp_path, whole, expected, what, how, capsys):
    path = shutil.copytree(whole, tmp_path / "map.zarr")
    file = path / what
    data = file.read_bytes()
    if how == "gone":
        file.unlink()
    else:
        file.write_bytes(data[:-9] if how == "cut" else bytes([data[0] ^ 4]) + data[1:])
    with pytest.raises(pk.StoreError, match="damaged|cannot be read"):
        pk.open_map(path, verify=True)
    assert main(["info", str(path), "--verify"]) == 2
    if "/c." in what:  # a tile is computed again
        with pytest.warns(UserWarning, match="the damaged tiles are computed again"):
            stored = pk.sweep(WELL, AXES, store=path, **CALL)
        xr.testing.assert_identical(stored.load(), expected)
        assert main(["info", str(path), "--verify"]) == 0
        assert "verified: 9 tiles" in capsys.readouterr().out


def test_what_was_written_in_one_go_is_replaced_when_asked(tmp_path, expected):
    path = tmp_path / "map.zarr"
    WholeTarget(target_of(path)).write(expected)
    with pytest.raises(pk.StoreError, match="cannot be continued"):
        pk.sweep(WELL, AXES, store=path)
    stored = pk.sweep(WELL, AXES, store=path, overwrite=True, **CALL)
    xr.testing.assert_identical(stored.load(), expected)
    assert main(["info", str(path), "--verify"]) == 0


def test_another_potential_is_refused(whole):
    other = pk.Potential("x^4/4 - mu*x^2/2 - 2*h*x", "x", {"mu": 1.0, "h": 0.0})
    with pytest.raises(pk.StoreError, match="phasekit_expression"):
        pk.sweep(other, AXES, store=whole)


def test_what_is_not_proved_is_said_of_stored_maps(tmp_path):
    well = pk.Potential("-a*exp(-((x - 3.3)/0.05)^2)", "x", {"a": 1.0}, interval=(-10.0, 10.0))
    for _ in range(2):  # computed, and found complete
        with pytest.warns(RuntimeWarning, match="of 10 such stretches, in 5 of 5 systems"):
            pk.sweep(
                well, a=np.linspace(0.5, 2.0, 5), store=tmp_path / "map.zarr", chunks=2, workers=1
            )


SCRIPT = """
import sys
import numpy as np
import phasekit as pk
well = pk.Potential("x^2/2 - a*log(cosh(3*x))", "x", {"a": 0.5}, interval=(-3.0, 3.0))
pk.sweep(well, a=np.linspace(-0.5, 0.7, 3000), store=sys.argv[1], chunks=100, workers=2)
"""


def marks(store):
    """Files of marks that are whole."""
    return [file for file in store.glob("sweep/part0/c.*") if file.name.count(".") == 1]


@functools.cache
def in_memory(well, count):
    return pk.sweep(well, a=np.linspace(-0.5, 0.7, count))


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="kills a group of processes")
@pytest.mark.parametrize("tiles", [1, 9] if "PHASEKIT_KILLS" in os.environ else [5])
def test_a_kill_of_all_processes(tmp_path, tiles):
    store = tmp_path / "map.zarr"
    process = subprocess.Popen([sys.executable, "-c", SCRIPT, store], start_new_session=True)
    while len(marks(store)) < tiles and process.poll() is None:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    done = {file: file.stat().st_mtime_ns for file in marks(store)}
    assert tiles <= len(done) < 30
    well = pk.Potential("x^2/2 - a*log(cosh(3*x))", "x", {"a": 0.5}, interval=(-3.0, 3.0))
    a = np.linspace(-0.5, 0.7, 3000)
    stored = pk.sweep(well, a=a, store=store, chunks=100, workers=1)
    xr.testing.assert_identical(stored.load(), in_memory(well, 3000))
    assert all(file.stat().st_mtime_ns == when for file, when in done.items())


@pytest.mark.slow
def test_processes_and_clusters(tmp_path, whole):
    pk.sweep(WELL, AXES, store=tmp_path / "many.zarr", chunks=CALL["chunks"], workers=2)
    assert content(tmp_path / "many.zarr") == content(whole)
    distributed = pytest.importorskip("distributed", reason="clusters need dask")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
        ) as some,
        distributed.Client(some) as client,
    ):
        path = tmp_path / "cluster.zarr"
        pk.sweep(WELL, AXES, store=path, chunks=CALL["chunks"], client=client)
    assert content(path) == content(whole)
