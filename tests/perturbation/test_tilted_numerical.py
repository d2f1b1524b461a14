"""Any potential under a constant torque, against SciPy, the closed form and a formula of it."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from witnesses.variants import some

import phasekit as pk

KIND = pk.OrbitKind
TRIG = "-B*cos(q) + A/2*cos(q)**2 - C*sin(q)"
#: Not of (A, B, C), of the period 3: two wells.
WAVES = "exp(cos(u*q)) - 1.5*cos(2*u*q) + 0.6*sin(u*q)"
UNIT = 2.0 * np.pi / 3.0


def waves(torque):
    return pk.Perturbed(pk.Potential(WAVES, "q", {"u": UNIT}, period=3.0), torque=torque)


def height(x, N):
    y = UNIT * x
    return math.exp(math.cos(y)) - 1.5 * math.cos(2 * y) + 0.6 * math.sin(y) - N * x


def pull(x, N):
    y = UNIT * x
    rise = -math.sin(y) * math.exp(math.cos(y)) + 3.0 * math.sin(2 * y) + 0.6 * math.cos(y)
    return N - UNIT * rise


def speed(x, h, N):
    return np.sqrt(max(2.0 * (h - height(x, N)), 0.0))


def pair(A, B, C, N):
    """One system as a formula and as coefficients."""
    formula = pk.Potential(TRIG, "q", {"A": A, "B": B, "C": C}, period="2*pi")
    return pk.Perturbed(formula, torque=N), pk.Perturbed(pk.Coefficients(A, B, C), torque=N)


def turns_of(N, start, until):
    """Times and places of the turning points along a motion."""
    run = solve_ivp(
        lambda _, y: [y[1], pull(y[0], N)], (0.0, until), start, "DOP853",
        events=lambda _, y: y[1], rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    return run.t_events[0], np.reshape(run.y_events[0], (-1, 2))[:, 0], run.y[:, -1]


@pytest.mark.parametrize("N", [0.15, -0.4])
def test_orbits_against_integration(N):
    rng = np.random.default_rng(2)
    x, v = rng.uniform(-5.0, 5.0, 12), 2.5 * rng.normal(size=12)
    ds = pk.orbits(waves(N), x, v)
    assert ds.orbit_energy.values == pytest.approx(
        0.5 * v**2 + [height(one, N) for one in x], rel=1e-13
    )
    assert (ds.period_error < 1e-9).where(ds.period.notnull(), True).all()
    counts = {KIND.LIBRATION: 0, KIND.RUNNING: 0}
    for i, kind in enumerate(ds.orbit_kind.values):
        counts[kind] += 1
        one = ds.isel(point=i)
        times, places, end = turns_of(N, [x[i], v[i]], 15.0)
        if kind == KIND.LIBRATION:
            assert one.period.item() == pytest.approx(times[2] - times[0], rel=1e-8)
            ends = [one.phi_min.item(), one.phi_max.item()]
            assert sorted(places[:2]) == pytest.approx(ends, abs=1e-8)
            h = one.orbit_energy.item()
            area = quad(speed, *ends, (h, N), limit=200)[0]
            assert one.action.item() == pytest.approx(area / np.pi, rel=1e-6)
            assert one.gain_per_turn == 0.0
        else:
            assert np.sign(end[1]) == np.sign(N)
            assert one.gain_per_turn.item() == pytest.approx(3.0 * abs(N))
            assert np.isnan([one.period, one.action]).all()
            back = turns_of(N, [x[i], -v[i]], 15.0)[1]
            (turned,) = [*places, *back]
            want = [turned, np.inf] if N > 0.0 else [-np.inf, turned]
            assert [one.phi_min.item(), one.phi_max.item()] == pytest.approx(want, abs=1e-7)
    assert min(counts.values()) > 1


@pytest.mark.slow
@pytest.mark.parametrize("abcn", some([(1.0, 0.35, 0.12, -0.05), (1.0, 0.35, 0.12, 0.05),
                                       (0.0, 1.0, 0.0, 0.3), (1.0, 0.35, 0.12, 2.0),
                                       (-0.7, -1.27, -0.62, 0.0)], 2))  # fmt: skip
def test_as_coefficients(abcn):
    formula, closed = pair(*abcn)
    found, want = pk.separatrices(formula), pk.separatrices(closed)
    order = np.argsort(want.saddle_phi.values)
    order = order[np.isfinite(want.saddle_phi.values[order])]
    n = order.size
    assert n == {0.05: 2, -0.05: 2, 0.3: 1, 2.0: 0, 0.0: 1}[abcn[3]]
    for name in ("saddle_phi", "saddle_energy", "saddle_exponent", "turning_phi", "turning_offset",
                 "lobe_area", "winding_area"):  # fmt: skip
        assert found[name].values[:n] == pytest.approx(
            want[name].values[order], rel=1e-9, abs=1e-9, nan_ok=True
        )
    assert found.loop.values[:n].tolist() == want.loop.values[order].tolist()
    assert (found.topology, found.figure_eight) == (want.topology, want.figure_eight)
    assert found.energy_per_turn.item() == pytest.approx(2.0 * np.pi * abcn[3])
    rng = np.random.default_rng(4)
    state = rng.uniform(-8.0, 8.0, 12), rng.normal(size=12)
    one, other = pk.orbits(formula, *state), pk.orbits(closed, *state)
    assert one.orbit_kind.values.tolist() == other.orbit_kind.values.tolist()
    for name in ("period", "action", "phi_min", "phi_max", "gain_per_turn", "orbit_energy"):
        near = pytest.approx(other[name].values, rel=1e-8, abs=1e-9, nan_ok=True)
        assert one[name].values == near
    angles = [pk.action_angle(p, *state).angle.values for p in (formula, closed)]
    assert angles[0] == pytest.approx(angles[1], abs=1e-7, nan_ok=True)
    if n:
        label = ("lower", "upper")[order[0]]
        for side in ("left", "right"):
            a = pk.separatrix_motion(formula, [-1.0, 0.0, 0.5], saddle=0, side=side)
            b = pk.separatrix_motion(closed, [-1.0, 0.0, 0.5], saddle=label, side=side)
            assert a.motion_phi.values == pytest.approx(b.motion_phi.values, nan_ok=True)


def test_on_a_line_it_is_a_part_of_the_potential():
    base = pk.Potential("x^4/4 - x^2/2", "x")
    torqued, plain = pk.Perturbed(base, torque=0.1), pk.Potential("x^4/4 - x^2/2 - 0.1*x", "x")
    calls = (
        pk.separatrices,
        lambda p: pk.orbits(p, [0.3, 1.0, 2.0], 0.1),
        lambda p: pk.orbits(p, energy=[0.1, 0.2], center=2),
        lambda p: pk.orbits(p, gap=[-0.01, 0.01]),
        lambda p: pk.action_angle(p, 0.3, 0.1),
        lambda p: pk.orbit_families(p, 6, energy_max=1.0),
    )
    for call in calls:
        found, want = call(torqued), call(plain)
        names = set(want.data_vars) - {"orbit_family"}  # are not numbered under a torque
        assert names <= set(found.data_vars)
        for name in names:
            assert found[name].values == pytest.approx(want[name].values, rel=1e-12, nan_ok=True)
    assert np.isnan(pk.separatrices(torqued).energy_per_turn)
    both = pk.orbits(pk.Perturbed(base, torque=[0.0, 0.1]), 0.3, 0.1)
    assert both.period.values[0] == pk.orbits(base, 0.3, 0.1).period.item()
    assert both.period.values[1] == pk.orbits(torqued, 0.3, 0.1).period.item()


@pytest.mark.parametrize("N", [0.1, -0.1])
def test_families_of_a_potential(N):
    ds = pk.orbit_families(waves(N), 24)
    names = ds.family.values.tolist()
    assert "rotation" not in names
    assert sum(name.startswith("well_") for name in names) == 2
    assert sum(name.startswith("wells_") for name in names) == 1
    points = pk.equilibria(waves(N))
    for name in names:
        one = ds.sel(family=name)
        h, T, J = (one[k].values for k in ("energy_level", "period", "action"))
        assert np.isfinite(T).all()
        assert (np.diff(h) > 0.0).all()
        assert (np.diff(J) > 0.0).all()
        assert (one.period_error < 1e-8 * T).all()
        center = points.phi.values[int(name.split("_")[1])]
        for i in (2, 12, 21):  # dJ/dh = T/(2 pi), by integration in time
            v = np.sqrt(2.0 * (h[i] - height(center, N)))
            times, *_ = turns_of(N, [center, v], 3.0 * T[i])
            assert times[2] - times[0] == pytest.approx(T[i], rel=1e-7)


def test_families_of_coefficients():
    torques = [0.0, 0.05, -0.05, 0.3]
    system = pk.Coefficients(1.0, 0.35, 0.12)
    ds = pk.orbit_families(pk.Perturbed(system, torque=torques), 12)
    assert ds.family.values.tolist() == ["lower_well", "upper_well", "outer", "rotation"]
    still = pk.orbit_families(system, 12)
    assert np.array_equal(ds.period.values[0], still.period.values, equal_nan=True)
    assert np.isnan(ds.period.sel(family="rotation").values[1:]).all()
    assert np.isnan(ds.period.sel(family="outer").values[3]).all()  # no eight is left
    assert (ds.period_error.values[0][np.isfinite(still.period.values)] == 0.0).all()
    for i, N in enumerate(torques[1:3], start=1):
        formula = pk.orbit_families(pair(1.0, 0.35, 0.12, N)[0], 12)
        closed = pk.equilibria(pk.Perturbed(system, torque=N))
        places = pk.equilibria(pair(1.0, 0.35, 0.12, N)[0]).phi.values
        for family, label in (("lower_well", 0), ("upper_well", 2)):
            number = int(np.argmin(abs(places - closed.phi.values[label])))
            own, want = ds.isel(torque=i).sel(family=family), formula.sel(family=f"well_{number}")
            for name in ("energy_level", "period", "action"):
                assert own[name].values == pytest.approx(want[name].values, rel=1e-8)
        (wells,) = [name for name in formula.family.values if name.startswith("wells_")]
        outer = ds.isel(torque=i).sel(family="outer")
        assert outer.period.values == pytest.approx(formula.period.sel(family=wells), rel=1e-7)
        start = float(outer.energy_level.values[6] - closed.energy.values[1])
        phi = float(closed.phi.values[1])  # the lower saddle, at its own place

        def law(_, y, N=N):
            return [y[1], (np.cos(y[0]) - 0.35) * np.sin(y[0]) + 0.12 * np.cos(y[0]) + N]

        run = solve_ivp(
            law, (0.0, 60.0), [phi, np.sqrt(2.0 * start)], "DOP853",
            events=lambda _, y: y[1], rtol=1e-12, atol=1e-13,
        )  # fmt: skip
        times = run.t_events[0]
        assert times[2] - times[0] == pytest.approx(outer.period.values[6], rel=1e-7)


def test_pictures_of_periods():
    for system in (waves(0.1), pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), torque=0.05)):
        axes = pk.plot.period_energy(system, 20)
        assert sum(len(line.get_xdata()) >= 20 for line in axes.get_lines()) == 3


def test_maps_under_a_torque():
    system = pk.Perturbed(pk.Potential(TRIG, "q", {"A": 1.0, "B": 0.35, "C": 0.12}, period="2*pi"))
    ds = pk.sweep(system, torque=[-0.1, 0.0, 0.05, 3.0], of=["separatrices", "equilibria"])
    assert ds.loop.values.tolist() == [[4, 1], [2, 1], [4, 1], [0, 0]]
    assert ds.n_equilibria.values.tolist() == [4, 4, 4, 0]
    one = pk.separatrices(system.replace(torque=-0.1))
    assert ds.lobe_area.values[0] == pytest.approx(one.lobe_area.values)
    assert ds.isel(torque=0).phasekit.system().torque == -0.1
