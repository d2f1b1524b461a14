"""The same cell has the same bits in every shape, order and part of an array."""

import functools
import importlib

import numpy as np
import pytest
import xarray as xr
from witnesses.variants import ALL

import phasekit as pk
from phasekit.phase.numerical import collocation
from phasekit.phase.numerical.formula import make_formula
from phasekit.phase.numerical.functions import flow_with_errors
from phasekit.table.numerical import PASSES

N = 6
FORMULAS = {
    "polynomial": ("a*x^4/4 - b*x^2/2 + 0.1*x", None, None),
    "Fourier sum": ("-a*cos(x) + b*cos(2*x) + 0.3*sin(3*x)", 2.0 * np.pi, None),
    "general": ("a*x^4/8 - x^2 + 0.3*exp(-b*x^2) + 0.1*tanh(x)", None, (-8.0, 8.0)),
}


@functools.cache
def cells():
    """Values of every input of a pass."""
    rng = np.random.default_rng(4)
    own = {"a": rng.uniform(0.5, 2.0, N), "b": rng.uniform(0.2, 1.5, N)}
    own |= {"state_phi": rng.uniform(-2.5, 2.5, N), "state_dphi": rng.normal(size=N)}
    own |= {"state_energy": rng.normal(size=N), "state_gap": 0.3 * rng.normal(size=N)}
    own["state_excess"] = 10.0 ** rng.uniform(-8.0, -2.0, N)
    own |= {"state_action": rng.uniform(0.05, 0.6, N), "state_angle": rng.uniform(-3.0, 3.0, N)}
    own["state_family"] = rng.integers(0, 2, N)
    own["time"] = rng.choice([-1.0, 1.0], N) * 10.0 ** rng.uniform(-1.0, 1.5, N)
    return own


def orders():
    """Indices of cells: one alone, and others shuffled."""
    yield np.array([1])
    yield np.random.default_rng(1).permutation(N)[:4]


def bits(array):
    """Bits of a result, but for what stands for labels that are not there."""
    array = np.asarray(array)
    if array.ndim == 1 or not array.size:
        return [one.tobytes() for one in array]
    absent = 0 if array.dtype.kind in "ib" else np.nan
    found = []
    for row in array:
        row = row.reshape(len(row), -1)
        nothing = np.full_like(row[0], absent)
        held = [r.tobytes() for r in row if not np.array_equal(r, nothing, equal_nan=True)]
        found.append(b"".join(held))
    return found


def flat(found):
    """Arrays of results in results."""
    if not isinstance(found, tuple):
        return [found]
    return [array for part in found for array in flat(part)]


#: Each pass on each formula, the first of them each pass on one.
PAIRS = [
    (one, list(FORMULAS)[(i + shift) % len(FORMULAS)])
    for shift in range(len(FORMULAS))
    for i, one in enumerate(PASSES)
]


@pytest.mark.parametrize(
    ("one", "kind"),
    PAIRS if ALL else PAIRS[: len(PASSES)],
    ids=lambda p: p if isinstance(p, str) else p.function.split(":")[1],
)
def test_bits_do_not_depend_on_the_position(one, kind):
    text, period, interval = FORMULAS[kind]
    formula = make_formula(text, "x", ("a", "b"), period, interval)
    module, name = one.function.split(":")
    function = getattr(importlib.import_module(module), name)
    count = 3 if name == "angles" else N  # which takes long
    inputs = [cells()[n][:count] for n in ("a", "b", *one.inputs[1:])]

    def of(values):
        return [bits(f) for f in flat(function(formula, *values))]

    whole = of(inputs)
    assert all(len(row) == count for row in whole)
    unbounded = (name, kind) == ("critical_torque", "polynomial")  # in every cell alike
    assert unbounded or any(len(set(row)) > 1 for row in whole)
    for index in orders():
        index = index[index < count]
        for row, want in zip(of([x[index] for x in inputs]), whole, strict=True):
            assert row == [want[i] for i in index]


