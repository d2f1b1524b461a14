"""Kernels where numba finds no place to keep them: in a private folder, or in no file at all."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "phasekit"

#: The message comes once, though many kernels are made; an answer comes, interpreted and compiled.
PROGRAM = """
import os, sys, warnings

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    import numpy as np
    import phasekit as pk
    from phasekit.small import doubled

    assert pk.__file__.startswith(sys.argv[1]), pk.__file__
    disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
    assert pk.equilibria(disk).n_equilibria.item() == 4
    x = np.arange(3.0)
    doubled(x)
    assert x.tolist() == [0.0, 2.0, 4.0] and doubled.signatures
    assert not doubled.stats.cache_hits or "again" in sys.argv
    assert doubled.stats.cache_hits or "again" not in sys.argv
try:
    open(os.path.join(sys.argv[1], "phasekit", "x"), "w")
except OSError:
    pass
else:
    raise SystemExit("this user can write there: nothing is shown")
print(*(str(one.message) for one in caught if "numba" in str(one.message)), sep="\\n")
"""
SMALL = """
from phasekit.numerics.compile import kernel


@kernel
def doubled(x):
    for i in range(x.size):
        x[i] *= 2.0
"""


def run(folder, temporary, *more):
    """Run the program for a user who can write to temporary files at most."""
    command = [sys.executable, "-c", PROGRAM, str(folder), *more]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        # Root passes over the bits of permissions by capabilities, which it can give away.
        command = ["setpriv", "--bounding-set=-all", "--inh-caps=-all", *command]
    environment = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "TMPDIR")}
    environment |= {
        "HOME": str(folder),
        "XDG_CACHE_HOME": str(folder / "cache"),
        "MPLCONFIGDIR": str(folder / "mpl"),
        "TMPDIR": str(temporary),
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=folder)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def read_only(tmp_path_factory):
    """Return a folder with the package that the user who runs the tests cannot write to."""
    if os.name == "nt":
        pytest.skip("Windows has no bits of permissions")
    if os.geteuid() == 0:
        probe = ["setpriv", "--bounding-set=-all", "--inh-caps=-all", "true"]
        if not shutil.which("setpriv") or subprocess.run(probe, capture_output=True).returncode:
            pytest.skip("root passes over permissions, and cannot give that up here: no setpriv")
    folder = tmp_path_factory.mktemp("home")
    shutil.copytree(PACKAGE, folder / "phasekit", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "phasekit" / "small.py").write_text(SMALL)
    folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    for path in folders:
        path.chmod(0o555)
    yield folder
    for path in folders:
        path.chmod(0o755)


@pytest.mark.slow
def test_kernels_are_kept_in_a_private_folder_of_temporary_files(read_only, tmp_path):
    (told,) = run(read_only, tmp_path)
    (folder,) = tmp_path.iterdir()
    assert f"compiled kernels are kept in {folder}" in told
    assert "NUMBA_CACHE_DIR" in told
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert len(list(folder.rglob("small.doubled*.nbc"))) == 1
    (again,) = run(read_only, tmp_path, "again")  # a second process need not compile
    assert again == told


def link(place, elsewhere):
    elsewhere.mkdir(mode=0o700)
    place.symlink_to(elsewhere)


def open_to_others(place, elsewhere):
    place.mkdir()
    place.chmod(0o750)


def file(place, elsewhere):
    place.write_text("")


def of_another_user(place, elsewhere):
    if os.geteuid():
        pytest.skip("only root can give a folder away")
    place.mkdir(mode=0o700)
    os.chown(place, 65534, 65534)


def replaceable(place, elsewhere):
    place.mkdir(mode=0o700)
    place.parent.chmod(0o777)


def sealed(place, elsewhere):
    place.mkdir(mode=0o500)


@pytest.mark.slow
@pytest.mark.parametrize(
    "planted", [link, open_to_others, file, of_another_user, replaceable, sealed]
)
def test_a_folder_that_others_could_write_to_is_not_used(read_only, tmp_path, planted):
    """What lies there would be run."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    place, elsewhere = temporary / f"phasekit-kernels-{os.geteuid()}", tmp_path / "elsewhere"
    planted(place, elsewhere)
    (told,) = run(read_only, temporary)
    assert "each process compiles its kernels anew" in told
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".nbi", ".nbc")]


def test_nothing_that_goes_wrong_while_kernels_are_kept_or_looked_for_stops_a_call(monkeypatch):
    from functools import partial

    from numba import njit

    from phasekit.numerics import cache

    monkeypatch.setattr(cache, "_told", False)

    class Broken:
        def save_overload(self, signature, data):
            raise OSError(28, "No space left on device")

        def load_overload(self, signature, target):
            raise EOFError("Ran out of input")

    def compiler(function, cache):
        dispatcher = partial(njit, nogil=True)(function)
        dispatcher._cache = Broken()
        return dispatcher

    made = cache.kept(compiler, lambda x: x + 1)
    with pytest.warns(RuntimeWarning, match="cannot be read: Ran out of input"):
        assert made(1) == 2
    assert made(1.5) == 2.5  # nothing more is said, which would be an error here
