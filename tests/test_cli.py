"""The command line: what it writes, what it prints, and how it refuses."""

import re
import shlex
import subprocess
import sys

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import phasekit as pk
from phasekit.cli import COMMANDS, common, main
from phasekit.cli.values import between, glue_negative_values, span
from phasekit.labels.units import number

matplotlib.use("Agg")

DISK = ["--beta", "40deg", "--e", "50mm", "--a", "-24mm", "--r", "200 mm", "--omega1", "300rpm"]
RECIPE = """
store = "map.zarr"
of = ["equilibria"]

[parameters]
e = "50 mm"
r = 0.2
omega1 = "300 rpm"

[axes]
beta = { from = "0 deg", to = "90 deg", count = 4 }
a = ["0 mm", "12 mm", 0.024]
"""


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yield
    plt.close("all")


def refused(capsys, *argv):
    """Run a command that must be refused; return its one line."""
    try:
        code = main([str(word) for word in argv])
    except SystemExit as error:
        code = error.code
    err = capsys.readouterr().err
    assert code == 2
    assert err.startswith("phasekit: ")
    assert err.count("\n") == 1
    return err.removeprefix("phasekit: ").strip()


def test_version_and_help_are_quick():
    code = (
        "import sys, runpy; sys.argv = ['phasekit', '--version']\n"
        "from phasekit.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'llvmlite', 'xarray', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout == f"phasekit {pk.__version__}\n"


def test_bare_call_lists_the_commands(capsys):
    assert main([]) == 0
    out = capsys.readouterr().out
    assert all(f"  {name}" in out for name in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    assert f"usage: phasekit {command}" in capsys.readouterr().out


def test_help_lists_the_parameters_of_the_model(capsys):
    with pytest.raises(SystemExit):
        main(["portrait", "--model", "Pendulum", "--help"])
    out = capsys.readouterr().out
    assert "--length" in out
    assert "--beta" not in out


@pytest.mark.slow
def test_demo(tmp_path, capsys):
    assert main(["demo", "--out", "a folder"]) == 0
    out = capsys.readouterr().out
    assert "figure-eight" in out
    assert "folds lie at beta = 54.6111 and 78.9041 deg" in out
    assert (tmp_path / "a folder" / "map.png").read_bytes().startswith(b"\x89PNG")
    ds = pk.open_map("a folder/map.zarr")
    assert set(np.unique(ds.topology)) == {1, 2, 3}
    system = ds.isel(beta=3, a=4).phasekit.system()
    assert system.omega1 == 300 * pk.rpm

    before = (tmp_path / "a folder" / "map.png").read_bytes()
    assert refused(capsys, "demo", "--out", "a folder").startswith("--out: a folder/map.png exists")
    assert main(["demo", "--out", "a folder", "--overwrite"]) == 0
    assert (tmp_path / "a folder" / "map.png").read_bytes() == before
    # What it tells to try next runs.
    lines = capsys.readouterr().out.splitlines()
    commands = [shlex.split(line) for line in lines if line.startswith("  phasekit ")]
    assert [words[1] for words in commands] == ["explore", "portrait", "info"]
    for words in commands:
        more = ["--no-open", "--output", "page.html"] if words[1] == "explore" else []
        assert main([*words[1:], *more]) == 0
    assert "axis beta: 91 values, 0 to 90 deg" in capsys.readouterr().out
    assert (tmp_path / "a folder" / "portrait.png").is_file()


def test_a_command_is_called_as_it_was(tmp_path, monkeypatch):
    script = tmp_path / ".venv" / "bin" / "phasekit"
    script.parent.mkdir(parents=True)
    script.touch(mode=0o755)
    monkeypatch.setattr("sys.argv", [str(script), "demo"])
    monkeypatch.setenv("PATH", "")
    assert common.program() == ".venv/bin/phasekit"
    monkeypatch.chdir(script.parent)
    assert common.program() == "./phasekit"
    monkeypatch.setenv("PATH", str(script.parent))
    monkeypatch.delenv("UV_RUN_RECURSION_DEPTH", raising=False)
    assert common.program() == "phasekit"
    monkeypatch.setattr("sys.argv", ["/somewhere/pytest"])
    assert common.program() == "phasekit"


def test_demo_leaves_other_files_alone(tmp_path, capsys):
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("keep")
    (tmp_path / "notes" / "map.zarr").mkdir()
    (tmp_path / "notes" / "map.zarr" / "mine.txt").write_text("keep")
    refused(capsys, "demo", "--out", "notes")
    assert "is not a map" in refused(capsys, "demo", "--out", "notes", "--overwrite")
    assert (tmp_path / "notes" / "map.zarr" / "mine.txt").read_text() == "keep"
    (tmp_path / "file").write_text("keep")
    assert "is a file" in refused(capsys, "demo", "--out", "file")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_portrait(tmp_path, capsys, suffix):
    assert main(["portrait", *DISK, "--orbit", "-45deg,15deg/s", "--out", f"x.{suffix}"]) == 0
    assert f"wrote x.{suffix}" in capsys.readouterr().out
    assert (tmp_path / f"x.{suffix}").stat().st_size > 10_000


@pytest.mark.slow
def test_the_same_picture_is_the_same_file(tmp_path):
    for suffix in ("svg", "pdf", "png"):
        files = [tmp_path / f"{name}.{suffix}" for name in "ab"]
        for file in files:
            main(["portrait", "--model", "Pendulum", "--length", "0.7", "--out", str(file)])
        assert files[0].read_bytes() == files[1].read_bytes()
        assert b"CreationDate" not in files[0].read_bytes()
        assert b"dc:date" not in files[0].read_bytes()


def test_portrait_with_well_of_another_model(tmp_path):
    argv = ["portrait", "--model", "Reduced", "--lam", "0.4", "--psi", "-0.1", "--well"]
    assert main([*argv, "--angles", "deg", "--out", "x.png"]) == 0
    assert (tmp_path / "x.png").exists()


def test_diagram(tmp_path, capsys):
    argv = ["diagram", "--beta", "0:90deg:61", *DISK[2:], "--y", "energy", "--out", "d.png"]
    assert main(argv) == 0
    assert "wrote d.png" in capsys.readouterr().out
    assert (tmp_path / "d.png").exists()


def test_sweep(tmp_path, capsys):
    (tmp_path / "map.toml").write_text(RECIPE)
    assert main(["sweep", "map.toml"]) == 0
    assert "beta 4 x a 3 cells" in capsys.readouterr().out
    ds = pk.open_map("map.zarr").load()
    disk = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.0, r=0.2, omega1=300 * pk.rpm)
    axes = {"beta": np.array([0.0, 30.0, 60.0, 90.0]) * pk.deg, "a": [0.0, 0.012, 0.024]}
    expected = pk.sweep(disk, axes, of="equilibria")
    assert ds.sizes == expected.sizes
    np.testing.assert_allclose(ds.beta, expected.beta, rtol=1e-15)
    np.testing.assert_array_equal(ds.a, expected.a)
    np.testing.assert_array_equal(ds.n_equilibria, expected.n_equilibria)
    assert "topology" not in ds


@pytest.mark.slow
def test_sweep_goes_on_and_extends(tmp_path, capsys):
    (tmp_path / "map.toml").write_text(RECIPE)
    assert main(["sweep", "map.toml"]) == 0
    (tmp_path / "map.toml").write_text(
        RECIPE.replace('["equilibria"]', '["equilibria", "topology"]').replace("0.024", "0.024, 1")
    )
    assert main(["sweep", "map.toml"]) == 0
    assert "beta 4 x a 4 cells, 9 quantities" in capsys.readouterr().out
    whole = pk.open_map("map.zarr").load()
    assert main(["sweep", "map.toml", "--store", "whole.zarr"]) == 0
    assert pk.open_map("whole.zarr").load().identical(whole)
    (tmp_path / "map.toml").write_text(RECIPE.replace("50 mm", "51 mm"))
    assert "e is 0.05, in the call 0.051" in refused(capsys, "sweep", "map.toml")


def test_sweep_with_every_key(tmp_path, capsys):
    keys = 'chunks = { beta = 2 }\nworkers = 1\ndtype = { period = "float32" }\n[parameters]'
    recipe = RECIPE.replace("[parameters]", f'{keys}\nstate_phi = "10 deg"').replace(
        '["equilibria"]', '["orbits", "n_equilibria"]'
    )
    (tmp_path / "map.toml").write_text(recipe + 'state_dphi = ["0 rpm", "60 rpm"]\n')
    assert main(["sweep", "map.toml"]) == 0
    assert "beta 4 x a 3 x state_dphi 2" in capsys.readouterr().out
    ds = pk.open_map("map.zarr", chunks={})
    assert ds.period.dtype == np.float32
    assert ds.action.chunks[0] == (2, 2)
    assert ds.period.dims == ("beta", "a", "state_dphi")
    assert ds.n_equilibria.dims == ("beta", "a")
    np.testing.assert_array_equal(ds.state_dphi, [0.0, 60 * pk.rpm])
    assert ds.state_phi.item() == 10 * pk.deg


@pytest.mark.slow
def test_sweep_says_beforehand_what_it_takes(tmp_path, capsys, monkeypatch):
    (tmp_path / "map.toml").write_text(RECIPE.replace("count = 4", "count = 10000"))
    assert main(["sweep", "map.toml", "--estimate", "--workers", "2"]) == 0
    out = capsys.readouterr().out
    assert "left: 30,000 cells in 1 tiles, about" in out
    assert re.search(r"MB before compression\) and (less than 1|\d+) s on 1 process", out)
    assert "the disk has" in out
    assert [path.name for path in tmp_path.iterdir()] == ["map.toml"]
    monkeypatch.setattr("phasekit.maps.place.Place.free_bytes", lambda self: 1000)
    assert "the map will not fit: it takes about" in refused(capsys, "sweep", "map.toml")
    assert main(["sweep", "map.toml", "--force"]) == 0
    assert main(["sweep", "map.toml", "--estimate"]) == 0
    assert "nothing is left to compute" in capsys.readouterr().out
    said = refused(capsys, "sweep", "map.toml", "--estimate", "--store", "map.nc")
    assert "--estimate: got 'map.nc' as store, wants a Zarr store" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("in_file", "given", "expected"),
    [
        ("workers = 2", ["--scheduler", "tcp://a:1"], (None, "tcp://a:1")),
        ('scheduler = "tcp://a:1"', ["--workers", "1"], (1, None)),
        ('scheduler = "tcp://a:1"', [], (None, "tcp://a:1")),
    ],
)
def test_who_computes_is_what_the_command_line_says(
    in_file, given, expected, tmp_path, monkeypatch
):
    calls = []

    def watched(*args, **options):
        calls.append((options["workers"], options["client"]))
        return sweep(*args, **{**options, "workers": 1, "client": None})

    sweep = pk.sweep
    monkeypatch.setattr(pk, "sweep", watched)
    (tmp_path / "map.toml").write_text(f"{in_file}\n{RECIPE}")
    assert main(["sweep", "map.toml", *given]) == 0
    assert calls == [expected]


