"""The recipes of the documentation run as they stand, and their results are right."""

import csv
import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import phasekit as pk
from phasekit.maps import run as maps_run

matplotlib.use("Agg")
PAGE = (Path(__file__).parents[1] / "docs" / "recipes.md").read_text(encoding="utf-8")
HEAD, *PARTS = re.split(r"^## ", PAGE, flags=re.MULTILINE)
BLOCKS = {}
for part in PARTS:
    title, _, text = part.partition("\n")
    (BLOCKS[title],) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
(START,) = re.findall(r"```python\n(.*?)```", HEAD, re.DOTALL)
TITLES = list(BLOCKS)
SECOND_CENTER, DIAGRAM, MAP, PERIOD, LOOP, POTENTIAL, HOPF, PORTRAITS, FORCE, LARGE = TITLES[:10]
NEURON, FORCED, TIPPING, RING, FOXES = TITLES[10:15]


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECIPE_SIDE", "60")
    yield
    plt.close("all")


def run(*titles):
    """The names that recipes make."""
    names = {"__name__": "recipe"}
    exec(START, names)
    for title in titles:
        exec(compile(BLOCKS[title], f"recipes.md: {title}", "exec"), names)
    return names


def test_a_second_center():
    names = run(SECOND_CENTER)
    said = float(re.search(r"# ([\d.]+) rpm", BLOCKS[SECOND_CENTER])[1])
    assert names["speed"] == pytest.approx(said, abs=0.05)
    counts = [int(pk.equilibria(names[name]).n_equilibria) for name in ("below", "above")]
    assert counts == [2, 4]


def test_b_diagram_in_rpm():
    names = run(SECOND_CENTER, DIAGRAM)
    axes = names["ax"]
    assert "(rpm)" in axes.get_xlabel()
    assert "(°)" in axes.get_ylabel()
    counts = names["ds"].n_equilibria
    first = names["ds"].omega1[int(np.argmax(counts.values == 4))].item() / pk.rpm
    assert first - 1 < names["speed"] <= first
    # The upper branches begin at the line.
    starts = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) > 10]
    assert len(starts) >= 2


@pytest.mark.slow
def test_c_best_cell(capsys):
    names = run(MAP)
    peak, best = names["peak"], names["best"]
    assert np.isfinite(peak).all()
    assert peak.sel(beta=best.beta, omega1=best.omega1).item() == float(peak.min())
    loads = pk.separatrices(best.phasekit.system()).phasekit.bearing_forces(on="separatrix")
    assert float(loads.peak_force.max()) == pytest.approx(float(peak.min()), rel=1e-9)
    assert capsys.readouterr().out == f"{best.phasekit.system()}\n"