@pytest.mark.parametrize("many", [3, 9, 200])
def test_times_are_reached_as_they_are_alone(many):
    """Motions of one start are integrated at once where there are many times, else each alone."""
    formula = make_formula("-a*cos(x) + b*cos(2*x)", "x", ("a", "b"), 2.0 * np.pi, None)
    rng = np.random.default_rng(many)
    time = rng.uniform(-30.0, 30.0, many)
    start = (rng.uniform(-2.0, 2.0, (2, 1)), np.array([[0.3], [3.5]]))
    whole = flow_with_errors(formula, 1.0, 0.7, *start, time)
    some = rng.integers(0, many, 3)
    for row in (0, 1):
        for k in some:
            alone = flow_with_errors(formula, 1.0, 0.7, *(s[row, 0] for s in start), time[k])
            assert bits(np.ravel(alone)) == bits([field[row, k] for field in whole])
        part = flow_with_errors(formula, 1.0, 0.7, *(s[row] for s in start), time[::-2])
        assert np.array(part).tobytes() == np.array([f[row, ::-2] for f in whole]).tobytes()


def test_a_motion_goes_on_from_any_step_as_it_would_alone():
    """Where steps are refused, and the farthest time is shorter or longer."""

    def rate(rows, y):
        y = np.clip(y, -1e3, 1e3)  # where iterations grow
        return np.stack([y[..., 1], -4.0 * y[..., 0] ** 3 - np.sin(3.0 * y[..., 0])], axis=-1)

    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 3.0, 60))
    start, step = np.tile([1.3, 0.0], (60, 1)), np.full(60, 3.0)
    owner = np.zeros(60, np.intp)
    alone, _ = collocation.integrate(rate, start, time, step)
    assert np.isfinite(alone).all()
    for count in (33, 60):
        few = slice(0, count)
        args = (rate, start[few], owner[few], time[few], step[few])
        assert collocation.follow(*args)[0].tobytes() == alone[few].tobytes()


@pytest.mark.slow
def test_resonances_do_not_depend_on_the_position():
    rng = np.random.default_rng(2)
    forcing = pk.Harmonic(0.01, rng.uniform(0.2, 0.9, 9))
    disk = pk.Pendulum(length=1.0, g=1.0)
    whole = pk.resonances(pk.Perturbed(disk, forcing=forcing), n=[1, 2])
    assert np.isfinite(whole.resonance_width.values).sum() > 4
    for k in (5,):
        one = pk.Harmonic(0.01, float(forcing.frequency[k]))
        alone = pk.resonances(pk.Perturbed(disk, forcing=one), n=[1, 2])
        for name in ("resonance_width", "resonance_action", "resonance_overlap"):
            got = whole[name].isel({whole[name].dims[0]: k}).values
            assert got.tobytes() == alone[name].values.tobytes()


def perturbed(index):
    """Answers of systems under damping, noise, torque and two drives, some of them."""
    rng = np.random.default_rng(5)
    a, damping, torque, kT, nu = (
        xr.DataArray(rng.uniform(low, high, 9)[index], dims="cell")
        for low, high in ((0.6, 1.4), (0.01, 0.2), (0.01, 0.1), (0.02, 0.2), (0.5, 2.0))
    )
    well = pk.Coefficients(a, 0.35, 0.12)
    drive = [pk.Harmonic(0.1, nu), pk.Harmonic(0.05, 2.0 * nu, 0.3)]
    driven = pk.Perturbed(well, damping=damping, quadratic=damping, forcing=drive)
    tilted = pk.Perturbed(well, torque=torque)
    yield pk.melnikov(driven)
    yield pk.separatrices(tilted)
    yield pk.orbits(tilted, 0.3, 0.4)
    yield pk.escape_rate(pk.Perturbed(well, damping=damping, kT=kT))
    duffing = pk.Potential("a*x^4/4 - x^2/2", "x", {"a": a})
    yield pk.melnikov(pk.Perturbed(duffing, damping=damping, forcing=drive))