@pytest.mark.slow
def test_info(tmp_path, capsys):
    (tmp_path / "map.toml").write_text(RECIPE)
    for store in ("map.zarr", "map.nc"):
        assert main(["sweep", "map.toml", "--store", store]) == 0
        capsys.readouterr()
        assert main(["info", store]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith(f"{store}: map of GyroRotorDisk, made by phasekit")
        assert lines[1] == "fixed: e = 0.05 m, g = 9.80665 m s-2, omega1 = 31.4159 s-1, r = 0.2 m"
        assert lines[2:4] == [
            "axis beta: 4 values, 0 to 1.5708 rad",
            "axis a: 3 values, 0 to 0.024 m",
        ]
        assert "  n_equilibria       int8     beta x a" in lines
        assert ("1 of 1 tiles are done, 100 %" in "".join(lines)) == (store == "map.zarr")
        assert "on the disk" in lines[-1]
    assert main(["info", "map.zarr", "--units", "beta=deg,e=mm", "--units", "omega1=rpm"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "fixed: e = 50 mm, g = 9.80665 m s-2, omega1 = 300 rpm, r = 0.2 m"
    assert lines[2] == "axis beta: 4 values, 0 to 90 deg"
    assert "beta" in refused(capsys, "info", "map.zarr", "--units", "beta=mm")
    assert "phi" in refused(capsys, "info", "map.zarr", "--units", "phi=deg")
    assert "does not exist" in refused(capsys, "info", "none.zarr")
    (tmp_path / "folder").mkdir()
    assert "cannot be read" in refused(capsys, "info", "folder")


def test_info_of_a_map_that_is_not_finished(tmp_path, capsys):
    store = tmp_path / "map.zarr"
    disk = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.0, r=0.2, omega1=3.0)
    pk.sweep(disk, beta=np.linspace(0.1, 1.5, 90), store=store, chunks=30, of="orbits",
             axes={"state_phi": [0.1], "state_dphi": 0.2})  # fmt: skip
    for index in (0, 2):
        (store / "sweep" / "part0" / f"c.0.{index}").unlink()
    plan = store / "sweep" / "zarr.json"
    plan.write_text(plan.read_text().replace('"complete": true', '"complete": false'))
    assert main(["info", str(store)]) == 0
    out = capsys.readouterr().out
    assert "1 of 3 tiles are done, 33.3 %" in out
    assert "left: 60 cells, about" in out


def test_sweep_never_overwrites_unasked(tmp_path, capsys):
    (tmp_path / "map.toml").write_text(RECIPE)
    (tmp_path / "map.zarr").mkdir()
    (tmp_path / "map.zarr" / "mine.txt").write_text("keep")
    assert "exists" in refused(capsys, "sweep", "map.toml")
    refused(capsys, "sweep", "map.toml", "--overwrite")
    assert (tmp_path / "map.zarr" / "mine.txt").read_text() == "keep"
    assert main(["sweep", "map.toml", "--store", "other.zarr"]) == 0
    assert main(["sweep", "map.toml", "--store", "other.zarr", "--overwrite"]) == 0


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["prtrait"], "unknown command 'prtrait'; wants one of demo, portrait"),
        (["demo", "--output", "x"], "unrecognized arguments"),
        (["portrait", *DISK, "--bta", "3"], "--bta 3; did you mean --beta? See phasekit p"),
        (["portrait", *DISK, "--beta", "40"], "beta: got 40.0, wants a number from 0 to 3.14159"),
        (["portrait", *DISK, "--beta", "40"], "; if it is in degrees: 40deg"),
        (["portrait", *DISK, "--units", "phi"], "--units: got 'phi', wants NAME=UNIT, such as"),
        (["portrait", *DISK, "--units", "phy=deg"], "name in units 'phy' is unknown; did you mean"),
        (["portrait", *DISK, "--units", "phi=mm"], "units: phi: got 'mm', wants rad or deg"),
        (["portrait", *DISK, "--beta", "40mm"], "beta: got '40mm', wants a number in rad or deg"),
        (["portrait", *DISK, "--beta", "steep"], "beta: got 'steep', wants a number in rad"),
        (["portrait", *DISK, "--beta", "nan"], "beta: got 'nan', wants a number"),
        (["portrait", *DISK, "--e", "-1mm"], "e: got -0.001, wants a number >= 0"),
        (["portrait", *DISK, "--beta", "0:1:5"], "--beta: got a range, wants one value"),
        (["portrait", *DISK[2:]], "parameters: got none for --beta, wants"),
        (["portrait", *DISK, "--orbit", "45deg"], "--orbit: got '45deg', wants PHI,DPHI"),
        (["portrait", *DISK, "--orbit", "1,2mm"], "--orbit: got '2mm', wants a number in rad/s"),
        (["portrait", *DISK, "--out", "x.gif"], "--out: got 'x.gif', wants a name that ends in"),
        (["portrait", *DISK, "--out", "no/x.png"], "--out: the folder no does not exist; make it"),
        (["portrait", *DISK, "--out", "there.png"], "--out: there.png exists; choose another"),
        (["portrait", "--model", "Disk"], "model 'Disk' is unknown; "),
        (["portrait", *DISK, "--angles", "grad"], "argument --angles: invalid choice"),
        (
            ["portrait", *DISK, "--e", "1e99999999999999999999"],
            "e: got '1e99999999999999999999', wa",
        ),
        (
            ["portrait", *DISK, "--e", "1e999mm"],
            "e: got '1e999mm', wants a number in m or cm or mm",
        ),
        (["portrait", *DISK, "--e", "9" * 400], "e: got '999"),
        (["portrait", *DISK, "--orbit", "1,1e200"], "orbits: got (1.0, 1e+200), wants pairs"),
        (["portrait", *DISK, "--well", "--orbit", "1,1e200"], "orbits: got (1.0, 1e+200), wants"),
        (["portrait", *DISK, "--out", "~nosuch/x.png"], "--out: got '~nosuch/x.png', but there is"),
        (["portrait", *DISK, "--out", "x\0.png"], "--out: got 'x\\x00.png', wants the name of"),
        (["portrait", *DISK, "--out", ""], "--out: got '', wants the name of"),
        (["demo", "--out", "~nosuch"], "--out: got '~nosuch', but there is no such user"),
        (["demo", "--out", "x\0"], "--out: got 'x\\x00', wants the name of"),
        (["sweep", "~nosuch/map.toml"], "FILE.toml: got '~nosuch/map.toml', but there is no such"),
        (["sweep", "x\0.toml"], "FILE.toml: got 'x\\x00.toml', wants the name of"),
        (["diagram", *DISK], "parameters: got no range, wants exactly one"),
        (["diagram", *DISK, "--m", "1:2:5"], "--m: got a range, but m does not enter the equilibr"),
        (["diagram", *DISK, "--e", "1:2:3", "--r", "1:2:3"], "parameters: got the ranges e, r"),
        (["diagram", *DISK, "--beta", "0:1"], "beta: got '0:1', wants FROM:TO:COUNT"),
        (["diagram", *DISK, "--beta", "0:1:1"], "beta: got '1' as count, wants a whole number"),
        (["diagram", *DISK, "--beta", "0:1:3", "--y", "phy"], "y 'phy' is unknown; did you mean"),
        (["sweep"], "the following arguments are required: FILE.toml"),
        (["sweep", "none.toml"], "none.toml does not exist; name a TOML file"),
        (["sweep", "."], ". is a folder; name a TOML file"),
    ],
)
def test_refusals(tmp_path, capsys, argv, message):
    (tmp_path / "there.png").write_text("keep")
    assert message in refused(capsys, *argv)
    assert [path.name for path in tmp_path.iterdir()] == ["there.png"]
    assert (tmp_path / "there.png").read_text() == "keep"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('store = "map.zarr"', "", "store: got None, wants a name that ends in .zarr or .nc"),
        ('store = "map.zarr"', 'store = "map.csv"', "wants a path that ends in .zarr or .nc"),
        ("[axes]", "[axis]", "map.toml: key 'axis' is unknown; did you mean 'axes'?"),
        ("[axes]", "[axes", "map.toml: not TOML"),
        ("r = 0.2", "", "GyroRotorDisk: missing"),
        ("r = 0.2", "r = true", "r: got True, wants a number in m"),
        ("r = 0.2", "radius = 0.2", "parameters: parameter of GyroRotorDisk 'radius' is unknown"),
        ("r = 0.2", "r = 0.2\na = 1.0", "a: got it in parameters and in axes, wants it once"),
        ("count = 4", "count = 4.5", "beta: got 4.5 as count"),
        ("count = 4", "cuont = 4", "axes: beta: key 'cuont' is unknown; did you mean 'count'"),
        (", count = 4", "", "axes: beta: got {'from': '0 deg', 'to': '90 deg'}, wants"),
        ("count = 4", 'count = 4, spacing = "log"', "beta: got a log range from 0.0"),
        ('"90 deg"', '"90 rpm"', "beta: got '90 rpm', wants a number in rad or deg"),
        ('["0 mm", "12 mm", 0.024]', "[]", "axes: a: got [], wants a list of values"),
        ('of = ["equilibria"]', 'of = ["equilibrium"]', "of: the quantity 'equilibrium' is unkn"),
        ('of = ["equilibria"]', "of = 3", "of: got 3"),
        ("r = 0.2", f"r = {'9' * 400}", "r: got a whole number of 1329 bits"),
        ("r = 0.2", f"r = {'9' * 5000}", "map.toml: not TOML"),
        ("r = 0.2", f"r = {'[' * 5000}", "map.toml: not TOML"),
        ("r = 0.2", "r = nan", "r: got nan, wants a number in m or cm or mm or um, and a finite"),
        ('"90 deg"', "inf", "beta: got inf, wants a number in rad or deg or °, and a finite one"),
        ('["0 mm", "12 mm", 0.024]', "[0.0, nan]", "a: got nan, wants a number in m"),
        ('of = ["equilibria"]', 'model = ["GyroRotorDisk"]', "model ['GyroRotorDisk'] is unknown"),
        ('of = ["equilibria"]', "of = [[1]]", "of: "),
        ('store = "map.zarr"', 'store = "~nosuch/map.zarr"', "store: got '~nosuch/map.zarr', but"),
        (
            'store = "map.zarr"',
            'store = "x\\u0000.zarr"',
            "store: got 'x\\x00.zarr', wants the name",
        ),
        ("[parameters]", "parameters = 3\n[other]", "key 'other' is unknown"),
        ('of = ["equilibria"]', 'model = "Disc"', "model 'Disc' is unknown"),
    ],
)
def test_refused_recipes(tmp_path, capsys, old, new, message):
    assert old in RECIPE
    (tmp_path / "map.toml").write_text(RECIPE.replace(old, new))
    assert message in refused(capsys, "sweep", "map.toml")
    assert [path.name for path in tmp_path.iterdir()] == ["map.toml"]


