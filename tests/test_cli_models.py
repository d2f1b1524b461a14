"""The command line on files of models: TOML tables of equations and .ode files."""

import csv
import warnings
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from test_cli import refused

import phasekit as pk
from phasekit.cli import main
from phasekit.cli.common import windowed
from phasekit.cli.models import read_file

matplotlib.use("Agg")
ODE = Path(__file__).parent / "data" / "ode"
SPRING = """
duration = 3
count = 31

[rates]
x = "v"
v = "-k*x - d*v"

[parameters]
k = 4
d = "0 rpm"

[units]
x = "m"
d = "s-1"

[long_names]
k = "stiffness over mass"

[start]
x = 1
v = 0

[window]
x = [-2, 2]
v = [-3, 3]

[definitions]
energy = "v^2/2 + k*x^2/2"

[observables]
E = "energy"
"""
WELL = """
potential = "x^4/4 - mu*x^2/2"
store = "well.zarr"
of = ["equilibria"]

[parameters]
mu = 1

[axes]
mu = [-1, 4]
"""


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spring.toml").write_text(SPRING)
    (tmp_path / "well.toml").write_text(WELL)
    yield
    plt.close("all")


def columns(name):
    with open(name) as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def test_a_motion_as_numbers(capsys):
    assert main(["flow", "spring.toml", "--out", "m.csv"]) == 0
    assert "wrote m.csv" in capsys.readouterr().out
    found = columns("m.csv")
    np.testing.assert_allclose(found["time"], np.linspace(0.0, 3.0, 31))
    np.testing.assert_allclose(found["motion_x"], np.cos(2 * found["time"]), atol=1e-9)
    np.testing.assert_allclose(found["motion_E"], 2.0, rtol=1e-9)
    argv = ["flow", "spring.toml", "--k", "1:9:3", "--set", "d=0", "--start", "v=3,x=0"]
    assert main([*argv, "--to", "1", "--count", "2", "--out", "m.csv", "--overwrite"]) == 0
    found = columns("m.csv")
    last = found["time"] == 1.0
    rates = np.sqrt(found["k"][last])
    np.testing.assert_allclose(rates**2, [1.0, 5.0, 9.0])
    np.testing.assert_allclose(found["motion_x"][last], 3 * np.sin(rates) / rates, atol=1e-9)


def test_paths_with_noise(tmp_path, capsys):
    (tmp_path / "walk.toml").write_text('[rates]\nx = "0"\n[noise]\nx = 1\n[start]\nx = 0\n')
    argv = ["flow", "walk.toml", "--to", "1", "--count", "2", "--paths", "3", "--seed", "1"]
    assert main([*argv, "--out", "w.csv"]) == 0
    found = columns("w.csv")
    walk = pk.Problem("0", "x", noise={"x": 1.0})
    expected = pk.flow(walk, 0.0, [0.0, 1.0], paths=3, seed=1).motion_x.transpose("path", "time")
    order = np.lexsort((found["time"], found["path"]))
    np.testing.assert_allclose(found["motion_x"][order], expected.values.ravel())
    assert "wants nothing without --paths" in refused(
        capsys, "flow", "walk.toml", "--to", "1", "--seed", "1"
    )


@pytest.mark.slow
def test_pictures(tmp_path):
    membrane = str(ODE / "membrane.ode")
    assert (
        main(["portrait", membrane, "--Iapp", "0.1", "--orbit", "-.3,0.1", "--out", "p.png"]) == 0
    )
    assert main(["flow", membrane, "--y", "V,I_ca", "--out", "f.svg"]) == 0
    assert main(["portrait", "well.toml", "--mu", "2", "--well", "--out", "w.png"]) == 0
    assert main(["diagram", "well.toml", "--mu", "-1:2:31", "--out", "w.pdf"]) == 0
    assert all((tmp_path / name).stat().st_size > 5_000 for name in ("p.png", "f.svg", "w.png"))


