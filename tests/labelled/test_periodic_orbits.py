"""All limit cycles of planar flows and of maps, against exact ones and published values."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from witnesses.variants import some

import phasekit as pk
from phasekit.motion.displacements import Sampled
from phasekit.motion.returns import Plane, Ray

VAN_DER_POL = {"x": "y", "y": "mu*(1 - x^2)*y - x"}
WIDE = {"x": (-4.0, 4.0), "y": (-9.0, 9.0)}
FHN = {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"}
VALUES = {"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8}
PENDULUM = {"phi": "w", "w": "I - al*w - sin(phi)"}


def in_polar(rate, size=4.0, turn="1"):
    """The flow r' = r rate(r^2) with a constant turn."""
    r2 = "(x^2 + y^2)"
    rate = rate.replace("r2", r2)
    return pk.Problem(
        {"x": f"-{turn}*y + x*({rate})", "y": f"{turn}*x + y*({rate})"},
        window={"x": (-size, size), "y": (-size, size)},
    )


def test_the_oscillator_of_van_der_pol():
    """Periods of Amore, arXiv 2111.12198; backward in time the cycle repels."""
    system = pk.Problem(VAN_DER_POL, parameters={"mu": [1.0, 2.0, 5.0, -1.0, 0.0]}, window=WIDE)
    ds = pk.periodic_orbits(system)
    assert ds.n_cycles.dims == ("mu",)
    assert ds.n_cycles.values.tolist() == [1, 1, 1, 1, 0]
    published = np.array([6.66328685932, 7.62987447967, 11.61223066771, 6.66328685932])
    np.testing.assert_allclose(ds.period[:4, 0], published, rtol=1e-12)
    assert (ds.period_error[:4, 0] < 1e-10).all()
    assert ds.n_unstable[:4, 0].values.tolist() == [0, 0, 0, 1]
    np.testing.assert_allclose(ds.multiplier[0] * ds.multiplier[3], 1.0, rtol=1e-10)
    assert "closed orbits fill" in ds.complete.attrs["reason"]  # of the center, mu = 0
    # The orbit by collocation.
    single = system.replace(mu=2.0)
    orbit = pk.periodic_orbit(single, [2.0, 0.0])
    own = ds.isel(mu=1, cycle=0)
    np.testing.assert_allclose(own.multiplier, orbit.multiplier.values[1].real, rtol=1e-5)
    for name in ("x_min", "x_max", "y_min", "y_max"):
        np.testing.assert_allclose(own[name], orbit[name], rtol=1e-8)
    there = np.isfinite(own.cycle_time.values)
    assert own.cycle_time.values[there][-1] == own.period
    ends = own.cycle_x.values[there], own.cycle_y.values[there]
    np.testing.assert_allclose([e[0] for e in ends], [e[-1] for e in ends], atol=1e-10)


