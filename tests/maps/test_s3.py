"""Maps in a bucket: a local server that speaks S3."""

import logging
import time

import fsspec.asyn
import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.errors import StoreError
from phasekit.maps import files
from phasekit.maps.keys import PACKED

pytest.importorskip("moto.server", reason="a server of S3 is an extra: phasekit[s3-server]")
s3fs = pytest.importorskip("s3fs")
pytestmark = pytest.mark.slow

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
BUCKET = "maps"


class Requests(logging.Handler):
    """What the server was asked for."""

    def __init__(self):
        super().__init__()
        self.lines = []

    def emit(self, record):
        text = record.getMessage()
        if BUCKET in text:
            self.lines.append(text.split('"')[1].rsplit(" ", 1)[0])

    def since(self, call):
        before = len(self.lines)
        result = call()
        time.sleep(0.1)  # a request is logged after its answer
        return result, self.lines[before:]


@pytest.fixture(scope="module")
def requests():
    from moto.server import ThreadedMotoServer

    s3fs.S3FileSystem.clear_instance_cache()
    log, handler = logging.getLogger("werkzeug"), Requests()
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=True)
    with pytest.MonkeyPatch.context() as patch:
        server.start()
        host, port = server.get_host_and_port()
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        patch.setenv("AWS_ACCESS_KEY_ID", "none")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "none")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        log.addHandler(handler)
        level = log.level
        log.setLevel(logging.INFO)
        s3fs.S3FileSystem().mkdir(BUCKET)
        try:
            yield handler
        finally:
            log.removeHandler(handler)
            log.setLevel(level)
            for one in list(s3fs.S3FileSystem._cache.values()):
                if one._s3creator is not None:
                    end = one._s3creator.__aexit__
                    if one.asynchronous:
                        files.run(end(None, None, None))
                    else:
                        fsspec.asyn.sync(one.loop, end, None, None, None)
            s3fs.S3FileSystem.clear_instance_cache()
            server.stop()


def test_a_map_in_a_bucket(requests):
    """Made, opened by few requests, made longer, damaged, and mended."""
    store = f"s3://{BUCKET}/map.zarr"
    axes = {"beta": np.linspace(0.1, 1.4, 4), "a": np.linspace(0.0, 0.05, 3)}
    call = {"of": ["n_equilibria", "topology"], "store": store, "chunks": 1, "workers": 1}
    short = {**axes, "beta": axes["beta"][:3]}
    _, asked = requests.since(lambda: pk.sweep(DISK, short, **call))
    tiles = [one for one in asked if one.startswith("PUT") and "/sweep/part0/c." in one]
    assert len(tiles) == 9
    # The files of a tile and the plan, which is read meanwhile; then its mark.
    between = np.diff([asked.index(one) for one in tiles])
    assert np.all(between == 4)
    ds, asked = requests.since(lambda: pk.open_map(store))
    assert 2 <= len(asked) <= 20
    assert not any("part0/c" in one for one in asked)
    assert any(PACKED in one for one in asked)
    xr.testing.assert_identical(ds.load(), pk.sweep(DISK, short, of=call["of"]))
    expected = pk.sweep(DISK, axes, of=call["of"])
    xr.testing.assert_identical(pk.sweep(DISK, axes, **call).load(), expected)
    bucket = s3fs.S3FileSystem()
    right = bucket.cat_file(f"{BUCKET}/map.zarr/{PACKED}")
    bucket.pipe_file(f"{BUCKET}/map.zarr/{PACKED}", right[:-1])
    xr.testing.assert_identical(pk.open_map(store).load(), expected)
    bucket.pipe_file(f"{BUCKET}/map.zarr/{PACKED}", right)
    bucket.rm_file(f"{BUCKET}/map.zarr/topology/c.1.2")
    ds = pk.open_map(store)
    xr.testing.assert_identical(ds.n_equilibria.load(), expected.n_equilibria)
    with pytest.raises(StoreError, match=r"topology in the tile \[1:2, 2:3\] is gone"):
        ds.topology.load()
    bucket.rm_file(f"{BUCKET}/map.zarr/{PACKED}")
    for verify in (False, True):
        with pytest.raises(StoreError, match="topology"):
            pk.open_map(store, verify=verify)
    with pytest.warns(UserWarning, match=r"the tile \[1:2, 2:3\]"):
        pk.sweep(DISK, axes, **call)
    assert bucket.cat_file(f"{BUCKET}/map.zarr/{PACKED}") == right
    xr.testing.assert_identical(pk.open_map(store, verify=True).load(), expected)