def test_d_period_against_amplitude():
    run(PERIOD)
    with open("period.csv", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["amplitude (deg)", "period (ms)"]
    amplitude, period = np.array(rows, float).T
    assert len(rows) == 81
    assert (np.diff(period[2:]) > 0).all()
    # The same lines for a pendulum, whose period is an elliptic integral.
    names = {"pk": pk, "np": np, "disk": pk.Pendulum(length=0.5, g=10.0)}
    exec(BLOCKS[PERIOD], names)
    amplitude, period = names["table"][["amplitude (deg)", "period (ms)"]].values.T
    wanted = 4e3 / np.sqrt(20.0) * ellipk(np.sin(np.radians(amplitude) / 2) ** 2)
    np.testing.assert_allclose(period, wanted, rtol=1e-12)


@pytest.mark.slow
def test_e_hysteresis_loop():
    names = run(LOOP)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    wanted = 2.0 * (c ** (2 / 3) + s ** (2 / 3)) ** -1.5
    np.testing.assert_allclose(names["switching"], [wanted, wanted], rtol=1e-14)


def test_f_potential():
    names = run(POTENTIAL)
    roots = np.sort(np.roots([1.0, 0.0, -1.0, 0.1]).real)
    np.testing.assert_allclose(names["places"].phi, roots, rtol=1e-13)
    assert bool(names["places"].complete)
    well, period = names["well"], names["period"]
    half = pk.flow(well, 1.2, 0.0, [period / 2, period])
    np.testing.assert_allclose(half.motion_dphi, 0.0, atol=1e-9)
    assert half.motion_phi.values[1] == pytest.approx(1.2, rel=1e-11)


def test_g_hopf_point_and_curve():
    names = run(HOPF)
    hopf, curve = names["hopf"], names["curve"]
    assert (hopf.kind, hopf.status) == ("hopf", "converged")

    def current(b):  # the trace 1 - v^2 - 0.08 b vanishes
        v = -np.sqrt(1.0 - 0.08 * b)
        return (v + 0.7) / b - v + v**3 / 3

    assert hopf["current"] == pytest.approx(current(0.8), rel=1e-10)
    b = curve.points.b.values
    near = curve.points.v.values < 0
    assert near.sum() > 5
    np.testing.assert_allclose(curve.points.current.values[near], current(b[near]), rtol=1e-8)
    assert b.min() == pytest.approx(0.3)
    assert b.max() == pytest.approx(1.2)


def test_h_two_portraits():
    left, right = run(PORTRAITS)["axes"]
    assert left.get_ylim() == right.get_ylim()
    assert left.lines
    assert right.lines
    assert (left.get_title(), right.get_title()) == ("β = 40°", "β = 75°")


@pytest.mark.slow
def test_i_force_in_time_and_animation():
    names = run(FORCE)
    loaded, motion, force = names["loaded"], names["motion"], names["force"]
    orbit = pk.orbits(loaded, names["start"], 0.0)
    assert orbit.orbit_kind == pk.OrbitKind.LIBRATION
    # Just inside, so that it takes longer than small oscillations.
    assert orbit.period.item() > 2 * 2 * np.pi / pk.equilibria(loaded).natural_frequency.max()
    k = 17
    phi, dphi = motion.motion_phi.values[k], motion.motion_dphi.values[k]
    alone = pk.bearing_forces(loaded, phi, dphi).force_magnitude.sel(bearing="A2").item()
    assert force.values[k] == pytest.approx(alone, rel=1e-12)
    assert Path("motion.gif").read_bytes().startswith(b"GIF8")


@pytest.mark.slow
def test_j_large_map(monkeypatch, capsys):
    done, finish = [], maps_run.Tally.finish

    def stopped(self, tile):
        finish(self, tile)
        done.append(tile)
        if len(done) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(maps_run.Tally, "finish", stopped)
    names = run(LARGE)
    out = capsys.readouterr().out
    count, total = map(int, re.match(r"(\d+) of (\d+) tiles are done", out).groups())
    assert 3 <= count < total
    assert len(done) == 3 + total - count  # nothing was computed twice
    ds = names["ds"]
    whole = pk.sweep(
        names["disk"],
        beta=ds.beta.values,
        a=ds.a.values,
        of=("n_equilibria", "topology", "fold_margin"),
    )
    for name in whole.data_vars:
        np.testing.assert_array_equal(ds[name], whole[name])
    assert 0.0 < names["share"] < 1.0
    assert int(re.search(r'"RECIPE_SIDE", (\d+)', BLOCKS[LARGE])[1]) ** 2 >= 10**7


@pytest.mark.slow
def test_k_neuron():
    """The values of MatCont's Morris-Lecar neuron."""
    names = run(NEURON)
    found = [names[name].parameters["I"] for name in ("ignites", "ceases", "starts", "ends")]
    np.testing.assert_allclose(found, [93.85762, 212.01882, 88.29325, 216.8998], rtol=1e-6)
    at = int(np.argmin(np.abs(names["firing"].points.I.values - 150.0)))
    assert 5.0 < names["rate"][at].item() < 30.0


@pytest.mark.slow
def test_l_forced_oscillator():
    """Against SciPy's motion, whose third harmonic is a sum over a period."""
    from scipy.integrate import solve_ivp

    names = run(FORCED)
    w = 0.55
    period = 2 * np.pi / w
    t = 60 * period + period * np.arange(400) / 400
    x = solve_ivp(
        lambda t, x: [x[1], np.cos(w * t) - 0.1 * x[1] - x[0] - x[0] ** 3], (0, t[-1]), [0, 0],
        t_eval=t, rtol=1e-10, atol=1e-12,
    ).y[0]  # fmt: skip
    for k in (1, 2, 3):
        size = 2 * abs(np.mean(x * np.exp(-1j * k * w * t)))
        found = names["harmonics"].amplitude_x.sel(harmonic=k).item()
        assert found == pytest.approx(size, abs=1e-6)
    assert names["lines"].amplitude_x.dims == ("w", "frequency")


@pytest.mark.slow
def test_m_tipping():
    """The share that tips early, by Euler's steps in NumPy."""
    names = run(TIPPING)
    assert names["limit"] == pytest.approx(2 / (3 * np.sqrt(3)), rel=1e-9)
    rng = np.random.default_rng(1)
    x, h = np.full(1000, -1.0), 0.02
    tipped = np.zeros(1000, bool)
    for k in range(int(names["limit"] / 0.002 / h)):
        x += h * (x - x**3 + 0.002 * k * h) + np.sqrt(0.02 * h) * rng.standard_normal(1000)
        tipped |= x > 0.5
    share = tipped.mean()
    assert 0.02 < share < 0.98
    error = np.sqrt(share * (1 - share) * (1 / 800 + 1 / 1000))
    assert names["early"] == pytest.approx(share, abs=4 * error)


@pytest.mark.slow
def test_firing_that_starts_from_zero():
    names = run(RING)
    assert names["fold"] == pytest.approx(1.0, abs=1e-12)
    omega = 1.0 + names["distance"]
    np.testing.assert_allclose(
        names["turning"].period, 2 * np.pi / np.sqrt(omega**2 - 1), rtol=1e-9
    )
    assert names["slope"] == pytest.approx(-0.5, abs=0.01)


@pytest.mark.slow
def test_prey_and_predators():
    names = run(FOXES)
    assert names["drift"] < 1e-8
    period = names["period"].values
    assert np.all(np.diff(period) > 0.0)
    for i, (x, y) in enumerate(zip(*names["start"].values(), strict=True)):
        around = solve_ivp(
            lambda t, u: [u[0] * (1 - 0.5 * u[1]), u[1] * (0.25 * u[0] - 0.75), *u[:2]],
            (0.0, period[i]), [x, y, 0.0, 0.0], rtol=1e-11, atol=1e-12,
        ).y[:, -1]  # fmt: skip
        np.testing.assert_allclose(around, [x, y, 3 * period[i], 2 * period[i]], rtol=1e-7)
    assert period.min() > 2 * np.pi / np.sqrt(0.75)  # that of small oscillations
