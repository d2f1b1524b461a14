"""The worked examples of the contributing guide run as they stand, and do what they say."""

import json
import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import phasekit as pk
from phasekit.bifurcation import special_points
from phasekit.bifurcation.special_points import KINDS
from phasekit.cells.request import ask
from phasekit.laws.ladder import Conservative
from phasekit.maps.options import StoreOptions
from phasekit.maps.place import place_of
from phasekit.maps.run import sweep_into
from phasekit.systems.registry import models
from phasekit.systems.system import MODELS
from phasekit.systems.term import TERMS
from phasekit.table import quantities
from phasekit.table.row import Pass, Quantity

matplotlib.use("Agg")
GUIDE = Path(__file__).parents[1] / "docs" / "contributing.md"
SECTIONS = dict(
    re.findall(
        r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", GUIDE.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
)


@pytest.fixture(autouse=True)
def registries(monkeypatch):
    """The tables and registries as they were before."""
    known, rows = dict(models()), dict(quantities.ROWS)
    monkeypatch.setattr(quantities.TABLE, "passes", quantities.TABLE.passes)
    kinds, terms = dict(KINDS), dict(TERMS)
    monkeypatch.setattr(special_points, "TESTS", list(special_points.TESTS))
    yield
    every = ((MODELS, known), (TERMS, terms), (quantities.ROWS, rows), (KINDS, kinds))
    for registry, before in every:
        registry.clear()
        registry.update(before)
    plt.close("all")


def run(heading):
    """The names that the examples of a section make, each of which runs alone."""
    made = {}
    for block in re.findall(r"```python\n(.*?)```", SECTIONS[heading], re.DOTALL):
        names = {"__name__": "example"}
        exec(compile(block, f"{GUIDE.name}: {heading}", "exec", dont_inherit=True), names)
        made |= names
    assert made
    return made


def test_every_example_of_the_guide_is_run_here():
    with_code = {heading for heading, text in SECTIONS.items() if "```python" in text}
    assert with_code == {
        "A new quantity",
        "A new system",
        "A new term",
        "A new perturbation",
        "A new picture",
        "Your own equations, with damping",
        "A new special point",
    }


def test_a_quantity_is_a_row_and_a_pass():
    names = run("A new quantity")
    ds = names["ds"]
    assert ds.rotation_speed.dims == ("beta",)
    assert ds.rotation_speed.attrs["units"] == "s-1"
    assert "rotation_speed" in pk.quantities()
    for cell in (ds.isel(beta=i) for i in range(ds.sizes["beta"])):
        # A little faster, it goes round; a little slower, it turns back.
        center = cell.phi.sel(equilibrium="lower_center").item()
        speeds = cell.rotation_speed.item() * np.array([1 + 1e-9, 1 - 1e-9])
        kinds = pk.orbits(cell.phasekit.system(), [center, center], speeds).orbit_kind
        assert kinds.values.tolist() == [pk.OrbitKind.ROTATION, pk.OrbitKind.LIBRATION]
    with pytest.raises(pk.ParameterError, match="wants a system with coefficients"):
        pk.sweep(pk.Potential("k*x**2", "x", {"k": 1.0}), k=[1.0, 2.0], of="rotation_speed")


def test_a_term_is_one_class():
    """Up to the first turn of a swing, dry friction takes its force times the way."""
    names = run("A new term")
    assert names["ds"].isel(mu=1).phasekit.system().terms[0] == names["DryFriction"](mu=0.2)
    phi, dphi = (names["motion"][f"motion_{name}"].values for name in ("phi", "dphi"))
    last = np.flatnonzero(dphi > 0.0)[0] - 1
    lost = 9.80665 * (np.cos(phi[last]) - np.cos(1.0)) - 0.5 * dphi[last] ** 2
    assert lost == pytest.approx(0.3 * (1.0 - phi[last]), rel=1e-3)


def test_a_quantity_of_any_potential_is_one_of_the_disk_too():
    row = Quantity("depth", "depth", (), "float64", "s-2", "least energy", "min V", "-")
    line = Pass(
        lambda energy: np.fmin.reduce(energy, axis=-1), ("energy",), ("depth",), Conservative
    )
    quantities.add(row, line)
    well = pk.Potential("x^4/4 - k*x^2/2", "x", {"k": 1.0})
    np.testing.assert_allclose(pk.sweep(well, k=[1.0, 2.0], of="depth").depth, [-0.25, -1.0])
    swings = pk.sweep(pk.Pendulum(length=1.0), g=[1.0, 2.0], of="depth")
    np.testing.assert_allclose(swings.depth, [-1.0, -2.0])


ROW = Quantity("depth", "depth", ("saddle",), "float64", "s-2", "depth", "V(1)", "-")


@pytest.mark.parametrize(
    ("row", "passes", "message"),
    [
        ({"name": "phi"}, [("depth",)], "row: got 'phi', wants a name that is not taken"),
        ({"name": "saddle"}, [("depth",)], "wants a name that is not taken"),
        ({"name": "time"}, [("depth",)], "wants a name that is not taken"),
        ({"group": "orbits"}, [("orbits",)], "wants a group of its own; 'orbits' is taken"),
        ({"dims": ("sadle",)}, [("depth",)], "did you mean 'saddle'"),
        ({}, [], r"passes: got \[\], wants one or several that compute the group 'depth'"),
        ({}, [("depth",), ("width",)], r"passes: got \['depth', 'width'\], wants one or several"),
    ],
)
def test_what_cannot_be_added_is_refused_and_changes_nothing(row, passes, message):
    before = (dict(quantities.ROWS), quantities.TABLE.passes)
    changed = {name: row.get(name, getattr(ROW, name)) for name in ROW.__slots__}
    lines = [Pass(np.abs, ("energy",), groups) for groups in passes]
    with pytest.raises(pk.ParameterError, match=message):
        quantities.add(Quantity(**changed), *lines)
    assert (quantities.ROWS, quantities.TABLE.passes) == before


def test_a_system_is_one_class():
    names = run("A new system")
    satellite, hoop, nerve = (names[name] for name in ("satellite", "hoop", "nerve"))

    def pull(theta):
        """V'/sin theta of the bead: weight, centrifugal force, spring."""
        length = np.sqrt(1.25 - np.cos(theta))
        spring = 0.5 * hoop.k * (1.0 - hoop.free / length)
        return 9.81 - hoop.spin**2 * np.cos(theta) + spring

    aside = brentq(pull, 0.5, 2.0, xtol=1e-14)
    places = pk.equilibria(hoop).phi.values
    np.testing.assert_allclose(places, [-aside, 0.0, aside, np.pi], atol=1e-13)
    assert names["ds"].isel(spin=2).phasekit.system() == hoop.replace(spin=3.0)
    # Small oscillations of the slider: sqrt(g/(1 - share)), and slower when they are great.
    slow = pk.orbits(names["slider"], 1e-6, 0.0).period.item()
    assert slow == pytest.approx(2.0 * np.pi / np.sqrt(9.0 / 0.4), rel=1e-10)
    assert names["orbit"].period.item() > slow
    # At its Hopf points the trace vanishes: 1 - v^2 = 0.8 eps.
    edge = np.sqrt(1.0 - 0.8 * nerve.eps)
    assert names["ignites"]["v"] == pytest.approx(-edge, rel=1e-10)
    assert names["ceases"]["v"] == pytest.approx(edge, rel=1e-10)
    k, torque = satellite.shape, satellite.magnet
    # It flips where the gravity gradient is as strong as the magnet: 3 n^2 k = torque.
    critical = pk.critical(satellite, "rate").critical_fold.sel(fold="minus").item()
    assert critical == pytest.approx(np.sqrt(torque / (3.0 * k)), rel=1e-14)
    fold = pk.critical(satellite, "magnet").critical_fold.sel(fold="minus").item()
    assert fold == pytest.approx(3.0 * satellite.rate**2 * k, rel=1e-14)
    counts = [pk.equilibria(satellite.replace(magnet=fold * x)).n_equilibria for x in (0.9, 1.1)]
    assert [count.item() for count in counts] == [4, 2]
    ds = pk.sweep(satellite, shape=[0.2, 0.8])
    assert ds.isel(shape=1).phasekit.system() == satellite
    assert pk.plot.phase_portrait(satellite).lines
    with pytest.raises(pk.ParameterError, match="shape: got 2, wants a number from -1 to 1"):
        satellite.replace(shape=2)


def test_a_perturbation_is_a_torque():
    """The seat in the carousel's frame in space, by Newton's law with its tension left out."""
    names = run("A new perturbation")
    motion, seat = names["motion"], names["seat"]

    def rate(t, state):
        phi, speed = state
        omega, alpha = np.tanh(0.3 * t), 0.3 / np.cosh(0.3 * t) ** 2
        along, up = np.array([np.cos(phi), 0.0, np.sin(phi)]), np.array([0.0, 0.0, 1.0])
        place = np.array([seat.length * np.sin(phi), -seat.rim, -seat.length * np.cos(phi)])
        fictitious = np.cross(omega * up, np.cross(omega * up, place))
        fictitious += np.cross(alpha * up, place)  # Coriolis acts across the plane
        force = along @ (-9.81 * up - fictitious)
        return speed, force / seat.length - 0.2 * speed

    exact = solve_ivp(
        rate, (0.0, 20.0), (0.0, 0.0), "DOP853", motion.time.values, rtol=1e-12, atol=1e-12
    )
    assert np.ptp(exact.y[0]) > 0.2
    np.testing.assert_allclose(motion.motion_phi, exact.y[0], atol=1e-7)
    with pytest.raises(pk.ParameterError, match="omega1: got"):
        pk.Perturbed(pk.Pendulum(length=1.0), omega1=lambda t: t)


def test_a_storage_option_is_a_field(tmp_path):
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm)
    beta = np.linspace(0.1, 1.5, 50)
    request = ask(disk.replace(beta=beta), quantities.select("equilibria"))
    # What one option made, calls with another go on with, and check.
    store = tmp_path / "map.zarr"
    sweep_into(place_of(store), request, StoreOptions(compressor="zstd", workers=1))
    written = json.loads((store / "phi" / "zarr.json").read_text("utf-8"))
    assert written["codecs"][-2]["configuration"]["cname"] == "zstd"
    longer = np.append(beta, 1.55)
    ds = pk.sweep(disk, beta=longer, of="equilibria", store=store, workers=1)
    xr.testing.assert_identical(ds.load(), pk.sweep(disk, beta=longer, of="equilibria"))
    xr.testing.assert_identical(pk.open_map(store, verify=True).load(), ds)


