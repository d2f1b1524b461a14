"""Machine code where it is kept: what it holds for, where it lies, and where it cannot lie."""

import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from phasekit.numerics import kept, kernels

PACKAGE = Path(__file__).parents[2] / "phasekit"

#: The message comes once, though many kernels are made; an answer comes, interpreted and compiled.
PROGRAM = """
import os, sys, warnings

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    import numpy as np
    import phasekit as pk
    from phasekit.small import doubled, tripled
    from phasekit.numerics.kernels import QuickForm

    assert pk.__file__.startswith(sys.argv[1]), pk.__file__
    disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
    assert pk.equilibria(disk).n_equilibria.item() == 4
    x = np.arange(3.0)
    doubled(x), tripled(x)
    assert x.tolist() == [0.0, 6.0, 12.0]
    ((kinds, form),) = doubled.forms.items()
    assert isinstance(form, QuickForm) == ("again" not in sys.argv)
    assert doubled.finish(kinds, make=True)
try:
    open(os.path.join(sys.argv[1], "phasekit", "x"), "w")
except OSError:
    pass
else:
    raise SystemExit("this user can write there: nothing is shown")
print(*(str(one.message) for one in caught if "kernels" in str(one.message)), sep="\\n")
"""
SMALL = """
from phasekit.numerics.compile import kernel


@kernel
def doubled(x):
    for i in range(x.size):
        x[i] *= 2.0


@kernel
def tripled(x):
    for i in range(x.size):
        x[i] *= 3.0
"""