@pytest.mark.parametrize(
    ("radii", "factor"), [((1.0, 2.0, 3.0), 0.01), ((1.0, 1.001), -1.0), ((0.004, 3.9), 0.03)]
)
def test_all_of_several_exact_cycles(radii, factor):
    """Circles r with multipliers exp(2 pi d(r')/dr), which alternate."""
    rate = "*".join(f"({r**2!r} - r2)" for r in radii)
    ds = pk.periodic_orbits(in_polar(f"{factor!r}*{rate}"))
    assert ds.n_cycles == len(radii)
    np.testing.assert_allclose(ds.x_max, radii, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(ds.y_min, -np.array(radii), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(ds.period, 2.0 * np.pi, rtol=1e-9)
    others = [np.prod([q * q - r * r for q in radii if q != r]) for r in radii]
    growth = 2.0 * np.pi * factor * -2.0 * np.array(radii) ** 2 * others
    np.testing.assert_allclose(ds.log_multiplier, growth, rtol=1e-6, atol=1e-11)
    np.testing.assert_allclose(ds.multiplier, np.exp(growth), rtol=1e-6)
    assert ds.n_unstable.values.tolist() == (growth > 0.0).astype(int).tolist()


def test_what_may_be_two_cycles_or_none_is_told():
    ds = pk.periodic_orbits(in_polar("(1 - r2)^2"))
    assert ds.n_unstable.values.tolist() == [-1]
    np.testing.assert_allclose(ds.x_max, 1.0, atol=1e-4)
    assert "two cycles, one or none" in ds.complete.attrs["reason"]
    for rate in ("(1 - r2)^2 + 1/100", "1/4", "-1 - r2"):
        assert pk.periodic_orbits(in_polar(rate)).n_cycles == 0


def test_closed_orbits_that_fill_the_plane_are_no_limit_cycles():
    prey = pk.Problem(
        {"n": "n*(1 - p)", "p": "p*(n - 1)"}, window={"n": (0.01, 4.0), "p": (0.01, 4.0)}
    )
    ds = pk.periodic_orbits(prey)
    assert ds.n_cycles == 0
    assert (
        "closed orbits fill a part of the window round n = 1, p = 1"
        in (ds.complete.attrs["reason"])
    )


def test_rotations_of_a_driven_pendulum_both_ways():
    """The multiplier is exp(-al T); the period is refined by collocation."""
    system = pk.Problem(
        PENDULUM, parameters={"al": 0.1, "I": [0.5, -0.5, 0.12, 1.2]},
        periods={"phi": 2.0 * np.pi}, window={"w": (-15.0, 15.0)},
    )  # fmt: skip
    ds = pk.periodic_orbits(system)
    # Below I_c = 0.12701 all motions come to rest; above 1 there is no equilibrium.
    assert ds.n_cycles.values.tolist() == [1, 1, 0, 1]
    np.testing.assert_allclose(ds.period[:2, 0], 1.257644285820, rtol=1e-11)
    np.testing.assert_allclose(ds.multiplier[[0, 1, 3], 0], np.exp(-0.1 * ds.period[[0, 1, 3], 0]))
    assert ds.winding[[0, 1, 3], 0].values.tolist() == [1, -1, 1]
    np.testing.assert_allclose(ds.phi_max[0] - ds.phi_min[0], 2.0 * np.pi)
    disk = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.1, torque=0.5)
    same = pk.periodic_orbits(disk, {"dphi": (-15.0, 15.0)})
    np.testing.assert_allclose(same.period, ds.period[0], rtol=1e-11)


def test_that_there_are_no_others_is_proved_where_it_can_be():
    damped = pk.Problem({"x": "v", "v": "x - x^3 - v/5"}, window={"x": (-2, 2), "v": (-2, 2)})
    assert pk.periodic_orbits(damped).complete  # divergence -1/5
    saddle = pk.Problem({"x": "x^2 - y", "y": "x + y^3*x"}, window={"x": (1, 2), "y": (1, 2)})
    assert pk.periodic_orbits(saddle).complete  # no equilibrium
    turning = pk.Problem(
        PENDULUM, parameters={"al": 0.1, "I": [0.5, 0.05]}, periods={"phi": 2.0 * np.pi},
        window={"w": (-8.0, 8.0)},
    )  # fmt: skip
    ds = pk.periodic_orbits(turning)
    assert ds.n_cycles.values.tolist() == [1, 0]
    assert ds.complete.values.tolist() == [True, False]  # at most one, but one was found
    # No equilibrium, for f has no value round 0; the circle is a cycle all the same.
    rate = "(1 - x^2 - y^2)*sqrt(x^2 + y^2 - 1/4)"
    hole = pk.Problem(
        {"x": f"-y + x*{rate}", "y": f"x + y*{rate}"}, window={"x": (-2, 2), "y": (-2.1, 2)}
    )
    found = pk.periodic_orbits(hole)
    assert not found.complete
    assert "where it has none" in found.complete.attrs["reason"]


def test_that_all_were_found_is_proved_of_oscillators():
    oscillator = pk.Problem(VAN_DER_POL, parameters={"mu": [0.5, 3.0, 20.0]}, window=WIDE)
    ds = pk.periodic_orbits(oscillator)
    assert ds.n_cycles.values.tolist() == [1, 1, 0]  # the last one leaves the window
    assert ds.complete.values.tolist() == [True, True, True]
    nerve = pk.Problem(
        FHN, parameters={**VALUES, "I": [0.2, 0.5]}, window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)}
    )
    ds = pk.periodic_orbits(nerve)
    assert ds.n_cycles.values.tolist() == [0, 1]
    assert ds.complete.values.tolist() == [True, True]
    assert pk.periodic_orbits(in_polar("(1 - r2)*(4 - r2)*(9 - r2)/100")).complete
    assert not pk.periodic_orbits(in_polar("(1 - r2)^2")).complete


