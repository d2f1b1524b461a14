"""Any potential under a constant torque, against the potential of the tilted formula."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

H = pk.Harmonic
KINDS = pk.EquilibriumKind
#: Formula, coordinate, parameters, interval.
LINES = [
    ("m*x**2/2 - x**4", "x", {"m": 1.0}, None),
    ("x**6/6 - k*x**3/3 + x", "x", {"k": 2.5}, None),
    ("x**3", "x", {}, None),
    ("torque**4 - torque**2", "torque", {}, None),
    ("exp(-q**2) + s*q**2/10", "q", {"s": 0.7}, (-3.0, 3.0)),
]
TORQUES = np.array([-1.3, -0.2, 0.0, 1e-9, 0.05, 0.8])


def same(one, other, **close):
    """Whether equilibria are the same; numbers within rounding, all else exactly."""
    assert one.sizes["equilibrium"] == other.sizes["equilibrium"]
    for name in ("kind", "n_equilibria", "complete"):
        assert np.array_equal(one[name], other[name])
    for name in ("phi", "energy", "curvature", "natural_frequency", "exponent"):
        assert np.array_equal(np.isnan(one[name]), np.isnan(other[name]))
        there = np.isfinite(one[name].values)
        assert one[name].values[there] == pytest.approx(other[name].values[there], **close)


@pytest.mark.slow
@pytest.mark.parametrize(("text", "x", "values", "interval"), LINES)
@pytest.mark.parametrize("torque", TORQUES.tolist())
def test_on_a_line(text, x, values, interval, torque):
    base = pk.Potential(text, x, values, interval=interval)
    p = pk.Perturbed(base, damping=0.1, forcing=H(0.3, 1.0), torque=torque)
    found = pk.equilibria(p)
    want = pk.equilibria(pk.Potential(f"{text} - ({torque!r})*{x}", x, values, interval=interval))
    same(found, want, rel=1e-12, abs=1e-13)
    if x != "torque":  # which the parameter is called
        assert np.array_equal(found[x], found.phi, equal_nan=True)
    assert found.phi.attrs["units"] == want.phi.attrs["units"]
    if torque == 0.0:
        for name, plain in pk.equilibria(base).data_vars.items():
            assert np.array_equal(found[name], plain, equal_nan=True)


def test_cells_of_arrays_are_single_ones():
    base = pk.Potential(*LINES[0][:2], {"m": xr.DataArray([-1.0, 0.5, 2.0], dims="m")})
    p = pk.Perturbed(base, damping=[0.0, 0.2], torque=np.append(TORQUES, np.nan))
    ds = pk.equilibria(p)
    assert dict(ds.sizes) == {"m": 3, "damping": 2, "torque": 7, "equilibrium": 3}
    assert (ds.n_equilibria.isel(torque=6) == -1).all()
    count = 0
    for m in ds.m.values:
        for torque in TORQUES:
            one = pk.equilibria(pk.Perturbed(pk.Potential(*LINES[0][:2], {"m": m}), torque=torque))
            here = ds.sel(m=m, damping=0.2, torque=torque)
            number = one.n_equilibria.item()
            assert here.n_equilibria.item() == number
            assert here.phi.values[:number].tolist() == one.phi.values.tolist()
            assert (here.kind.values[number:] == KINDS.ABSENT).all()
            count += number
    assert count > 20


def test_on_a_circle_against_fine_steps():
    base = pk.Potential("-cos(q) + b*cos(2*q)", "q", {"b": [0.1, 0.5, 2.0]}, period="2*pi")
    p = pk.Perturbed(base, torque=[-1.1, 0.0, 0.3, 2.5, 6.0])
    ds = pk.equilibria(p)
    assert ds.complete.all()
    x = np.linspace(-np.pi, np.pi, 100_001)
    seen = set()
    for b in ds.b.values:
        for torque in ds.torque.values:
            one = ds.sel(b=b, torque=torque)
            slope = np.sin(x) - 2 * b * np.sin(2 * x) - torque
            at = x[:-1][slope[:-1] * slope[1:] < 0.0]
            phi = one.phi.values[np.isfinite(one.phi.values)]
            if torque:
                assert phi.size == at.size == one.n_equilibria.item()
                assert np.abs(phi - at).max(initial=0.0) < 1e-4
            assert np.sin(phi) - 2 * b * np.sin(2 * phi) == pytest.approx(
                torque + 0 * phi, abs=1e-13
            )
            bend = np.cos(phi) - 4 * b * np.cos(2 * phi)
            assert one.curvature.values[: phi.size] == pytest.approx(bend, abs=1e-12)
            V = -np.cos(phi) + b * np.cos(2 * phi) - torque * phi
            assert one.energy.values[: phi.size] == pytest.approx(V, abs=1e-12)
            seen.add(phi.size)
    assert seen == {0, 2, 4}


def test_on_a_circle_as_coefficients():
    rng = np.random.default_rng(8)
    for A, B, C, N in rng.normal(size=(12, 4)):
        text = "-B*cos(q) + A/2*cos(q)**2 - C*sin(q)"
        base = pk.Potential(text, "q", {"A": A, "B": B, "C": C}, period="2*pi")
        found = pk.equilibria(pk.Perturbed(base, torque=0.4 * N))
        want = pk.equilibria(pk.Perturbed(pk.Coefficients(A, B, C), torque=0.4 * N))
        order = np.argsort(want.phi.values)
        phi = want.phi.values[order]
        count = int(np.isfinite(phi).sum())
        assert found.n_equilibria.item() == count == want.n_equilibria.item()
        assert found.phi.values == pytest.approx(phi[:count], abs=1e-11)
        assert found.kind.values.tolist() == want.kind.values[order][:count].tolist()


def test_a_fold_is_one_degenerate_equilibrium():
    p = pk.Perturbed(pk.Potential("x**3/3 - x", "x"), torque=[-1.0, -1.5])
    ds = pk.equilibria(p)
    assert ds.n_equilibria.values.tolist() == [1, 0]
    assert ds.kind.isel(torque=0).values.tolist() == [KINDS.DEGENERATE]
    assert ds.complete.values.tolist() == [True, True]


def test_what_is_not_proved_is_said():
    base = pk.Potential("-exp(-((x - 3.3)/0.05)^2)", "x", interval=(-10.0, 10.0))
    with pytest.warns(RuntimeWarning, match=r"not proved .* between -10 and.* in 1 of 2 systems"):
        ds = pk.equilibria(pk.Perturbed(base, torque=[0.0, 1.0]))
    assert ds.complete.values.tolist() == [False, True]
    assert ds.n_equilibria.values.tolist() == [1, 2]
    with pytest.raises(pk.ParameterError, match="interval: got None"):
        pk.equilibria(pk.Perturbed(pk.Potential("exp(x)", "x"), torque=0.1))


def test_sweeps(tmp_path):
    p = pk.Perturbed(pk.Potential(*LINES[0][:3]), torque=0.1, damping=0.2)
    ds = pk.sweep(p, m=[0.5, 1.0], torque=TORQUES, of=["equilibria", "melnikov"])
    want = pk.equilibria(p.replace(m=[0.5, 1.0], torque=TORQUES))
    for name in want.data_vars:
        assert ds[name].equals(want[name])
    alone = pk.sweep(p, m=[0.5, 1.0], torque=TORQUES, of="n_equilibria")
    assert alone.n_equilibria.equals(want.n_equilibria)
    assert alone.complete.all()
    stored = pk.sweep(p, m=[0.5, 1.0], torque=TORQUES, of="equilibria", store=tmp_path / "map.zarr")
    opened = pk.open_map(tmp_path / "map.zarr")
    assert opened.phi.load().equals(want.phi)
    assert stored.sizes == opened.sizes
    assert opened.isel(m=1, torque=4).phasekit.system() == p.replace(torque=0.05)


def test_energies_under_a_torque():
    text, x, values, _ = LINES[0]
    p = pk.Perturbed(pk.Potential(text, x, values), torque=0.3)
    plain = pk.Potential(f"{text} - 0.3*x", x, values)
    at, v = np.array([-1.2, 0.0, 0.7]), np.array([0.1, -2.0, 0.4])
    for function in (pk.potential, pk.gradient, pk.curvature):
        one, other = function(p, x=at), function(plain, x=at)
        (name,) = other.data_vars
        assert one[name].values == pytest.approx(other[name].values, rel=1e-14, abs=1e-15)
    h = pk.energy(p, at, v).energy_integral.values
    assert h == pytest.approx(pk.energy(plain, at, v).energy_integral.values, rel=1e-14)
    speed = pk.phase_velocity(p, at, h).phase_velocity.values
    assert speed == pytest.approx(abs(v), rel=1e-12)
    assert "torque" in pk.potential(p, at).potential.attrs["equation"]


ANY = pk.Potential(*LINES[0][:3])
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
DAMPED, TILTED = pk.Perturbed(ANY, damping=0.1), pk.Perturbed(ANY, torque=0.1)
DRIVEN, TORQUED = pk.Perturbed(EIGHT, forcing=H(0.1, 1.0)), pk.Perturbed(EIGHT, torque=0.1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.potential(DAMPED, 0.1), "without damping and drive but a constant torque for"),
        (lambda: pk.orbits(DAMPED, 0.1, 0.1), "damping and drive but a constant torque for orbits"),
        (lambda: pk.separatrices(DAMPED), "damping and drive but a constant torque for separatri"),
        (lambda: pk.near_center(TILTED, 0.1), "without damping and drive for near_center"),
        (
            lambda: pk.orbits(DRIVEN, 0.1, 0.1),
            "without damping and drive but a constant torque for",
        ),
        (lambda: pk.plot.frequency_action(DRIVEN), "without damping and drive for"),
        (lambda: pk.orbit_families(DAMPED), "without damping and drive for orbit_families"),
    ],
)
def test_refusals_say_what_is_wrong(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()