def run(folder, temporary, *more):
    """Run the program for a user who can write to temporary files at most, without a compiler."""
    command = [sys.executable, "-c", PROGRAM, str(folder), *more]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        # Root passes over the bits of permissions by capabilities, which it can give away.
        command = [shutil.which("setpriv"), "--bounding-set=-all", "--inh-caps=-all", *command]
    environment = {k: v for k, v in os.environ.items() if k not in (*kept.VARIABLES, "TMPDIR")}
    environment |= {
        "PATH": str(folder),  # in which there are no programs
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
    shutil.copytree(PACKAGE, folder / "phasekit", ignore=shutil.ignore_patterns("*.kernel"))
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
    assert "PHASEKIT_CACHE_DIR" in told
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert len(list(folder.glob("phasekit.small.doubled*.kernel"))) == 2  # quick and finished
    assert run(read_only, tmp_path, "again") == [""]  # a second process need not compile


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


@pytest.fixture
def place(tmp_path):
    """The folder among temporary files that would be used."""
    if os.name == "nt":
        pytest.skip("Windows has no bits of permissions")
    (tmp_path / "temporary").mkdir()
    return tmp_path / "temporary" / f"phasekit-kernels-{os.geteuid()}"


@pytest.mark.parametrize("planted", [link, open_to_others, file, of_another_user, replaceable])
def test_a_folder_that_others_could_write_to_is_not_used(tmp_path, place, planted, monkeypatch):
    """What lies there would be run."""
    monkeypatch.setattr(tempfile, "tempdir", str(place.parent))
    assert kept._private_folder() == place
    place.rmdir()
    planted(place, tmp_path / "elsewhere")
    assert kept._private_folder() is None


@pytest.mark.slow
@pytest.mark.parametrize("planted", [link, sealed])
def test_without_a_place_each_process_compiles_and_that_is_said(
    read_only, tmp_path, place, planted
):
    planted(place, tmp_path / "elsewhere")
    (told,) = run(read_only, place.parent)
    assert "each process compiles its kernels anew" in told
    assert not [path for path in tmp_path.rglob("*") if path.suffix == ".kernel"]


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A module with a kernel that calls a routine of another one, and a folder for machine code."""
    monkeypatch.setenv("PHASEKIT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(kept, "_told", False)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # it is told apart by seconds alone
    monkeypatch.syspath_prepend(tmp_path)

    def write(factor="2.0", constant="3.0"):
        head = "from phasekit.numerics.compile import kernel, routine\n"
        (tmp_path / "small_inner.py").write_text(
            f"{head}MORE = {constant}\n@routine\ndef times(x):\n    return {factor} * x\n"
        )
        (tmp_path / "small_outer.py").write_text(
            f"{head}import small_inner\nfrom small_inner import times\n"
            "@kernel\ndef scaled(x):\n    return times(x) + small_inner.MORE\n"
        )
        for name in ("small_outer", "small_inner"):
            sys.modules.pop(name, None)
        import small_outer

        return small_outer.scaled

    yield write
    for name in ("small_outer", "small_inner"):
        sys.modules.pop(name, None)


def made(kernel):
    """What a kernel returns for 5, and how many files were written meanwhile."""
    folder = next(kept.folders())
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*.kernel")}
    result = kernel(5.0)
    after = {path: path.stat().st_mtime_ns for path in folder.glob("*.kernel")}
    return result, sum(before.get(path) != time for path, time in after.items())


def test_machine_code_holds_for_what_it_was_made_from(small, monkeypatch):
    """A file that a kernel calls into, or a constant there, makes another kernel of it."""
    assert made(small()) == (13.0, 1)
    assert made(small()) == (13.0, 0)
    assert made(small(factor="4.0")) == (23.0, 1)
    assert made(small(factor="4.0", constant="1.0")) == (21.0, 1)
    scaled = small(factor="4.0", constant="1.0")
    monkeypatch.setattr(sys.modules["small_inner"], "MORE", 10.0)
    assert made(scaled) == (30.0, 1)  # as the interpreter would say
    assert scaled.py_func(5.0) == 30.0


@pytest.mark.parametrize("damage", ["cut", "changed", "empty", "other"])
def test_damaged_files_are_made_again(small, damage):
    assert made(small()) == (13.0, 1)
    (path,) = next(kept.folders()).glob("*.kernel")
    content = path.read_bytes()
    damaged = {
        "cut": content[: len(content) // 2],
        "changed": content[:-9] + bytes([content[-9] ^ 1]) + content[-8:],
        "empty": b"",
        "other": b"\x80" * 1000,
    }[damage]
    path.write_bytes(damaged)
    assert made(small()) == (13.0, 1)
    assert path.read_bytes() == content


def test_nothing_that_goes_wrong_while_machine_code_is_kept_stops_a_call(small, monkeypatch):
    def full(*args, **keywords):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept.tempfile, "mkstemp", full)
    scaled = small()
    with pytest.warns(RuntimeWarning, match="anew.*No space left on device"):
        assert scaled(5.0) == 13.0
    assert scaled(6) == 15.0  # by another form: nothing more is said, which would be an error here
    assert not list(next(kept.folders()).glob("*"))


def test_what_quick_forms_take_counts_over_processes(small, monkeypatch):
    """So what is used a little by many processes is finished, too."""

    def form_of(kernel):
        kernels._seconds_before.cache_clear()  # as another process has it
        assert kernel(5.0) == 13.0
        (form,) = kernel.forms.values()
        return form

    kept.add_seconds({"other.kernel": 1.0})  # there is no such file
    form = form_of(small())
    assert isinstance(form, kernels.QuickForm)
    assert form.cost == kernels.LEAST  # not that of all kernels
    for part in (0.5, 0.6):
        form.spent += part * form.cost
        kernels.remember()
        kernels.remember()  # nothing counts twice
        (known,) = kept.seconds_of().values()
        last, form = form, form_of(small())
    assert known == pytest.approx(last.spent, rel=1e-12)
    assert not isinstance(form, kernels.QuickForm)
    for damage in (b"", b"[]", b'{"a": []}', b'{"a": 1' + b"0" * 400 + b"}"):
        (next(kept.folders()) / kept._SECONDS).write_bytes(damage)
        assert kept.seconds_of() == {}
    monkeypatch.setattr(kept, "_replace", lambda *args: 1 / 0)
    kernels.remember()  # there is nothing to be kept


def test_arrays_are_told_apart_by_what_they_hold():
    from phasekit.numerics.compiler.module import constant_digest

    one = np.arange(4.0)
    others = one.reshape(2, 2), one.astype(int), one + 1e-300 + (one == 0.0) * 5e-324, -one
    assert len({constant_digest(x) for x in (one, *others)}) == 5
    assert constant_digest(one) == constant_digest(one.copy())
    assert constant_digest(0.0) != constant_digest(-0.0) != constant_digest(0)