def test_a_picture_draws_what_is_there_as_numbers():
    names = run("A new picture")
    lines = {line.get_label(): line for line in names["ax"].lines}
    assert list(lines) == ["left", "right"]
    for side, line in lines.items():
        areas = names["ds"].lobe_area.sel(saddle="lower", side=side)
        assert np.isfinite(areas).sum() > 10
        np.testing.assert_array_equal(line.get_ydata(), areas)
    np.testing.assert_allclose(lines["left"].get_xdata(), np.linspace(10, 80, 71), rtol=1e-14)
    assert "°" in names["ax"].get_xlabel()
    _, ax = plt.subplots()
    assert names["lobe_areas"](names["ds"], "beta", ax=ax) is ax


def test_damping_moves_no_fold_and_makes_centers_foci():
    names = run("Your own equations, with damping")
    fold, branch = names["fold"], names["branch"]
    critical = pk.critical(names["undamped"], "B").critical_fold.sel(fold="plus").item()
    assert fold.status == "converged"
    assert fold["B"] == pytest.approx(critical, rel=1e-12)
    np.testing.assert_allclose(np.sort(fold.eigenvalues.real), [-0.3, 0.0], atol=1e-9)
    center = names["damped"].derivatives([names["start"], 0.0])[1]
    np.testing.assert_allclose(np.linalg.eigvals(center).real, [-0.15, -0.15], rtol=1e-12)
    assert set(branch.points.n_unstable.values) == {0, 1}