def test_a_nerve_has_a_small_cycle_in_a_large_one():
    """Next to its subcritical Hopf point; stiff; as canards: against collocation."""
    nerve = pk.Problem(FHN, parameters=VALUES, window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)})
    ds = pk.periodic_orbits(nerve.replace(I=0.325))
    assert ds.n_unstable.values.tolist() == [1, 0]
    for k in (0, 1):
        start = [ds.cycle_v[k, 0].item(), ds.cycle_w[k, 0].item()]
        orbit = pk.periodic_orbit(nerve.replace(I=0.325), start, period=ds.period[k].item())
        np.testing.assert_allclose(ds.period[k], orbit.period, rtol=1e-9)
        np.testing.assert_allclose(ds.v_max[k], orbit.v_max, rtol=1e-7)
        multiplier = orbit.multiplier.values.real[np.argmax(np.abs(orbit.multiplier.values - 1.0))]
        np.testing.assert_allclose(ds.multiplier[k], multiplier, rtol=1e-6)
    stiff = pk.periodic_orbits(nerve.replace(eps=0.001))
    assert stiff.n_unstable.values.tolist() == [0]
    assert stiff.log_multiplier < -1000.0
    assert stiff.multiplier == 0.0


def test_canards():
    system = pk.Problem(
        {"x": "(a - y)/100", "y": "x + y - y^3/3"}, parameters={"a": [0.995, 0.9988, 1.001]},
        window={"x": (-1.5, 1.5), "y": (-3.0, 3.0)},
    )  # fmt: skip
    ds = pk.periodic_orbits(system)
    assert ds.n_cycles.values.tolist() == [1, 1, 0]
    for k, a in enumerate((0.995, 0.9988)):
        start = [ds.cycle_x[k, 0, 0].item(), ds.cycle_y[k, 0, 0].item()]
        orbit = pk.periodic_orbit(system.replace(a=a), start, period=ds.period[k, 0].item())
        np.testing.assert_allclose(ds.period[k, 0], orbit.period, rtol=1e-8)


@pytest.mark.slow
def test_of_a_function_the_same():
    def rates(x, mu):
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]]

    system = pk.Problem(rates, ("x", "y"), {"mu": 1.0}, window={"x": (-3, 3), "y": (-4, 4)})
    ds = pk.periodic_orbits(system)
    np.testing.assert_allclose(ds.period, [6.66328685932], rtol=1e-10)
    wanted = pk.periodic_orbits(pk.Problem(VAN_DER_POL, parameters={"mu": 1.0}, window=WIDE))
    for name in ("log_multiplier", "x_max", "y_min"):
        np.testing.assert_allclose(ds[name], wanted[name], rtol=1e-7)
    assert "f is code" in ds.complete.attrs["reason"]


def test_a_forced_flow_of_one_state():
    """The one periodic motion of x' = -2 x + cos t is (2 cos t + sin t)/5."""
    system = pk.Problem("cos(t) - 2*x", "x", time="t", period=2 * np.pi, window={"x": (-2, 2)})
    ds = pk.periodic_orbits(system)
    t, x = ds.cycle_t.values[0], ds.cycle_x.values[0]
    np.testing.assert_allclose(x, (2.0 * np.cos(t) + np.sin(t)) / 5.0, atol=1e-10)
    np.testing.assert_allclose(ds.log_multiplier, -4.0 * np.pi, rtol=1e-11)


def test_a_cycle_that_leaves_the_window_is_not_in_it():
    cut = {"x": (-1.5, 4.0), "y": (-9.0, 9.0)}
    assert pk.periodic_orbits(pk.Problem(VAN_DER_POL, parameters={"mu": 1.0}), cut).n_cycles == 0