@pytest.mark.slow
def test_perturbed_answers_do_not_depend_on_the_position():
    whole = list(perturbed(slice(None)))
    numbers = 0
    for index in ([2], [7, 3, 0, 5, 8]):
        for all_, some in zip(whole, perturbed(index), strict=True):
            for name, want in all_.data_vars.items():
                if want.dtype.kind != "f" or "cell" not in want.dims:
                    continue
                wide = want.transpose("cell", ...).values[index]
                few = some[name].transpose("cell", ...).values
                assert few.tobytes() == wide.tobytes(), name
                numbers += int(np.isfinite(few).sum())
    assert numbers > 300


def assert_same_bits(one, two):
    """Each variable, whatever the order of its axes and of those of the map."""
    assert set(one.data_vars) == set(two.data_vars)
    for name, array in one.data_vars.items():
        other = two[name].transpose(*array.dims)
        pair = [np.ascontiguousarray(a.values) for a in (array, other)]
        assert pair[0].shape == pair[1].shape
        assert pair[0].tobytes() == pair[1].tobytes(), name


@pytest.mark.parametrize("kind", ["Fourier sum", "general"])
def test_maps_have_the_same_bits_in_every_shape_and_order(kind):
    text, period, interval = FORMULAS[kind]
    system = pk.Potential(text, "x", {"a": 1.0, "b": 1.0}, period=period, interval=interval)
    a, b = np.linspace(0.5, 2.0, 7), np.linspace(0.2, 1.5, 4)
    of = ("equilibria", "separatrices")
    whole = pk.sweep(system, a=a, b=b, of=of)
    assert_same_bits(whole, pk.sweep(system, b=b, a=a, of=of))
    back = pk.sweep(system, a=a[::-1], b=b, of=of)
    assert_same_bits(whole, back.isel(a=slice(None, None, -1)))
    # Labels that no cell of a part has are not there.
    for rows in (np.array([5, 2, 0]), np.arange(7)[1::3]):
        part = pk.sweep(system, a=a[rows], b=b, of=of)
        most = {name: slice(0, part.sizes[name]) for name in ("equilibrium", "saddle")}
        assert_same_bits(whole.isel(a=rows).isel(most), part)


def test_orbits_have_the_same_bits_in_every_shape():
    text, period, _ = FORMULAS["Fourier sum"]
    a, b = (
        xr.DataArray(v, dims=d)
        for d, v in (("p", np.linspace(0.5, 2.0, 5)), ("q", np.linspace(0.2, 1.5, 3)))
    )

    def of(a, b):
        return pk.orbits(pk.Potential(text, "x", {"a": a, "b": b}, period=period), 0.3, 0.7)

    whole = of(a, b)
    assert_same_bits(whole.isel(p=slice(None, None, -2)), of(a[::-2], b))
    assert_same_bits(whole.isel(q=[2, 0]), of(a, b[[2, 0]]))
    assert_same_bits(whole.isel(p=1, q=2), of(float(a[1]), float(b[2])))
    assert_same_bits(whole, of(*(v.transpose("q", "p").copy() for v in xr.broadcast(a, b))))


@pytest.mark.slow
def test_widths_of_resonances_have_the_same_bits_in_every_shape():
    disk = pk.Pendulum(length=1.0, g=1.0)
    size, pace = (
        xr.DataArray(v, dims=d) for d, v in (("s", [0.01, 0.02, 0.05]), ("w", [0.2, 0.4, 0.6, 0.9]))
    )

    def of(*harmonic):
        return pk.resonances(pk.Perturbed(disk, forcing=pk.Harmonic(*harmonic)), n=[1, 2])

    whole = of(size, pace)
    assert np.isfinite(whole.resonance_width).any()
    assert_same_bits(whole, of(size[::-1], pace).isel(s=slice(None, None, -1)))
    assert_same_bits(whole.isel(w=[3, 0, 2]), of(size, pace[[3, 0, 2]]))
    assert_same_bits(whole, of(*(v.transpose("w", "s").copy() for v in xr.broadcast(size, pace))))