def test_a_special_point_is_a_kind_and_a_test_function():
    names = run("A new special point")
    point = names["point"]
    assert (point.kind, point.status) == ("unit_frequency", "converged")
    np.testing.assert_allclose([point["a"], point["b"]], [1.0, 2.0], atol=1e-14)
    assert "UF" in [text.get_text() for text in names["ax"].texts]
    with pytest.raises(ValueError, match="registered already"):
        run("A new special point")


def test_every_larger_sample_is_named():
    """Benchmarks say themselves what theirs are."""
    folder = Path(__file__).parent
    texts = [path.read_text(encoding="utf-8") for path in folder.rglob("*.py")
             if path.parent.name != "benchmarks"]  # fmt: skip
    asked = re.compile(r"environ(?:\.get\(|\[)\"(PHASEKIT_\w+)")
    found = {name for text in texts for name in asked.findall(text)} - {"PHASEKIT_BROWSER"}
    assert len(found) > 10
    assert found <= set(re.findall(r"PHASEKIT_\w+", GUIDE.read_text(encoding="utf-8")))


def test_the_examples_use_public_names_alone():
    deep = re.compile(r"^\s*(?:from|import) +(phasekit[\w.]*)", re.MULTILINE)
    code = "".join(re.findall(r"```python\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL))
    assert set(deep.findall(code)) == {"phasekit", "phasekit.extend"}