@pytest.mark.slow
def test_diagram_of_equations_names_what_is_on_it(tmp_path, capsys):
    (tmp_path / "normal.toml").write_text(
        '[rates]\nx = "m*x - y - x*(x^2 + y^2)"\ny = "x + m*y - y*(x^2 + y^2)"\n'
        "[parameters]\nm = -1\n[window]\nx = [-2, 2]\ny = [-2, 2]\n"
    )
    assert main(["diagram", "normal.toml", "--m", "-1:1", "--out", "d.png"]) == 0
    assert "H at m = 0:" in capsys.readouterr().out.replace("-0:", "0:")
    asked = ["diagram", "normal.toml", "--m", "-1:1", "--cycles", "--out", "c.png"]
    assert main(asked) == 0
    assert "H at m = 0:" in capsys.readouterr().out.replace("-0:", "0:")
    assert (tmp_path / "c.png").stat().st_size > 5_000


@pytest.mark.slow
def test_atlas_of_equations(tmp_path, capsys):
    (tmp_path / "cusp.toml").write_text(
        '[rates]\nx = "m + n*x - x^3"\n[parameters]\nm = 0\nn = 0\n[window]\nx = [-3, 3]\n'
    )
    assert main(["atlas", "cusp.toml", "--m", "-1:1", "--n", "-1:2", "--out", "a.png"]) == 0
    said = capsys.readouterr().out
    assert "CP cusp at" in said
    assert "proved off the curves: n_equilibria, n_stable" in said
    assert Path("a.png").exists()
    assert "exactly two FROM:TO" in refused(capsys, "atlas", "cusp.toml", "--m", "-1:1")


def test_a_map_of_a_file(capsys):
    assert main(["sweep", "well.toml"]) == 0
    ds = pk.open_map("well.zarr")
    assert ds.n_equilibria.values.tolist() == [1, 3]
    np.testing.assert_allclose(ds.phi.values[1], [-2.0, 0.0, 2.0], atol=1e-12)
    Path("other.toml").write_text(
        'model = "well.toml"\nstore = "o.zarr"\nof = ["equilibria"]\n[axes]\nmu = [1, 9]\n'
    )
    assert main(["sweep", "other.toml"]) == 0
    np.testing.assert_allclose(pk.open_map("o.zarr").phi[1], [-3.0, 0.0, 3.0], atol=1e-12)


def test_what_a_file_says():
    found = read_file(Path("spring.toml"))
    assert (found.duration, found.times) == (3.0, 31)
    system = found.system
    assert system.unit_of("x") == "m"
    assert system.parameters == {"k": 4.0, "d": 0.0}
    assert [p.long_name for p in system.declared] == ["stiffness over mass", "parameter d"]
    found = read_file(ODE / "membrane.ode")
    assert (found.duration, found.times) == (30.0, 601)
    Path("rotor.toml").write_text('model = "Pendulum"\n[parameters]\nlength = "50 cm"\n')
    assert read_file(Path("rotor.toml")).system == pk.Pendulum(length=0.5)
    Path("turn.toml").write_text(
        'step = { phi = "phi + w - K*sin(phi)" }\nperiods = { phi = "2*pi" }\n'
        "parameters = { w = 0.3, K = 0.5 }\n"
    )
    turn = read_file(Path("turn.toml")).system
    assert turn.map
    assert turn.periods["phi"] == 2 * np.pi


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "got nothing, wants one of rates, step, potential, model"),
        ("[equations]\nx = '-x'", "got 'equations', wants one of rates, step, potential, model"),
        ('potential = "x^2"\nrates = { x = "1" }', "got rates and potential, wants one of"),
        ('rates = { x = "-k*x" }', "unknown symbol k"),
        ('rates = { x = "1" }\nparametres = { k = 1 }', "key 'parametres' is unknown"),
        ('rates = "x"', "rates: got 'x', wants a table [rates]"),
        ('rates = { x = "1" }\nduration = -1', "duration: got -1, wants a number > 0"),
        ('rates = { x = "1" }\ncount = 1', "count: got 1, wants a whole number >= 2"),
        ('rates = { x = "1" }\nunits = { x = 3 }', "units: x: got 3, wants a text"),
        ('rates = { x = "1" }\nunits = { z = "m" }', "words: name 'z' is unknown"),
        ('rates = { x = "-k*x" }\nparameters = { k = "a" }', "k: got 'a', wants a number"),
        ('rates = { x = "1" }\nwindow = { x = [2, 1] }', "window['x']"),
        ('rates = { x = "import os" }', "f: got"),
        ("rates = {", "not TOML"),
        ('model = "Nothing"', "model 'Nothing' is unknown"),
        (
            'model = "Pendulum"\nparameters = { mass = 1 }',
            "parameter of Pendulum 'mass' is unknown",
        ),
    ],
)
def test_files_that_say_no_model(capsys, text, said):
    Path("bad.toml").write_text(text)
    assert said in refused(capsys, "flow", "bad.toml")