@pytest.mark.slow
def test_cells_of_forgotten_degrees_are_counted(tmp_path, capsys):
    (tmp_path / "map.toml").write_text(RECIPE.replace('"90 deg"', "90.0"))
    assert main(["sweep", "map.toml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line[:40] for line in lines if "cells are empty" in line] == [
        "9 of 12 cells are empty because their pa"
    ]
    assert main(["diagram", "--beta", "0:40:5", *DISK[2:], "--out", "d.png"]) == 0
    out = capsys.readouterr().out
    assert "4 of 5 cells are empty" in out
    assert "write degrees as 40deg" in out
    assert main(["diagram", "--beta", "0:40deg:5", *DISK[2:], "--out", "e.png"]) == 0
    assert "empty" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_picture_is_replaced_whole_or_not_at_all(tmp_path, capsys, monkeypatch):
    argv = ["portrait", *DISK, "--overwrite", "--out"]
    (tmp_path / "x.png").write_text("keep")
    (tmp_path / "link.png").symlink_to("x.png")

    def full(path, data):
        with open(path, "wb") as file:
            file.write(data[:10])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.write_bytes", full)
        assert "No space left" in refused(capsys, *argv, "x.png")
    assert (tmp_path / "x.png").read_text() == "keep"
    assert main([*argv, "link.png"]) == 0
    assert (tmp_path / "link.png").is_symlink()
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.png", "x.png"]


def test_values_with_units():
    assert number("e", "1.153mm", "m") == 0.001153
    assert number("beta", "30 deg", "rad") == 30 * pk.deg
    assert number("omega1", "-300rpm", "s-1") == -300 * pk.rpm
    assert number("lam", "1e-3", "1") == 1e-3
    assert number("g", "9.81 m/s2", "m s-2") == 9.81
    assert number("a", 2, "m") == 2.0
    for wrong in ("", "mm", "1.2.3", "1 2", "0x10", None, [1], True, "1e", "inf"):
        with pytest.raises(pk.ParameterError, match="^e: got "):
            number("e", wrong, "m")


def test_ranges():
    np.testing.assert_allclose(span("beta", "0:90deg:3", "rad"), [0.0, np.pi / 4, np.pi / 2])
    np.testing.assert_allclose(span("a", "-1cm:20mm:4", "m"), [-0.01, 0.0, 0.01, 0.02], atol=1e-17)
    np.testing.assert_allclose(between("e", "1mm", "1m", 4, "m", "log"), [1e-3, 1e-2, 1e-1, 1.0])
    with pytest.raises(pk.ParameterError, match="wants 'linear' or 'log'"):
        between("e", 1, 2, 3, "m", "cubic")


def test_negative_values_are_not_options():
    assert glue_negative_values(["--a", "-2mm", "-h"]) == ["--a=-2mm", "-h"]
    assert glue_negative_values(["--a=1", "-2"]) == ["--a=1", "-2"]


@pytest.mark.slow
def test_a_fresh_process_knows_every_model():
    code = "import sys; from phasekit.cli import main; sys.exit(main())"
    command = ["portrait", "--model", "Pendulum", "--length", "50cm", "--out", "a.png"]
    done = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "wrote a.png" in done.stdout


@pytest.mark.slow
def test_pictures_take_units(monkeypatch):
    asked = []
    from phasekit import plot

    for name in ("phase_portrait", "bifurcation_diagram"):
        draw = getattr(plot, name)

        def spy(*args, draw=draw, **options):
            asked.append(options["units"])
            return draw(*args, **options)

        monkeypatch.setattr(plot, name, spy)
    assert main(["portrait", *DISK, "--units", "phi=deg,dphi=rpm", "--out", "a.png"]) == 0
    swept = ["--beta", "0:90deg:5", *DISK[2:]]
    units = ["--units", "beta=deg", "--units", "phi=deg"]
    assert main(["diagram", *swept, *units, "--out", "b.png"]) == 0
    assert asked == [{"phi": "deg", "dphi": "rpm"}, {"beta": "deg", "phi": "deg"}]


def test_help_tells_the_units(capsys):
    with pytest.raises(SystemExit):
        main(["portrait", "--help"])
    words = " ".join(capsys.readouterr().out.split())
    assert "a number with a unit, such as 40deg, 5mm or 300rpm" in words
    assert "radius of the disk, m or cm or mm or um" in words


@pytest.mark.slow
def test_basins(tmp_path, capsys):
    argv = ["basins", "--model", "Coefficients", "--A", "1", "--B", "0.35", "--C", "0.12",
            "--damping", "0.2", "--phi", "-180:180deg:41", "--dphi", "-1:1:21"]  # fmt: skip
    assert main([*argv, "--out", str(tmp_path / "x.png")]) == 0
    out = capsys.readouterr().out
    shares = [float(x) for x in re.findall(r"rad: (\S+) \+- ", out)]
    assert len(shares) == 2
    assert sum(shares) == pytest.approx(1.0, abs=2e-4)
    assert (tmp_path / "x.png").exists()
    assert main([*argv, "--forcing", "0.2", "--out", str(tmp_path / "y.png")]) == 2
    assert "--forcing: got '0.2', wants AMPLITUDE,FREQUENCY" in capsys.readouterr().err
    assert main([*argv, "--damping", "0", "--out", str(tmp_path / "y.png")]) == 2
    assert "without damping there are no attractors" in capsys.readouterr().err


@pytest.mark.slow
def test_run_up(tmp_path, capsys):
    argv = ["run-up", "--beta", "1", "--e", "10mm", "--a", "0.1", "--r", "0.1", "--m", "2",
            "--omega1", "0", "--duration", "2"]  # fmt: skip
    done = [*argv, "--half_span", "0.1", "--to", "10", "--out", str(tmp_path / "x.png")]
    assert main(done) == 0
    out = capsys.readouterr().out
    assert len(re.findall(r"bearing [AB]2: at most \d", out)) == 2
    assert main([*argv, "--to", "10", "--out", str(tmp_path / "y.png")]) == 2
    assert "--half_span: got nothing" in capsys.readouterr().err
    assert main([*argv, "--half_span", "0.1", "--out", str(tmp_path / "y.png")]) == 2
    assert "--to: got nothing" in capsys.readouterr().err
