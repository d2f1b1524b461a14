"""Values that others print, or that follow by hand, of laws that users bring.

``PHASEKIT_PUBLISHED=all`` tries a thousand random products of lines, a hundred random systems with
cycles built in, and basins as fine as those that are printed; a part of them is tried in every run.
"""

from __future__ import annotations

import os
import warnings
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from witnesses.variants import some

import phasekit as pk

pytestmark = pytest.mark.slow
KIND = pk.FlowEquilibriumKind
ALL = os.environ.get("PHASEKIT_PUBLISHED") == "all"


def magnets():
    """Three magnets under a pendulum, on the unit circle."""
    places = [(1.0, 0.0), (-0.5, 0.75**0.5), (-0.5, -(0.75**0.5))]
    pulls = [f"/sqrt((x - ({x!r}))^2 + (y - ({y!r}))^2 + d^2)^3" for x, y in places]
    pull = {
        name: "".join(f" - ({name} - ({place[i]!r})){w}" for place, w in zip(places, pulls,
                                                                            strict=True))
        for i, name in enumerate("xy")
    }  # fmt: skip
    rates = {"x": "u", "y": "v", "u": "-w^2*x - al*u" + pull["x"], "v": "-w^2*y - al*v" + pull["y"]}
    return pk.Problem(rates, parameters={"w": 0.8, "al": 0.2, "d": 0.2})