def test_cycles_of_the_logistic_map_are_counted():
    """2 x - 1 = cos(2 pi t) doubles t: all cycles, with multipliers +-2^n, 4 at 0."""
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 4.0}, map=True, window={"x": (-0.1, 1.1)})
    for n, number in enumerate((2, 1, 2, 3), 1):
        ds = pk.periodic_orbits(logistic, n=n)
        assert ds.n_cycles == number
        assert ds.complete
        sizes = np.abs(ds.multiplier.values.ravel())
        np.testing.assert_allclose(sizes, 2.0**n if n > 1 else [4.0, 2.0], rtol=1e-9)
        x = ds.cycle_x.values
        np.testing.assert_allclose(np.roll(x, -1, axis=1), 4.0 * x * (1.0 - x), atol=1e-13)
    assert pk.periodic_orbits(logistic.replace(r=[3.2, 3.5]), n=2).n_unstable.values.tolist() == [
        [0], [1],
    ]  # fmt: skip
    henon = pk.Problem(
        {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True,
        window={"x": (-2, 2), "y": (-1, 1)},
    )  # fmt: skip
    assert [pk.periodic_orbits(henon, n=n).n_cycles.item() for n in (1, 2, 3)] == [2, 1, 0]
    assert np.isnan(pk.periodic_orbits(henon.replace(a=[1.4, np.nan])).cycle_x[1]).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pk.periodic_orbits(pk.Pendulum(length=1.0)), "system: .* pk.orbit_families"),
        (lambda: pk.periodic_orbits(pk.Problem(VAN_DER_POL, parameters={"mu": 1.0})), "window: "),
        (
            lambda: pk.periodic_orbits(pk.Problem(["y", "z", "-x"], ("x", "y", "z"))),
            "a flow of two states .* pk.periodic_orbit finds one",
        ),
        (
            lambda: pk.periodic_orbits(
                pk.Problem(VAN_DER_POL, parameters={"mu": 1.0}, window=WIDE), n=2
            ),
            "n: got 2, wants None for a flow",
        ),
        (
            lambda: pk.periodic_orbits(
                pk.Problem(VAN_DER_POL, parameters={"mu": 1.0}), {"x": (1, -1), "y": (-1, 1)}
            ),
            r"window\['x'\]: .* low < high",
        ),
        (
            lambda: pk.periodic_orbits(
                pk.Problem(VAN_DER_POL, parameters={"mu": 1.0}, window=WIDE), {"u": (0, 1)}
            ),
            "window: state 'u' is unknown",
        ),
        (
            lambda: pk.periodic_orbits(pk.Problem("x", "x", map=True, window={"x": (0, 1)}), n=0),
            "n: got 0",
        ),
    ],
)
def test_what_is_wrong_is_said_before_any_work(call, message):
    with pytest.raises(pk.ParameterError, match=message):
        call()


def built_in(rng):
    """A polynomial flow with so many ellipses for its only cycles, and their exact values.

    In the plane of the circles u^2 + v^2 = r_i^2 it is r' = r k(v) prod(r^2 - r_i^2) with a turn
    h(u, v), both of one sign; an affine map and a change of the pace leave multipliers alone.
    """
    x, y = sp.symbols("x y", real=True)
    radii = np.sort(rng.uniform(0.3, 2.0, rng.integers(1, 4)))
    while len(radii) > 1 and np.diff(radii).min() < 0.03:
        radii = np.sort(rng.uniform(0.3, 2.0, len(radii)))
    A = rng.normal(size=(2, 2))
    while abs(np.linalg.det(A)) < 0.3 or np.linalg.cond(A) > 6.0:
        A = rng.normal(size=(2, 2))
    b = rng.normal(size=2)
    (p, q), (r, s) = np.linalg.inv(A)
    u, v = p * (x - b[0]) + q * (y - b[1]), r * (x - b[0]) + s * (y - b[1])
    c, sense = rng.uniform(0.05, 0.6) * rng.choice([-1, 1]), rng.choice([-1, 1])
    h0, h1, h2, k1, k2 = rng.uniform([0, 0, -0.5, 0, -0.4], [0.6, 0.6, 0.5, 0.3, 0.4])

    def turn(u, v):
        return sense * (1 + h0 * u**2 + h1 * v**2 + h2 * u)

    def pull(v):
        return c * (1 + k1 * v**2 + k2 * v)

    rate = pull(v) * np.prod([u**2 + v**2 - r**2 for r in radii])
    du, dv = -v * turn(u, v) + u * rate, u * turn(u, v) + v * rate
    f = [A[0, 0] * du + A[0, 1] * dv, A[1, 0] * du + A[1, 1] * dv]
    half = 2.3 * np.linalg.norm(A, axis=1)
    window = {name: (b[i] - 1.2 * half[i], b[i] + half[i]) for i, name in enumerate("xy")}
    angles = 2.0 * np.pi * np.arange(4000) / 4000
    growth, period = [], []
    for r in radii:
        u, v = r * np.cos(angles), r * np.sin(angles)
        pace = 1.0 / np.abs(turn(u, v))
        slope = pull(v) * 2 * r**2 * np.prod([r**2 - q**2 for q in radii if q != r])
        growth.append(2.0 * np.pi * np.mean(slope * pace))
        period.append(2.0 * np.pi * np.mean(pace))
    ends = b[0] + radii * np.linalg.norm(A[0])
    return pk.Problem(f, ("x", "y"), window=window), ends, np.array(growth), np.array(period)


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(4), 2))
def test_none_is_missed_and_none_invented(seed):
    """A thousand of these were tried once: all cycles were found, and no other."""
    system, ends, growth, period = built_in(np.random.default_rng(seed))
    ds = pk.periodic_orbits(system)
    assert ds.n_cycles == len(ends)
    np.testing.assert_allclose(ds.x_max, ends, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ds.period, period, rtol=1e-10)
    np.testing.assert_allclose(ds.log_multiplier, growth, rtol=1e-9, atol=1e-10)