def test_calls_that_are_wrong(capsys):
    assert "wants a name that ends in .toml or .ode" in refused(capsys, "flow", "spring.txt")
    assert "does not exist" in refused(capsys, "portrait", "none.toml")
    assert "does not exist" in refused(capsys, "portrait", "none.ode")
    assert "--start: got no phi, dphi" in refused(capsys, "flow", "well.toml", "--to", "1")
    assert "--to: got nothing" in refused(capsys, "flow", "well.toml", "--start", "1,0")
    assert "wants X,V or NAME=VALUE" in refused(capsys, "flow", "spring.toml", "--start", "1")
    assert "state 'y' is unknown" in refused(capsys, "flow", "spring.toml", "--start", "y=1,x=1")
    assert "--set: got 'q=1'" in refused(capsys, "flow", "spring.toml", "--set", "q=1")
    assert "unrecognized arguments: --q" in refused(capsys, "flow", "spring.toml", "--q", "1")
    assert "got no range, wants exactly one FROM:TO" in refused(capsys, "diagram", "spring.toml")
    assert "wants FROM < TO" in refused(capsys, "diagram", "spring.toml", "--k", "3:1")
    assert "wants equations" in refused(capsys, "diagram", "well.toml", "--cycles", "--mu", "0:1:3")


def test_warnings_are_said_in_a_line(monkeypatch):
    said = []

    def run(_):
        said.append(warnings.formatwarning(UserWarning("no\n  way"), UserWarning, "f.py", 1))

    monkeypatch.setattr("phasekit.cli.flow.run", run)
    before = warnings.formatwarning
    assert main(["flow", "spring.toml"]) == 0
    assert said == ["phasekit: warning: no way\n"]
    assert warnings.formatwarning is before


def test_where_to_look_without_a_window(capsys):
    Path("spiral.toml").write_text('rates = { x = "y", y = "-x - y" }\n')
    said = refused(capsys, "portrait", "spiral.toml")
    assert "--window x=-1:1,y=-1:1" in said
    assert "Problem(" not in said
    assert "state 'z' is unknown" in refused(capsys, "portrait", "spiral.toml", "--window", "z=0:1")
    assert "NAME=FROM:TO" in refused(capsys, "portrait", "spiral.toml", "--window", "x=1")
    assert "FROM < TO" in refused(capsys, "portrait", "spiral.toml", "--window", "x=1:0")
    twice = refused(capsys, "portrait", "spiral.toml", "--window", "x=0:1,x=0:2")
    assert "--window: got x twice" in twice
    assert "--window" in refused(capsys, "portrait", "well.toml", "--window", "x=0:1")
    Path("decay.toml").write_text('rates = { x = "-x" }\n')
    assert "phasekit diagram" in refused(capsys, "portrait", "decay.toml", "--window", "x=0:1")
    # x = cos t, y = -sin t: the circle, and a margin; an asked range stays as it is.
    turn = pk.Problem({"x": "y", "y": "-x"}, start={"x": 1.0, "y": 0.0})
    window = windowed(turn, SimpleNamespace(window=["y=-3:2"])).window
    assert window["y"] == (-3.0, 2.0)
    np.testing.assert_allclose(window["x"], [-1.4, 1.4], atol=1e-3)
    # From a rest that repels a motion beside it shows the cycle of radius 1.
    rest = pk.Problem(
        {"x": "x - y - x*(x^2 + y^2)", "y": "x + y - y*(x^2 + y^2)"}, start={"x": 0.0, "y": 0.0}
    )
    window = windowed(rest, SimpleNamespace(window=[])).window
    np.testing.assert_allclose([window["x"], window["y"]], [[-1.4, 1.4]] * 2, atol=0.01)