def test_henon_keeps_and_loses_these_shares():
    henon = pk.Problem(
        {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True
    )
    axis = np.linspace(-2.0, 2.0, 100)
    ds = pk.basins(henon, {"x": axis, "y": axis})
    assert ds.basin_fraction.item() == pytest.approx(0.426, abs=5e-4)
    assert (ds.basin == -2).mean().item() == pytest.approx(0.574, abs=5e-4)


# A part of the states lies on a coarser grid.
@pytest.mark.filterwarnings("ignore:basin. .* too coarse:RuntimeWarning")
def test_magnetic_pendulum_from_rest():
    axis = np.linspace(-2.0, 2.0, 201 if ALL else 101)
    # At rest in the middle the pendulum stays: there the forces of the magnets cancel.
    ds = pk.basins(magnets(), {"x": axis, "y": axis}, fixed={"u": 0.0, "v": 0.0})
    assert ds.sizes["attractor"] == 3
    undecided = np.argwhere(ds.basin.values < 0)
    np.testing.assert_array_equal(undecided, [[axis.size // 2] * 2])
    wanted = {(-0.5, 0.87): 0.331, (-0.5, -0.87): 0.331, (1.0, 0.0): 0.338}
    for x, y, share in zip(
        ds.attractor_x[:, 0].values, ds.attractor_y[:, 0].values, ds.basin_fraction.values,
        strict=True,
    ):  # fmt: skip
        near = min(wanted, key=lambda place: np.hypot(place[0] - x, place[1] - y))
        assert share == pytest.approx(wanted.pop(near), abs=0.005)


def test_lorenz_84_has_a_rest_a_cycle_and_chaos():
    rates = {
        "x": "-y^2 - z^2 - a*x + a*F", "y": "x*y - b*x*z - y + G", "z": "b*x*y + x*z - z",
    }  # fmt: skip
    system = pk.Problem(rates, parameters={"F": 6.886, "G": 1.347, "a": 0.255, "b": 4.0})
    # Of all, 4e4 states, as the shares that it is held against: each in the middle of its share of
    # the box.
    side = 34 if ALL else 18
    axis = np.linspace(-3.0, 3.0, side, endpoint=False) + 3.0 / side
    with pytest.warns(RuntimeWarning, match="their fractions hold as those of a sample"):
        ds = pk.basins(system, {"x": axis, "y": axis, "z": axis})
    kinds = ds.attractor_kind.values.tolist()
    shares = dict(zip(kinds, ds.basin_fraction.values, strict=True))
    wanted = {
        pk.AttractorKind.EQUILIBRIUM: 0.639,
        pk.AttractorKind.CYCLE: 0.188,
        pk.AttractorKind.CHAOTIC: 0.173,
    }
    assert shares.keys() == wanted.keys()
    for kind, share in wanted.items():
        assert shares[kind] == pytest.approx(share, abs=0.006)
    chaos = ds.isel(attractor=kinds.index(pk.AttractorKind.CHAOTIC))
    error = chaos.attractor_exponent_error.item()
    assert chaos.attractor_exponent.item() == pytest.approx(0.063, abs=4.0 * error)


def test_thomas_has_three_cycles_that_are_one():
    rates = {"x": "sin(y) - b*x", "y": "sin(z) - b*y", "z": "sin(x) - b*z"}
    system = pk.Problem(rates, parameters={"b": 0.1665}, window=dict.fromkeys("xyz", (-6, 6)))
    axis = np.linspace(-6.0, 6.0, 200 if ALL else 100)
    ds = pk.basins(system, {"x": axis, "y": axis}, fixed={"z": 0.0})
    shares = np.sort(ds.basin_fraction.values)
    np.testing.assert_allclose(shares, [0.268, 0.269, 0.463], atol=0.008)
    np.testing.assert_allclose(ds.attractor_period, ds.attractor_period[0], rtol=1e-8)
    spans = [
        sorted(float(np.ptp(ds[f"attractor_{name}"].values[i])) for name in "xyz") for i in range(3)
    ]  # those of cyclic permutations
    np.testing.assert_allclose(spans[1:], [spans[0]] * 2, rtol=2e-2)


def test_edge_state_of_fitzhugh_and_nagumo_is_the_saddle():
    system = pk.Problem(
        {"x": "10*(x - x^3 - y)", "y": "-3*y + x"}, window={"x": (-2, 2), "y": (-1, 1)}
    )
    ds = pk.edge_state(system, [-1.0, 0.0], [1.0, 0.2])
    np.testing.assert_allclose([ds.edge_x.item(), ds.edge_y.item()], 0.0, atol=1e-9)
    assert ds.n_unstable.item() == 1


@pytest.mark.parametrize("scale", [100.0, 1.0])
def test_all_cycles_of_a_radial_family(scale):
    rate = f"(1 - x^2 - y^2)*(4 - x^2 - y^2)*(9 - x^2 - y^2)/{scale!r}"
    system = pk.Problem(
        {"x": f"x*({rate}) - y", "y": f"y*({rate}) + x"}, window={"x": (-4, 4), "y": (-4, 4)}
    )
    slopes = np.array([-2.0 * 3 * 8, 8.0 * 3 * 5, -18.0 * 8 * 5]) / scale
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        ds = pk.periodic_orbits(system)
    np.testing.assert_allclose(ds.x_max, [1.0, 2.0, 3.0], rtol=1e-8)
    np.testing.assert_allclose(ds.period, 2 * np.pi, rtol=1e-9)
    np.testing.assert_allclose(ds.log_multiplier, 2 * np.pi * slopes, rtol=1e-8)
    assert ds.n_unstable.values.tolist() == [0, 1, 0]
    with np.errstate(over="ignore", under="ignore"):
        np.testing.assert_allclose(ds.multiplier, np.exp(2 * np.pi * slopes), rtol=1e-6)
    left = [str(one.message) for one in told if "log_multiplier" in str(one.message)]
    assert len(left) == (scale == 1.0)  # what leaves the doubles is said


def test_van_der_pols_cycle():
    system = pk.Problem(
        {"x": "y", "y": "mu*(1 - x^2)*y - x"}, parameters={"mu": 1.0},
        window={"x": (-4, 4), "y": (-5, 5)},
    )  # fmt: skip
    ds = pk.periodic_orbits(system)
    assert ds.period.values == pytest.approx([6.6632868593231301896996820305], rel=1e-10)
    assert ds.n_unstable.values.tolist() == [0]


def test_duffings_resonance_with_default_options():
    system = pk.Problem(
        ["v", "-0.01*v - x - x^3 + 0.01*cos(w*t)"], ("x", "v"), {"w": 0.5}, time="t",
        period="2*pi/w",
    )  # fmt: skip
    branch = pk.continuation(
        system, "w", orbit=pk.periodic_orbit(system, [0.0, 0.0]), span=(0.5, 3.0),
    )  # fmt: skip
    folds = branch.special("LPC")
    np.testing.assert_allclose([p["w"] for p in folds], [1.22644946, 1.03860429], atol=1e-8)
    assert branch.points.sizes["point"] <= 150
    assert float(branch.points.x_max.max()) == pytest.approx(0.82564, abs=1e-4)
    assert [stop.reason for stop in branch.stops] == ["bound", "bound"]


def test_morris_and_lecars_neuron():
    system = pk.Problem(
        {
            "V": "(I - gL*(V + 60) - gK*w*(V + 84) - gCa*minf*(V - 120))/20",
            "w": "phi*(winf - w)/tau",
        },
        definitions={
            "minf": "(1 + tanh((V + 1.2)/18))/2",
            "winf": "(1 + tanh((V - 2)/30))/2",
            "tau": "1/cosh((V - 2)/60)",
        },
        parameters={"I": 0.0, "gL": 2.0, "gK": 8.0, "gCa": 4.4, "phi": 0.04},
    )
    branch = pk.continuation(system, "I", x0=[-60.0, 0.01], span=(0.0, 300.0))
    hopf = branch.special("H")
    np.testing.assert_allclose([p["I"] for p in hopf], [93.85762, 212.01882], atol=1e-5)
    folds = [p["I"] for p in hopf[0].switch().special("LPC")]
    for wanted in (88.29325054, 216.8998014):
        assert min(abs(fold - wanted) for fold in folds) < 2e-7


def test_hodgkin_and_huxleys_neuron():
    system = pk.Problem(
        {
            "v": "I - 120*m^3*h*(v - 115) - 36*n^4*(v + 12) - 0.3*(v - 10.6)",
            "m": "am*(1 - m) - bm*m", "h": "ah*(1 - h) - bh*h", "n": "an*(1 - n) - bn*n",
        },
        definitions={
            "am": "(25 - v)/10/(exp((25 - v)/10) - 1)", "bm": "4*exp(-v/18)",
            "ah": "7*exp(-v/20)/100", "bh": "1/(exp((30 - v)/10) + 1)",
            "an": "(10 - v)/100/(exp((10 - v)/10) - 1)", "bn": "exp(-v/80)/8",
        },
        parameters={"I": 0.0},
    )  # fmt: skip
    branch = pk.continuation(system, "I", x0=[0.0, 0.05, 0.6, 0.32], span=(0.0, 200.0))
    hopf = branch.special("H")
    np.testing.assert_allclose([p["I"] for p in hopf], [9.77934, 154.52633], atol=6e-6)
    cycles = hopf[0].switch()
    folds, doublings = ([p["I"] for p in cycles.special(label)] for label in ("LPC", "PD"))
    np.testing.assert_allclose(np.sort(folds), [6.26422, 7.84625, 7.92169], atol=6e-6)
    np.testing.assert_allclose(np.sort(doublings), [7.84924, 7.92168], atol=6e-6)


def test_the_logistic_maps_cascade_and_window():
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 2.5}, map=True, window={"x": (0, 1)})
    found, branch = [], pk.continuation(logistic, "r", x0=[0.6], span=(1.5, 3.6))
    for _ in range(3):
        (point,) = branch.special("PD")[:1]
        found.append(point["r"])
        branch = point.switch()
    np.testing.assert_allclose(found, [3.0, 1 + np.sqrt(6), 3.5440903596], atol=1e-9)
    edge = 1.0 + 2.0 * np.sqrt(2.0)
    three = [pk.periodic_orbits(logistic.replace(r=edge + d), n=3).n_cycles.item()
             for d in (-1e-6, 1e-6)]  # fmt: skip
    assert three[1] - three[0] == 2


@pytest.mark.parametrize(
    ("law", "start", "duration", "wanted"),
    [
        ("lorenz", [1.0, 1.0, 1.0], 1000.0, (0.9056, 0.0, -14.5723)),
        ("roessler", [1.0, 1.0, 0.0], 2000.0, (0.0714, 0.0, None)),
        ("henon", [0.1, 0.1], 400_000, (0.4192, None)),
        ("logistic", [0.3], 400_000, (np.log(2.0),)),
        ("cat", [0.1, 0.2], 20_000, (np.log((3 + 5**0.5) / 2), -np.log((3 + 5**0.5) / 2))),
    ],
)
def test_exponents_are_those_that_are_printed(law, start, duration, wanted):
    system = {
        "lorenz": pk.Problem({"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8/3*z"}),
        "roessler": pk.Problem({"x": "-y - z", "y": "x + 0.2*y", "z": "0.2 + z*(x - 5.7)"}),
        "henon": pk.Problem({"x": "1 - 1.4*x^2 + y", "y": "0.3*x"}, map=True),
        "logistic": pk.Problem({"x": "4*x*(1 - x)"}, map=True),
        "cat": pk.Problem({"x": "2*x + y", "y": "x + y"}, map=True, periods={"x": 1.0, "y": 1.0}),
    }[law]
    how = {"n": duration} if system.map else {"duration": duration}
    ds = pk.lyapunov(system, start, **how)
    for value, error, one in zip(
        ds.lyapunov_exponent.values, ds.lyapunov_error.values, wanted, strict=True
    ):
        if one is not None:
            assert value == pytest.approx(one, abs=4.0 * error + 6e-5)
            assert error < 0.02  # of exponents of 0.07 to 15
    total = {"lorenz": -41 / 3, "henon": np.log(0.3), "cat": 0.0}.get(law)
    if total is not None:
        assert ds.lyapunov_sum.item() == pytest.approx(total, abs=1e-9)


def test_a_driven_disk_is_the_same_system_as_a_problem():
    eight = {"A": 1.0, "B": 0.35, "C": 0.12}
    damped = pk.Perturbed(pk.Coefficients(**eight), damping=0.2, forcing=pk.Harmonic(0.1, 1.3))
    same = pk.Problem(
        {
            "phi": "dphi",
            "dphi": "A*sin(phi)*cos(phi) - B*sin(phi) + C*cos(phi) - d*dphi + F*cos(w*t)",
        },
        parameters={**eight, "d": 0.2, "F": 0.1, "w": 1.3},
        periods={"phi": 2 * np.pi}, time="t", period="2*pi/w",
    )  # fmt: skip
    t = np.linspace(0.0, 30.0, 31)
    mine, other = pk.flow(damped, 0.5, 0.3, t), pk.flow(same, [0.5, 0.3], t)
    np.testing.assert_allclose(mine.motion_phi, other.motion_phi, atol=1e-9)
    np.testing.assert_allclose(mine.motion_dphi, other.motion_dphi, atol=1e-9)
    grid = {"phi": np.linspace(-3.0, 3.0, 31), "dphi": np.linspace(-1.5, 1.5, 31)}
    mine, other = pk.basins(damped, **grid), pk.basins(same, grid)
    np.testing.assert_allclose(
        np.sort(mine.attractor_phi[:, 0]), np.sort(other.attractor_phi[:, 0]), atol=1e-8
    )
    errors = mine.basin_fraction_error.values.sum()
    np.testing.assert_allclose(
        np.sort(mine.basin_fraction), np.sort(other.basin_fraction), atol=errors
    )


# ------------------------------------------------------------------ random planar systems


def line(rng):
    """A random line a x + b y = c by whole numbers, as the three of them."""
    while True:
        a, b, c = (int(n) for n in rng.integers(-9, 10, 3))
        if a or b:
            return a, b, c


def meeting(one, other):
    """Where two lines meet, by fractions; None where they are parallel."""
    (a, b, c), (d, e, f) = one, other
    det = a * e - b * d
    return (Fraction(c * e - b * f, det), Fraction(a * f - c * d, det)) if det else None


def kind_by_fractions(slopes):
    """The kind of a rest by its exact derivatives; None where no sign decides."""
    (p, q), (r, s) = slopes
    trace, det = p + s, p * s - q * r
    turns = trace * trace - 4 * det
    if det == 0 or (trace == 0 and det > 0) or turns == 0:
        return None
    if det < 0:
        return KIND.SADDLE
    if trace < 0:
        return KIND.STABLE_FOCUS if turns < 0 else KIND.STABLE_NODE
    return KIND.UNSTABLE_FOCUS if turns < 0 else KIND.UNSTABLE_NODE


def test_rests_of_products_of_lines_have_their_exact_kinds():
    """X' = l1 l2, y' = l3 l4: at rest where a line of the one meets one of the other."""
    rng, seen, box = np.random.default_rng(29), 0, {"x": (-40, 40), "y": (-40, 40)}
    for _ in range(1000 if ALL else 50):
        lines = [line(rng) for _ in range(4)]
        formulas = ["({}*x + {}*y - {})*({}*x + {}*y - {})".format(*one, *other)
                    for one, other in (lines[:2], lines[2:])]  # fmt: skip
        formulas = [text.replace("+ -", "- ").replace("- -", "+ ") for text in formulas]
        wanted = {}
        for i, j in product((0, 1), (2, 3)):
            place = meeting(lines[i], lines[j])
            if place is None or max(map(abs, place)) > 39:
                continue
            mates = [lines[1 - i], lines[5 - j]]
            factors = [a * place[0] + b * place[1] - c for a, b, c in mates]
            slopes = [[k * n for n in own[:2]] for k, own in
                      zip(factors, (lines[i], lines[j]), strict=True)]  # fmt: skip
            wanted.setdefault(place, []).append(kind_by_fractions(slopes))
        plain = all(len(kinds) == 1 and kinds[0] for kinds in wanted.values())
        apart = [np.hypot(*(float(a - b) for a, b in zip(p, q, strict=True)))
                 for p in wanted for q in wanted if p < q]  # fmt: skip
        same = any(meeting(*pair) is None for pair in (lines[:2], lines[2:]))
        if not plain or same or min(apart, default=1.0) < 1e-6:
            continue
        ds = pk.equilibria(pk.Problem(formulas, ("x", "y")), box)
        x, y = ds.x.values.reshape(-1, 2).T
        inside = (np.abs(x) <= 39) & (np.abs(y) <= 39)
        assert inside.sum() == len(wanted), formulas
        assert bool(ds.complete.all()), formulas
        for (a, b), (kind,) in wanted.items():
            k = int(np.argmin(np.hypot(x - float(a), y - float(b))))
            size = max(abs(float(a)), abs(float(b)), 1.0)
            assert np.hypot(x[k] - float(a), y[k] - float(b)) < 1e-9 * size, formulas
            assert ds.kind.values.ravel()[k] == kind, (formulas, a, b)
            seen += 1
    assert seen > (2000 if ALL else 100)


def rings(rng):
    """A random planar system with known cycles: squared radii of circles, sheared and shifted.

    In (u, v) it is r' = s r (a1 - r^2)(a2 - r^2)..., angle' = w.
    """
    count = int(rng.integers(1, 4))
    squares = np.sort(rng.uniform(0.5, 6.0, count))
    while count > 1 and np.diff(squares).min() < 0.6:
        squares = np.sort(rng.uniform(0.5, 6.0, count))
    sign, turn = int(rng.choice([-1, 1])), float(rng.uniform(0.8, 2.0) * rng.choice([-1, 1]))
    growth = "*".join(f"({a!r} - s)" for a in map(float, squares))
    size = 0.05 * sign
    k, x0, y0 = (float(n) for n in rng.uniform(-0.6, 0.6, 3))
    u, v = f"(x - ({x0!r}))", f"(y - ({y0!r}) - ({k!r})*x)"
    s = f"({u}^2 + {v}^2)"
    rate = f"({size!r})*" + growth.replace("s", s)
    du, dv = f"({rate}*{u} - ({turn!r})*{v})", f"({rate}*{v} + ({turn!r})*{u})"
    system = pk.Problem({"x": du, "y": f"{dv} + ({k!r})*{du}"}, window={"x": (-4, 4), "y": (-6, 6)})
    slopes = [-2.0 * size * a * np.prod([b - a for b in squares if b != a]) for a in squares]
    return system, squares, x0, 2 * np.pi / abs(turn), np.array(slopes)


@pytest.mark.parametrize("seed", some(range(4), 4))
def test_cycles_of_random_systems_are_those_built_in(seed):
    rng = np.random.default_rng(seed)
    for _ in range(25 if ALL else 2):
        system, squares, x0, period, slopes = rings(rng)
        ds = pk.periodic_orbits(system)
        assert ds.n_cycles.item() == squares.size, system
        np.testing.assert_allclose(ds.x_max - x0, np.sqrt(squares), rtol=1e-7)
        np.testing.assert_allclose(ds.period, period, rtol=1e-8)
        np.testing.assert_allclose(ds.log_multiplier, slopes * period, rtol=1e-5, atol=1e-7)
        assert ds.n_unstable.values.tolist() == (slopes > 0.0).astype(int).tolist()