class Bent(Sampled):
    """Displacements that rise to a bend beyond zero, and fall from there."""

    def __init__(self, rng):
        self.at, self.top = rng.uniform(0.1, 0.9), rng.uniform(1e-4, 3e-3)
        self.rise, self.fall, self.curve = rng.uniform(0.05, 0.5, 3)
        plane = Plane(-np.ones(2), np.ones(2), np.ones(2), np.zeros((0, 2)))
        super().__init__(None, {}, Ray(np.zeros(2), np.eye(2)[0], np.ones(2), 1.0), plane, 1.0)

    def displacements(self, places, rtol=0.0):
        x = np.asarray(places) - self.at
        return self.top - np.where(x < 0.0, -self.rise, self.fall) * x - self.curve * x * x


def test_two_cycles_beside_a_bend_of_the_return_map_are_seen():
    found = [len(Bent(np.random.default_rng(seed)).met().places) for seed in range(16)]
    assert found == [2] * 16


RELAXES = {"x": "mu*(x - x^3/3 - y)", "y": "x/mu"}
WITHIN = {"x": (-3.0, 3.0), "y": (-2.0, 2.0)}


def test_a_crowded_way_round_is_thinned(monkeypatch):
    problem = pk.Problem(RELAXES, parameters={"mu": 30.0})
    whole = pk.periodic_orbits(problem, WITHIN)
    monkeypatch.setattr("phasekit.motion.limit_cycles.ROOM", 1000)
    thin = pk.periodic_orbits(problem, WITHIN)
    for name in ("period", "log_multiplier", "x_min", "x_max", "y_min", "y_max"):
        assert thin[name].item() == whole[name].item()
    assert 100 < thin.sizes["sample"] < 1000 < whole.sizes["sample"]
    x, y = (thin[f"cycle_{name}"].values[0] for name in "xy")
    assert np.hypot(np.diff(x) / 6.0, np.diff(y) / 4.0).max() < 0.02
    assert (x[0], y[0]) == pytest.approx((x[-1], y[-1]), abs=1e-9)


def test_a_cycle_that_cannot_be_followed_is_announced(monkeypatch):
    for name in ("ROOM", "CROWD"):
        monkeypatch.setattr(f"phasekit.motion.limit_cycles.{name}", 50)
    problem = pk.Problem(RELAXES, parameters={"mu": 5.0})
    with pytest.warns(RuntimeWarning, match=r"n_cycles: 1 were met .* of the period 11\.6.* steps"):
        found = pk.periodic_orbits(problem, WITHIN)
    assert found.n_cycles.item() == 0
    assert not found.complete.item()
    assert "takes too many steps to be followed" in found.complete.attrs["reason"]


def test_no_proof_of_a_turn_leaves_a_sliver_out():
    # The divergence has one sign but for a sliver of 1e-9 of a turn, which this window lacks.
    turn = 2.0 * np.pi
    window = {"q": (-0.5 * turn * (1.0 - 8e-10), 0.5 * turn), "y": (-1.0, 1.0)}
    bump = "exp(-1e22*sin((q - pi)/2 + 4e-10*pi)^2)"
    flow = pk.Problem({"q": "1", "y": f"-y*(1 - 3*{bump})"}, periods={"q": turn}, window=window)
    assert not pk.periodic_orbits(flow).complete.item()
