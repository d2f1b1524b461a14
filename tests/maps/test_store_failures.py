"""What goes wrong with stores: a message says what, and nothing that is done is lost."""

import json
import os
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from witnesses.kill_harness import FAIL, FIXED, TESTS, Map, content, local_cluster, stamps

import phasekit as pk

zarr = pytest.importorskip("zarr")

SHAPE = Map()
DISK = pk.GyroRotorDisk(**FIXED)


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The files of a sweep in which nothing went wrong."""
    path = tmp_path_factory.mktemp("expected") / "map.zarr"
    SHAPE.sweep(path, workers=1)
    return content(path)


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A map whose tiles from the third row on are missing."""
    path = tmp_path_factory.mktemp("begun") / "map.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FAIL, f"{SHAPE.axes['beta'][4]} raise")
        with pytest.raises(pk.StoreError):
            SHAPE.sweep(path, workers=1)
    assert SHAPE.done(path) == {(i, j) for i in (0, 1) for j in (0, 1)}
    return path


@pytest.fixture
def part(tmp_path, begun):
    """A copy of it, to be changed."""
    return shutil.copytree(begun, tmp_path / "map.zarr")


def python(code: str, *before: str, **options) -> str:
    """Run code in another process; `before` starts it."""
    path = os.pathsep.join([str(TESTS), str(TESTS.parent)])
    done = subprocess.run(
        [*before, sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        **options,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# ------------------------------------------------------------------------------ tiles that fail


@pytest.fixture(scope="module")
def client():
    pytest.importorskip("distributed")
    with local_cluster(2) as connected:
        yield connected


@pytest.mark.parametrize("engine", ["here", "processes", "cluster"])
def test_a_tile_that_raises(engine, tmp_path, expected, monkeypatch, request):
    options = {"here": {"workers": 1}, "processes": {"workers": 2}}.get(engine)
    if options is None:
        options = {"client": request.getfixturevalue("client")}
    path = tmp_path / "map.zarr"
    with monkeypatch.context() as patch:
        patch.setenv(FAIL, f"{SHAPE.axes['beta'][4]} raise")
        with pytest.raises(pk.StoreError) as caught:
            SHAPE.sweep(path, **options)
    message = str(caught.value)
    first = r"tile \[4:6, " if engine == "here" else r"tile \[(4:6|6:8), "  # of those at once
    assert re.search(first, message)
    for words in (
        str(path),
        "Odd: no result because of a test",
        "of 8 tiles are left",
        "what is done is kept",
        "the same call resumes the map",
    ):
        assert words in message
    done = SHAPE.done(path)
    assert done <= {(i, j) for i in (0, 1) for j in (0, 1)}
    left = int(re.search(r"(\d) of 8 tiles", message)[1])
    assert left == 8 - len(done) if engine == "here" else left >= 8 - len(done)
    kept = stamps(path, done)
    # That worker processes take up what is left is tried by kills.
    SHAPE.sweep(path, **({"workers": 1} if engine == "processes" else options))
    assert stamps(path, done) == kept
    assert content(path) == expected


def test_a_tile_that_ends_its_process(tmp_path, expected, monkeypatch):
    path = tmp_path / "map.zarr"
    with monkeypatch.context() as patch:
        patch.setenv(FAIL, f"{SHAPE.axes['beta'][6]} exit")
        with pytest.raises(pk.StoreError, match=r"worker processes ended 4 times.* tiles are left"):
            SHAPE.sweep(path, workers=2)
    assert SHAPE.done(path)
    SHAPE.sweep(path, workers=1)
    assert content(path) == expected


# ------------------------------------------------------------------------------ disks


@pytest.mark.parametrize("workers", [1, 2])
def test_a_disk_that_takes_no_more(workers, tmp_path):
    """Files cannot grow beyond a limit: those of codes and names fit, those of numbers do not."""
    axes = {"beta": np.linspace(0.1, 1.5, 200), "a": np.linspace(0.001, 0.05, 150)}
    expected = pk.sweep(DISK, axes)  # compiles the kernels, whose cache is written
    path = tmp_path / "map.zarr"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    options = {"store": path, "chunks": {"beta": 100}, "workers": workers}
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
    try:
        with pytest.raises(pk.StoreError, match=r"File too large.* of 2 tiles are left"):
            pk.sweep(DISK, axes, **options)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not pk.open_map(path).computed.any()
    options["workers"] = 1
    xr.testing.assert_identical(pk.sweep(DISK, axes, **options).load(), expected)
    assert not list(tmp_path.rglob("*.partial"))


FULL = r"""
import subprocess
from pathlib import Path
import numpy as np, pytest, xarray as xr
import phasekit as pk
from witnesses.kill_harness import FIXED

folder = Path({folder!r})
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", folder], check=True)
disk = pk.GyroRotorDisk(**FIXED)
axes = dict(beta=np.linspace(0.1, 1.5, 400), a=np.linspace(0.001, 0.05, 100))
expected = pk.sweep(disk, axes)
call = lambda **options: pk.sweep(
    disk, axes, store=folder / "map.zarr", chunks=dict(beta=20), **options
)
message = r"No space left on device.* of \d+ tiles are left"
ballast = folder / "ballast"
ballast.write_bytes(bytes(1_000_000))
with pytest.raises(pk.StoreError, match="not fit"):
    call()
assert not (folder / "map.zarr").exists()
with pytest.raises(pk.StoreError, match=message):
    call(workers={workers}, force=True)
partial = pk.open_map(folder / "map.zarr").load()
done = partial.computed.all("a")
assert 0 < done.sum() < 400
for name, full in expected.items():
    assert partial[name].where(done, drop=True).identical(full.where(done, drop=True)), name
subprocess.run(["mount", "-o", "remount,size=64m", folder], check=True)
assert call(workers=1).load().identical(expected)
assert not list(folder.rglob("*.partial"))
print("went on")
"""


# Of errors of worker processes, files that cannot grow are the case.
@pytest.mark.parametrize("workers", [1, 2] if "PHASEKIT_KILLS" in os.environ else [1])
def test_a_full_disk(workers, tmp_path):
    private = ["unshare", "--map-root-user", "--mount"]
    if os.geteuid() == 0:
        private.remove("--map-root-user")
    try:
        subprocess.run([*private, "mount", "-t", "tmpfs", "tmpfs", "/mnt"], check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no disk can be mounted here")
    folder = tmp_path / "disk"
    folder.mkdir()
    code = FULL.format(folder=str(folder), workers=workers)
    assert python(code, *private) == "went on\n"


READ_ONLY = """
from pathlib import Path
import pytest
import phasekit as pk
from witnesses.kill_harness import Map, content

path = Path({path!r})
before = content(path)
assert Map().done(path) == {{(i, j) for i in (0, 1) for j in (0, 1)}}
with pytest.raises(pk.StoreError, match=f"{{path}} cannot be written to"):
    Map().sweep(path, workers=1)
with pytest.raises(pk.StoreError, match=f"{{path.parent}} cannot be written to"):
    Map().sweep(path.parent / "new.zarr", workers=1)
assert content(path) == before
print("refused")
"""


def test_a_folder_that_is_read_only(part):
    """It opens; a sweep is refused before any work. Root gives up that it may write anywhere."""
    for folder in (part, *filter(Path.is_dir, part.rglob("*")), part.parent):
        folder.chmod(0o555)
    try:
        plain = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []
        if plain and not shutil.which("setpriv"):
            pytest.skip("runs as root, which may write anywhere")
        assert python(READ_ONLY.format(path=str(part)), *plain) == "refused\n"
    finally:
        for folder in (part.parent, part, *filter(Path.is_dir, part.rglob("*"))):
            folder.chmod(0o755)


# ------------------------------------------------------------------------------ every write


class Stopped(OSError):
    """Nothing can be written any more."""


@pytest.fixture
def writes(monkeypatch):
    """Count what is written to folders, and stop it after a number of writes."""
    count = {"left": np.inf, "done": 0}

    def counted(function):
        async def write(*args, **kwargs):
            if count["left"] <= 0:
                raise Stopped("stopped")
            count["left"] -= 1
            count["done"] += 1
            return await function(*args, **kwargs)

        return write

    for name in ("set", "set_if_not_exists", "delete", "delete_dir"):
        original = getattr(zarr.storage.LocalStore, name)
        monkeypatch.setattr(zarr.storage.LocalStore, name, counted(original))
    return count


AXES = {"beta": np.linspace(0.1, 1.2, 3), "a": np.array([0.0, 0.01])}
CALL = {"of": ["n_equilibria", "phi"], "chunks": {"beta": 2, "a": 2}, "workers": 1}
LONGER = {"beta": np.append(AXES["beta"], 1.3), "a": np.append(AXES["a"], 0.05)}
STEPS = {
    "new": (AXES, CALL),
    "more quantities": (AXES, {**CALL, "of": [*CALL["of"], "topology", "saddle_phi"]}),
    "longer": (LONGER, CALL),
    "longer, more quantities": (LONGER, {**CALL, "of": [*CALL["of"], "topology"]}),
    "overwritten": ({**AXES, "a": [0.02]}, {**CALL, "overwrite": True}),
}


@pytest.mark.parametrize("step", STEPS)
def test_each_write_may_be_the_last_one(step, tmp_path, writes):
    if step in ("more quantities", "longer") and "PHASEKIT_KILLS" not in os.environ:
        pytest.skip("both at once are tested; PHASEKIT_KILLS=1 runs each alone")
    axes, options = STEPS[step]
    begun, whole = tmp_path / "begun.zarr", tmp_path / "whole.zarr"
    if step != "new":
        pk.sweep(DISK, AXES, store=begun, **CALL)
        shutil.copytree(begun, whole)
    writes["done"] = 0
    pk.sweep(DISK, axes, store=whole, **options)
    number, result = writes["done"], content(whole)
    for left in range(0, number, 1 if "PHASEKIT_KILLS" in os.environ else 5):
        store = tmp_path / f"{left}.zarr"
        if step != "new":
            shutil.copytree(begun, store)
        writes["left"] = left
        with pytest.raises(pk.StoreError, match="stopped"):
            pk.sweep(DISK, axes, store=store, **options)
        writes["left"] = np.inf
        try:
            with pk.open_map(store) as partial:
                partial.load()
        except pk.StoreError:  # until the arrays are in place
            pass
        again = {**options, "overwrite": False}
        if step == "overwritten" and not any(store.glob("*")):
            again = options
        pk.sweep(DISK, axes, store=store, **again)
        assert content(store) == result, left
        shutil.rmtree(store)


# ------------------------------------------------------------------------------ stores


def refused(path: Path, match: str, call=None) -> None:
    """A call is refused with a message, and all files are as before."""
    before = content(path)
    with pytest.raises(pk.StoreError, match=match) as caught:
        (call or (lambda: SHAPE.sweep(path, workers=1)))()
    assert str(path) in str(caught.value)
    assert content(path) == before


def test_other_calls_are_refused(part):
    chunks = dict(zip(SHAPE.axes, SHAPE.chunks, strict=True))

    def call(disk=DISK, axes=None, **options):
        options = {"chunks": chunks, "workers": 1, **options}
        return lambda: pk.sweep(disk, axes or SHAPE.axes, store=part, **options)

    axes = SHAPE.axes
    moved = {**axes, "beta": axes["beta"] + 1e-16}
    assert moved["beta"][0] != axes["beta"][0]
    before = {**axes, "beta": np.append(0.0, axes["beta"])}
    for match, other in {
        "model is GyroRotorDisk, the call's Reduced": call(
            pk.Reduced(0.1, 0.2), {"lam": [0.1, 0.2]}, chunks=None
        ),
        r"\be is 0.0115, in the call 0.012": call(DISK.replace(e=0.012)),
        r"\bg is 9.80665, in the call 9.81": call(DISK.replace(g=9.81)),
        r"e is .*; .*omega1 is 2.5, in the call 2.6": call(DISK.replace(e=0.012, omega1=2.6)),
        r"values of beta are others": call(axes=moved),
        r"values of beta are others in the call, which may only be longer at its end": call(
            axes=before
        ),
        r"beta is an axis of 8 along beta, in the call an axis of 7": call(
            axes={**axes, "beta": axes["beta"][:-1]}
        ),
        r"a is an axis of 6 along a, in the call 0.02": call(
            axes={"beta": axes["beta"]}, chunks=None
        ),
        r"omega1 is 2.5, in the call an axis of 2": call(axes={**axes, "omega1": [2.5, 2.6]}),
        r"order of its axes is beta, a, in the call a, beta": call(
            axes=dict(reversed(axes.items()))
        ),
        r"holds phi as float64, the call asks for float32": call(dtype={"phi": "float32"}),
        r"in chunks of 2 along beta, the call asks for 4": call(chunks={"beta": 4}),
    }.items():
        refused(part, match, other)
    assert SHAPE.done(part) == {(i, j) for i in (0, 1) for j in (0, 1)}


def change(file: Path, edit) -> None:
    data = json.loads(file.read_text())
    edit(data)
    file.write_text(json.dumps(data))


def test_a_store_of_another_version_is_refused(part):
    def schema(data):
        data["attributes"]["phasekit_schema"] = "0"

    change(part / "zarr.json", schema)
    refused(part, "schema '0', wants '1'")
    refused(part, "schema '0', wants '1'", lambda: pk.open_map(part))


def test_a_store_made_by_other_versions_of_libraries(part, expected):
    """Of one schema, so it is continued."""

    def version(data):
        data["attributes"]["llvmlite_version"] = "0.1"

    change(part / "zarr.json", version)
    SHAPE.sweep(part, workers=1)
    changed = {name for name, data in content(part).items() if data != expected[name]}
    assert changed <= {"zarr.json", "sweep/zarr.json", "sweep/packed/zarr.json"}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        '{"zarr_format": 3}',
        "[]",
        "\0\0\0\0",
        '{"zarr_format":3,"node_type":"group","attributes":{"phasekit_model":"Nothing"}}',
    ],
)
@pytest.mark.parametrize(
    "file", ["zarr.json", "sweep/zarr.json", "phi/zarr.json", "beta/zarr.json"]
)
def test_metadata_that_cannot_be_read(file, text, part):
    (part / file).write_text(text)
    refused(part, ".")
    refused(part, ".", lambda: pk.open_map(part).load())


@pytest.mark.parametrize(
    "file", ["sweep/zarr.json", "phi/zarr.json", "beta/zarr.json", "sweep/part0/zarr.json"]
)
def test_metadata_that_is_gone(file, part, expected):
    """Refused; or continued to what it should be."""
    (part / file).unlink()
    try:
        SHAPE.sweep(part, workers=1)
    except pk.StoreError:
        refused(part, ".")
    else:
        assert content(part) == expected


@pytest.mark.parametrize(
    "edit",
    [
        lambda plan: plan.clear(),
        lambda plan: plan.pop("parts"),
        lambda plan: plan.update(parts=[{}]),
        lambda plan: plan.update(parts=3),
        lambda plan: plan.update(layout=99),
        lambda plan: plan["parts"][0]["quantities"].update(nothing="float64"),
    ],
)
def test_a_plan_that_cannot_be_read(edit, part):
    change(part / "sweep" / "zarr.json", lambda data: edit(data["attributes"]["plan"]))
    refused(part, ".")


@pytest.mark.parametrize("mark", [b"", b"\1", b"\0\0\0\0\0", b"\1\0\0\0\0", b"\1" * 100])
def test_a_torn_mark_counts_as_not_done(mark, part, expected):
    marks = [file for file in (part / "sweep" / "part0").glob("c*") if file.is_file()]
    assert len(marks) == 4
    torn = sorted(marks)[1]
    whole = torn.read_bytes()
    assert whole != mark
    torn.write_bytes(mark)
    tile = tuple(map(int, torn.name.split(".")[1:]))
    assert SHAPE.done(part) == {(0, 0), (0, 1), (1, 0), (1, 1)} - {tile}
    kept = stamps(part, SHAPE.done(part))
    SHAPE.sweep(part, workers=1)
    assert stamps(part, {(0, 0), (0, 1), (1, 0), (1, 1)} - {tile}) == kept
    assert content(part) == expected
    assert torn.read_bytes() == whole


def test_data_that_were_half_written_are_written_again(part, expected):
    """A chunk without a mark may hold anything."""
    for name in ("phi/c.2.0.0", "kind/c.3.1.0"):
        (part / name).write_bytes(b"half")
    (part / "phi" / f"c.2.1.0.{'0a' * 16}.partial").write_bytes(b"half")
    SHAPE.sweep(part, workers=1)
    assert content(part) == expected


def test_two_sweeps_at_once_are_refused(part, expected):
    fcntl = pytest.importorskip("fcntl")
    handle = os.open(part, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        refused(part, "another sweep is writing")
        pk.open_map(part).load()
    finally:
        os.close(handle)
    SHAPE.sweep(part, workers=1)
    assert content(part) == expected
