"""Connecting orbits: exact ones, published values, their errors, and what is refused."""

from __future__ import annotations

import pickle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from labelled.algebraic_loops import random_loop
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

import phasekit as pk
from phasekit.cycles import moving
from phasekit.cycles.connections import ends_of
from phasekit.labelled.continuation import connection_guess

LORENZ = {"x": "s*(y - x)", "y": "r*x - y - x*z", "z": "x*y - b*z"}
LOOP = 13.9265574075201275  # by series, 45 digits


def lorenz(**values: float) -> pk.Problem:
    return pk.Problem(LORENZ, parameters={"r": 13.9, "s": 10.0, "b": 8 / 3, **values})


def test_lorenz_closes_at_the_value_of_the_series() -> None:
    loop = pk.connection(lorenz(), ([0, 0, 0], [0, 0, 0]), free="r")
    assert loop.kind == "connection"
    assert "at r = 13.9265574, looked for from r = 13.9;" in loop.stops[0].message
    assert float(loop.points.r[0]) == pytest.approx(LOOP, rel=1e-12)
    assert float(loop.points.truncation_error[0]) < 1e-12
    r = LOOP
    leading = (-11 + np.sqrt(121 + 40 * (r - 1))) / 2
    assert float(loop.points.saddle_value[0]) == pytest.approx(leading - 8 / 3, rel=1e-10)
    orbit = loop.orbit(0)
    assert abs(orbit.x.values[0]) < 1e-5
    assert repr(loop).startswith("<Branch of connections: 1 point, r = 13.9266")
    assert pickle.loads(pickle.dumps(loop)) == loop


@pytest.mark.parametrize("ends", [1e-2, 1e-3, 1e-4])
def test_error_of_truncation_is_what_a_longer_time_changes(ends: float) -> None:
    """At twice the time the distance of the ends is squared, and the error its square again."""
    near = {"ends": ends, "options": pk.ContinuationOptions(mesh_tolerance=1e-11)}
    problem = pk.Problem(
        {"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}, parameters={"c": 0.28, "a": 0.3}
    )
    short = pk.connection(problem, ([0, 0], [1, 0]), free="c", **near)
    error = abs(float(short.points.c[0]) - np.sqrt(2) * 0.2)
    said = float(short.points.truncation_error[0])
    assert error == pytest.approx(said, rel=0.2, abs=1e-13)
    long = pk.connection(lorenz(), ([0, 0, 0], [0, 0, 0]), free="r", ends=ends / 10)
    error = abs(float(long.points.r[0]) - LOOP)
    assert error == pytest.approx(float(long.points.truncation_error[0]), rel=0.05, abs=1e-10)


def test_family_of_cycles_goes_on_as_its_homoclinic_orbit() -> None:
    problem = lorenz(r=20.0)
    state = np.sqrt(8 / 3 * 19)
    rest = pk.continuation(problem, "r", x0=[state, state, 19.0], span=(10, 30))
    cycles = rest.special("H")[0].switch()
    (end,) = [stop for stop in cycles.stops if stop.reason == "homoclinic"]
    loop = end.connection()
    assert float(loop.points.r[0]) == pytest.approx(LOOP, rel=1e-11)


@pytest.mark.parametrize(
    ("problem", "ends", "free", "value"),
    [
        (
            pk.Problem(
                {"x": "y", "y": "x*(1 - z) - la*y", "z": "-al*z + x^2"},
                parameters={"la": 1.2, "al": 0.4},
            ),
            ([0, 0, 0], [0, 0, 0]), "la", 1.205391102421,
        ),
        (
            pk.Problem(
                {
                    "x": "(-(be + nu)*x + be*y - a3*x^3 + b3*(y - x)^3)/r",
                    "y": "be*x - be*y - z - b3*(y - x)^3", "z": "y",
                },
                parameters={"nu": -0.7213, "be": 0.6, "r": 0.6, "a3": 0.328578, "b3": 0.933578},
            ),
            ([0, 0, 0], [0, 0, 0]), "nu", -0.721309250378,
        ),
        (
            pk.Problem(
                {
                    "x": "a*x + b*y - a*x^2 + (mut - al*z)*x*(2 - 3*x)",
                    "y": "b*x + a*y - 1.5*b*x^2 - 1.5*a*x*y - (mut - al*z)*2*y",
                    "z": "-2*z + mu*x + al*be*(x^2*(1 - x) - y^2)",
                },
                parameters={"mut": 0.06, "a": 0.5, "b": 3.0, "al": 1.0, "be": 0.0, "mu": 0.25},
            ),
            ([0, 0, 0], [0, 0, 0]), "mut", 0.067326217055,
        ),
    ],
    ids=["Shimizu-Morioka", "Freire", "Sandstede"],
)  # fmt: skip
def test_published_loops(problem, ends, free: str, value: float) -> None:
    loop = pk.connection(problem, ends, free=free)
    assert float(loop.points[free][0]) == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize(("a", "b", "al"), [(0.0, 1.0, 0.3), (0.5, 3.0, 1.0), (-0.3, 1.5, -0.7)])
def test_loops_of_sandstede_are_exact(a: float, b: float, al: float) -> None:
    problem = pk.Problem(
        {
            "x": "a*x + b*y - a*x^2 + (mut - al*z)*x*(2 - 3*x)",
            "y": "b*x + a*y - 1.5*b*x^2 - 1.5*a*x*y - (mut - al*z)*2*y",
            "z": "-2*z + al*(x^2*(1 - x) - y^2)",
        },
        parameters={"mut": 0.001, "a": a, "b": b, "al": al},
    )
    loop = pk.connection(problem, ([0, 0, 0], [0, 0, 0]), free="mut")
    assert float(loop.points.mut[0]) == pytest.approx(0.0, abs=1e-12)


def test_t_point_of_lorenz_takes_two_parameters() -> None:
    problem = lorenz(s=10.2, r=30.9)
    state = -np.sqrt(8 / 3 * 29.9)
    ends = ([0, 0, 0], [state, state, 29.9])
    point = pk.connection(problem, ends, free=("s", "r"))
    assert float(point.points.s[0]) == pytest.approx(10.16728945482, abs=1e-10)
    assert float(point.points.r[0]) == pytest.approx(30.86808746815, abs=1e-10)
    with pytest.raises(pk.ParameterError, match="2 free parameters"):
        pk.connection(problem, ends, free="s")


@pytest.mark.parametrize(
    ("s", "mu"),
    [
        (0.5, 0.163874780850),
        pytest.param(0.859097, 0.387299642952, marks=pytest.mark.slow),
        pytest.param(0.158178, 0.012847760951, marks=pytest.mark.slow),
    ],
)
def test_shearing_connects_in_five_dimensions(s: float, mu: float) -> None:
    problem = pk.Problem(
        {
            "a": "a*b + a*mu - c*d", "b": "-(a^2 + b)", "c": "c*mu + a*d - 9*s*c/(4*(s + 1))",
            "d": "(-s*d + 3*a*c*(1 + 1/s))/4", "e": "z*(d - e)/4",
        },
        parameters={"mu": 1.0001 * mu, "s": s, "z": 0.2},
    )  # fmt: skip
    first = [np.sqrt(1.0001 * mu), -1.0001 * mu, 0, 0, 0]
    front = pk.connection(problem, (first, [0, 0, 0, 0, 0]), free="mu")
    assert float(front.points.mu[0]) == pytest.approx(mu, abs=1e-10)


def test_reversible_orbit_is_exact() -> None:
    problem = pk.Problem(
        {"u": "v", "v": "w", "w": "z", "z": "-P*w - u + u^3 + d*v"},
        parameters={"P": -2.5, "d": 0.0},
    )
    t = np.linspace(-30, 30, 2001)
    u = np.sqrt(15 / 8) / np.cosh(t / np.sqrt(8)) ** 2
    v = np.gradient(u, t)
    w = np.gradient(v, t)
    states = {"u": u, "v": v, "w": w, "z": np.gradient(w, t)}
    guess = xr.Dataset({name: ("time", x) for name, x in states.items()}, {"time": t})
    loop = pk.connection(problem, guess, free="d")
    assert float(loop.points.d[0]) == pytest.approx(0.0, abs=1e-12)
    assert float(loop.points.u_max[0]) == pytest.approx(np.sqrt(15 / 8), abs=1e-11)


@pytest.mark.parametrize("system", [pk.Coefficients(2.0, 1.0, 0.3), pk.Coefficients(3, 0.5, -0.2)])
def test_lobes_and_turns_are_those_of_separatrices(system: pk.Coefficients) -> None:
    exact = pk.separatrices(system)
    for saddle in ("lower", "upper"):
        phi = float(exact.saddle_phi.sel(saddle=saddle))
        if int(exact.loop.sel(saddle=saddle)) == 1:
            loop = pk.connection(system, ([phi, 0], [phi, 0]))
            turning = exact.turning_phi.sel(saddle=saddle).values
            extreme = [float(loop.points.phi_min[0]), float(loop.points.phi_max[0])]
            assert min(abs(turning[0] - extreme[0]), abs(turning[1] - extreme[1])) < 1e-10
        else:
            loop = pk.connection(system, ([phi, 0], [phi + 2 * np.pi, 0]))
            area = float(exact.winding_area.sel(saddle=saddle))
            orbit = loop.orbit(0)
            found = np.trapezoid(orbit.dphi.values, orbit.phi.values)
            assert found == pytest.approx(area, rel=1e-3)
        assert float(loop.points.unfolding[0]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("mu", "reach"), [(0.25, 3.0), (1.0, 4.0), (0.1, 1.0)])
def test_ramp_tips_at_its_exact_rate(mu: float, reach: float) -> None:
    exact = 4 * mu / (reach * (reach - 2 * np.sqrt(mu)))
    ramp = pk.Problem(
        {"x": "(x + l)^2 - mu", "l": "r*l*(L - l)"},
        parameters={"mu": mu, "L": reach, "r": 1.2 * exact},
    )
    root = np.sqrt(mu)
    front = pk.connection(ramp, ([-root, 0], [root - reach, reach]), free="r")
    assert float(front.points.r[0]) == pytest.approx(exact, abs=1e-12)
    still = pk.Problem({"x": "(x + l)^2 - mu"}, parameters={"l": 0.0, "mu": mu})
    ends = {"x": -root, "l": 0.0}, {"x": root - reach, "l": reach}
    more = {"rate": "r", "parameters": {"r": 1.2 * exact, "L": reach}}
    tipping = pk.critical_rate(still, {"l": "r*l*(L - l)"}, *ends, **more)
    assert float(tipping.points.r[0]) == pytest.approx(exact, abs=1e-12)
    with pytest.raises(pk.ParameterError, match="edge: got"):
        pk.critical_rate(still, {"l": "r*l*(L - l)"}, ends[0], ends[0], **more)
    with pytest.raises(pk.ParameterError, match="at an end of the ramp"):
        pk.critical_rate(still, {"l": "r*l*(L + 1 - l)"}, *ends, **more)
    with pytest.raises(pk.ParameterError, match="at an end of the ramp"):  # however slow it is
        pk.critical_rate(still, {"l": "1e-12*r*l*(L + 1 - l)"}, *ends, **more)


@pytest.mark.parametrize(
    ("damping", "ratio"), [(0.05, 1.272451724), (0.1, 1.270088598), (0.2, 1.260641222)]
)
def test_rotations_begin_at_the_critical_current(damping: float, ratio: float) -> None:
    values = {"al": damping, "I": 1.27 * damping}
    rotor = pk.Problem({"phi": "v", "v": "I - al*v - sin(phi)"}, parameters=values)
    saddle = np.pi - np.arcsin(1.27 * damping)
    loop = pk.connection(rotor, ([saddle - 2 * np.pi, 0], [saddle, 0]), free="I")
    found = float(loop.points.I[0]) / damping
    assert found == pytest.approx(ratio, abs=1e-8)
    # Melnikov's 4/pi is the limit; the difference goes with the square of the damping.
    assert (found - 4 / np.pi) / damping**2 == pytest.approx(-0.315, abs=5e-3)


def test_curve_of_shimizu_and_morioka_is_neutral_at_one_point() -> None:
    problem = pk.Problem(
        {"x": "y", "y": "x*(1 - z) - la*y", "z": "-al*z + x^2"},
        parameters={"la": 1.2, "al": 0.4},
    )
    curve = pk.connection(problem, ([0, 0, 0], [0, 0, 0]), free="la").curve("al", (0.3, 0.8))
    (point,) = curve.special("NSS")
    assert point["al"] == pytest.approx(0.605857764842, abs=1e-10)
    assert point["la"] == pytest.approx(1.044694655263, abs=1e-10)


def _leading_part_of_normal(al: float) -> float:
    """Of the exact loop of Sandstede's system with a = 0, b = be = 1, c = -2, by shooting.

    Beside it H = x^2 (1 - x) - y^2 and z form a linear system of their own: H' = -al s z,
    z' = -2 z + al H with s = x^2 (8 - 16 x + 9 x^2). Of the normal p dH + q dz as t -> -oo the part
    of the leading rate is what is left of p besides that which goes with q = e^(2 t).
    """

    def adjoint(t: float, u: np.ndarray) -> list[float]:
        x = 1.0 / np.cosh(t / 2.0) ** 2
        return [-al * u[1], 2.0 * u[1] + al * x * x * (8.0 - 16.0 * x + 9.0 * x * x) * u[0]]

    found = solve_ivp(adjoint, (15.0, -15.0), [1.0, 0.0], rtol=1e-11, atol=1e-14, method="DOP853")
    p, q = found.y[:, -1]
    return float(p + 0.5 * al * q)


def test_inclination_flips_are_where_the_exact_normal_turns() -> None:
    problem = pk.Problem(
        {
            "x": "y + (mut - al*z)*x*(2 - 3*x)",
            "y": "x - 1.5*x^2 - (mut - al*z)*2*y",
            "z": "-2*z + mu*x + al*(x^2*(1 - x) - y^2)",
        },
        parameters={"mut": 0.001, "al": 1.2, "mu": 0.0},
    )
    loop = pk.connection(problem, ([0, 0, 0], [0, 0, 0]), free="mut")
    coarse = pk.ContinuationOptions(intervals=60)
    exact = brentq(_leading_part_of_normal, 1.2, 1.4, xtol=1e-12)
    (flip,) = loop.curve("al", (1.2, 1.4), options=coarse).special("IFS")
    assert flip["al"] == pytest.approx(exact, abs=1e-9)
    # Backwards in time the stable manifold is the unstable one.
    back = pk.Problem(
        {name: f"-({f})" for name, f in zip("xyz", problem.f, strict=True)},
        parameters={**problem.parameters, "al": 1.2},
    )
    loop = pk.connection(back, ([0, 0, 0], [0, 0, 0]), free="mut")
    (flip,) = loop.curve("al", (1.2, 1.4), options=coarse).special("IFU")
    assert flip["al"] == pytest.approx(exact, abs=1e-9)


def test_orbit_flip_of_sandstede_is_exact() -> None:
    """Beside a loop in the plane, with z' = -2 z + mu x: e^(-2 t) leads, unless mu = 0."""
    problem = pk.Problem(
        {
            "x": "x/2 + 3*y - x^2/2 + mut*x*(2 - 3*x)",
            "y": "3*x + y/2 - 4.5*x^2 - 0.75*x*y - mut*2*y", "z": "-2*z + mu*x",
        },
        parameters={"mut": 0.001, "mu": 0.2},
    )  # fmt: skip
    loop = pk.connection(problem, ([0, 0, 0], [0, 0, 0]), free="mut")
    curve = loop.curve("mu", (-0.1, 0.2), options=pk.ContinuationOptions(intervals=60))
    (flip,) = curve.special("OFS")
    assert [flip["mu"], flip["mut"]] == pytest.approx([0.0, 0.0], abs=1e-10)
    # The plane is all that the other manifold leaves: its normal has no part along z anywhere.
    assert not curve.special("IFS")


@pytest.fixture(scope="module")
def loop_of_freire() -> pk.ConnectionBranch:
    problem = pk.Problem(
        {
            "x": "(-(be + nu)*x + be*y - a3*x^3 + b3*(y - x)^3)/r",
            "y": "be*x - be*y - z - b3*(y - x)^3", "z": "y",
        },
        parameters={"nu": -0.7213, "be": 0.6, "r": 0.6, "a3": 0.328578, "b3": 0.933578},
    )  # fmt: skip
    return pk.connection(problem, ([0, 0, 0], [0, 0, 0]), free="nu")


@pytest.mark.slow
def test_curve_of_freire_ends_at_its_bogdanov_takens_point(
    loop_of_freire: pk.ConnectionBranch,
) -> None:
    """AUTO prints six digits of its special points."""
    forward = pk.ContinuationOptions(mesh_tolerance=1e-9, directions="forward")
    curve = loop_of_freire.curve("be", (0.5, 1.2), options=forward)
    assert curve.stops[1].reason == "bogdanov_takens"
    np.testing.assert_allclose(
        [float(curve.points.nu[-1]), float(curve.points.be[-1])], [-0.77467, 0.77461], atol=5e-4
    )
    (double,) = curve.special("DRS")
    assert [double["nu"], double["be"]] == pytest.approx([-0.7590583, 0.7428734], abs=1e-5)


@pytest.mark.slow
def test_curve_of_freire_does_not_go_back_on_itself(loop_of_freire: pk.ConnectionBranch) -> None:
    """Along it both ends stay foci, whose spirals come by the same plain distance several times."""
    problem = loop_of_freire.problem
    backward = pk.ContinuationOptions(directions="backward", max_points=900)
    curve = loop_of_freire.curve("be", (0.2, 1.2), options=backward)
    assert curve.points.sizes["point"] > 100
    assert np.all(np.diff(curve.points.be) > 0.0)
    assert curve.stops[0].reason == "bound"
    (focus,) = curve.special("NSF")  # as AUTO prints it
    assert [focus["nu"], focus["be"]] == pytest.approx([-0.7204001, 0.5912315], abs=3e-5)
    (neutral,) = curve.special("NDS")

    # There twice the real part of the pair is minus the other eigenvalue.
    def divergence(nu: float, be: float) -> float:
        A = [[-(be + nu) / 0.6, be / 0.6, 0.0], [be, -be, -1.0], [0.0, 1.0, 0.0]]
        values = sorted(np.linalg.eigvals(A), key=lambda one: one.real)
        return float(2 * values[0].real + values[-1].real)

    assert divergence(neutral["nu"], neutral["be"]) == pytest.approx(0.0, abs=1e-8)
    at = pk.Problem(dict(zip("xyz", problem.f, strict=True)), parameters={
        **problem.parameters, "be": neutral["be"], "nu": neutral["nu"],
    })  # fmt: skip
    again = pk.connection(at, ([0, 0, 0], [0, 0, 0]), free="nu")
    assert float(again.points.nu[0]) == pytest.approx(neutral["nu"], abs=1e-9)


def test_curve_of_fronts_is_exact(tmp_path: Path) -> None:
    problem = pk.Problem(
        {"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}, parameters={"c": 0.28, "a": 0.3}
    )
    curve = pk.connection(problem, ([0, 0], [1, 0]), free="c").curve("a", (-0.1, 0.45))
    assert [stop.reason for stop in curve.stops] == ["non_central_saddle_node", "bound"]
    assert float(curve.points.a[0]) == pytest.approx(0.0, abs=1e-10)  # where u = 0 is no saddle
    np.testing.assert_allclose(curve.points.c, np.sqrt(2) * (0.5 - curve.points.a), atol=1e-11)
    assert float(curve.points.truncation_error.max()) < 1e-12
    assert pickle.loads(pickle.dumps(curve)) == curve
    curve.save(tmp_path / "fronts.nc")
    loaded = pk.Branch.load(tmp_path / "fronts.nc")
    assert loaded == curve
    assert isinstance(loaded, pk.ConnectionBranch)
    longer = {"bounds": {"a": (-0.1, 0.6)}}
    assert loaded.extend(20, **longer) == curve.extend(20, **longer)


def test_an_eigenvalue_that_turns_back_near_zero_is_no_end() -> None:
    """Of the nodal cubic y^2 = x^2 (1 - x), t' = (t^2 - 1) (1 + b t) with t = y/x, x = 1 - t^2.

    Its saddle has 2 (b +- 1): along the curve their ratio comes to 180, and goes back.
    """
    b = "h*(1 - s^2)"
    rate = [f"2*y + 2*{b}*x*(1 - x)", f"(2 - 3*x)*(x + {b}*y)"]
    problem = pk.Problem(
        {"x": f"{rate[0]} - p*({rate[1]})", "y": f"{rate[1]} + p*({rate[0]})"},
        parameters={"s": 0.75, "h": 0.989, "p": 0.001},
    )
    loop = pk.connection(problem, ([0, 0], [0, 0]), free="p")
    few = pk.ContinuationOptions(mesh_tolerance=1e-7, directions="backward")
    curve = loop.curve("s", (-0.01, 0.8), options=few)
    assert curve.stops[0].reason == "bound"
    np.testing.assert_allclose(curve.points.p, 0.0, atol=1e-10)


def test_no_front_of_another_equilibrium_is_said_to_be_the_one() -> None:
    """At a = 3e-8 the front from u = a is 6e-8 off; its end is nearer to u = 0 than 1e-7."""
    nagumo = {"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}
    problem = pk.Problem(nagumo, parameters={"c": 0.71, "a": 3e-8})
    with pytest.raises(pk.ConvergenceError, match="another equilibrium is nearer"):
        pk.connection(problem, ([0, 0], [1, 0]), free="c")


@pytest.mark.parametrize("b", [0.999, -0.999])
def test_loops_with_a_weak_eigenvalue_are_found_from_their_saddle(b: float) -> None:
    rate = ["2*y + 2*b*x*(1 - x)", "(2 - 3*x)*(x + b*y)"]  # rates 2 (b +- 1), as above
    problem = pk.Problem(
        {"x": f"{rate[0]} - p*({rate[1]})", "y": f"{rate[1]} + p*({rate[0]})"},
        parameters={"b": b, "p": 0.01},
    )
    loop = pk.connection(problem, ([0, 0], [0, 0]), free="p")
    assert float(loop.points.p[0]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("p", [0.003, -0.003])
def test_a_loop_of_a_figure_of_eight_is_found_where_motions_grow_without_bound(p: float) -> None:
    """Outside the lemniscate of p = 0 motions are infinite in finite time."""
    curve = "((x^2 + y^2)^2 - x^2 + y^2)"
    rate = [
        f"-(4*y*(x^2 + y^2) + 2*y) + {curve}*(0.3*x - 0.4*y + 0.2)",
        f"4*x*(x^2 + y^2) - 2*x + {curve}*(0.5*x + 0.6*y - 0.5)",
    ]
    problem = pk.Problem(
        {"x": f"{rate[0]} - p*({rate[1]})", "y": f"{rate[1]} + p*({rate[0]})"}, parameters={"p": p}
    )
    loop = pk.connection(problem, ([0, 0], [0, 0]), free="p")
    assert float(loop.points.p[0]) == pytest.approx(0.0, abs=1e-12)
    orbit = loop.orbit(0)
    assert float(abs(orbit.x).max()) == pytest.approx(1.0, abs=1e-4)


def test_both_loops_of_a_saddle_are_found_and_the_other_one_is_announced() -> None:
    """Of u'' = u - u^3 + p u': p = 0, and u = +-sqrt(2) sech t."""
    problem = pk.Problem({"x": "y", "y": "x - x^3 + p*y"}, parameters={"p": 0.001})
    saddle = [0.0, 0.0]
    for from_ in (saddle, [0.2, 0.2], [-0.2, -0.2]):
        loop = pk.connection(problem, (from_, saddle), free="p")
        assert float(loop.points.p[0]) == pytest.approx(0.0, abs=1e-12)
        sides = {"right": float(loop.points.x_max[0]), "left": -float(loop.points.x_min[0])}
        side = max(sides, key=lambda one: sides[one])
        assert sides[side] == pytest.approx(np.sqrt(2), abs=1e-4)
        assert min(sides.values()) < 1e-6
        if from_ != saddle:
            assert side == ("right" if from_[0] > 0.0 else "left")
        said = loop.stops[0].message
        assert "another orbit" in said
        other = [float(x) for x in said.split("[")[1].split("]")[0].split(",")]
        assert (other[0] > 0.0) == (side == "left")


@pytest.mark.slow
@pytest.mark.parametrize("still", [{}, {"z": "-3*z"}])
def test_a_family_round_both_loops_of_a_saddle_leads_to_one(still: dict[str, str]) -> None:
    """By the symmetry of u'' = u - u^3 + u' (p - u^2) its largest cycle ends on both loops."""
    problem = pk.Problem({"x": "y", "y": "x - x^3 + y*(p - x^2)", **still}, parameters={"p": 0.815})
    saddle = [0.0, 0.0, *(0.0 for _ in still)]
    cycles = pk.continuation(
        problem, "p", orbit=pk.periodic_orbit(problem, [1.6, *saddle[1:]]), span=(0.5, 0.9)
    )
    (end,) = [stop for stop in cycles.stops if stop.reason == "homoclinic"]
    assert float(cycles.points.x_min[end.side]) < -1.4
    found = end.connection()
    assert "passes its equilibrium 2 times" in found.stops[0].message
    alone = pk.connection(problem, (saddle, saddle), free="p")
    assert float(found.points.p[0]) == pytest.approx(float(alone.points.p[0]), abs=1e-11)
    assert float(abs(found.orbit(0).x).min()) < 1e-6


def test_the_other_loop_is_told_where_states_are_far_from_0() -> None:
    problem = pk.Problem(
        {"x": "y - s", "y": "x - s - (x - s)^3 + p*(y - s)"}, parameters={"p": 0.001, "s": 1e3}
    )
    loop = pk.connection(problem, ([1e3, 1e3], [1e3, 1e3]), free="p")
    sides = [float(loop.points.x_max[0] - 1e3) > 1.0]
    told = [float(x) for x in loop.stops[0].message.split("[")[1].split("]")[0].split(",")]
    other = pk.connection(problem, (told, [1e3, 1e3]), free="p")
    sides.append(float(other.points.x_max[0] - 1e3) > 1.0)
    assert sorted(sides) == [False, True]


@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-9, 1e-3])
def test_states_next_to_a_saddle_tell_it(off: float) -> None:
    problem = pk.Problem({"x": "y", "y": "x - x^2 + m*y + x*y"}, parameters={"m": -0.85})
    loop = pk.connection(problem, ([off, 0.0], [off, 0.0]), free="m")
    assert float(loop.points.m[0]) == pytest.approx(-0.864545247, abs=1e-8)


def test_an_orbit_of_two_humps_is_exact_by_its_symmetry() -> None:
    """Backwards in time x -> -x changes the sign of p alone; p = 0 of a loop round both sides."""
    problem = pk.Problem({"x": "y", "y": "x - x^3 + y*(p + 0.3*x)"}, parameters={"p": 1e-4})
    loop = pk.connection(problem, ([0, 0], [0, 0]), free="p")
    assert float(loop.points.p[0]) == pytest.approx(0.0, abs=1e-12)
    x = loop.orbit(0).x.values
    assert x.min() == pytest.approx(-x.max(), abs=1e-4)
    assert x.max() > 1.5


def test_what_cannot_be_connected_is_refused() -> None:
    forced = pk.Problem(
        {"x": "y", "y": "x - x^3 + a*cos(t)"}, parameters={"a": 0.1}, time="t", period=2 * np.pi
    )
    with pytest.raises(pk.ParameterError, match="connections to cycles are not followed"):
        pk.connection(forced, ([0, 0], [0, 0]), free="a")
    with pytest.raises(pk.ParameterError, match="orbit: got"):
        pk.connection(lorenz(), 3.0, free="r")
    with pytest.raises(pk.ParameterError, match="free: got"):
        pk.connection(lorenz(), ([0, 0, 0], [0, 0, 0]))
    with pytest.raises(pk.ParameterError, match="ends: got"):
        pk.connection(lorenz(), ([0, 0, 0], [0, 0, 0]), free="r", ends=1.0)
    center = pk.Problem({"x": "y", "y": "-x + a*x^2"}, parameters={"a": 1.0})
    with pytest.raises(pk.ParameterError, match="hyperbolic|no unstable"):
        pk.connection(center, ([0, 0], [0, 0]), free="a")


@pytest.mark.parametrize("formula", ["x^4/4 - x^2/2", "x^3/3 - x^2/2", "x^4/8 + x^3/3 - x^2/2"])
def test_loops_of_potentials_move_as_their_separatrices(formula: str) -> None:
    system = pk.Potential(formula, "x")
    fine = pk.ContinuationOptions(mesh_tolerance=1e-12)
    loop = pk.connection(system, ([0, 0], [0, 0]), options=fine)
    orbit, (place, rate) = loop.orbit(0), loop.problem.state
    ends = slice(None, None, 4)  # of the mesh intervals, where collocation is the most accurate
    t, x, v = (orbit[name].values[ends] for name in ("time", place, rate))
    force = np.array([loop.problem.derivatives(state)[0][1] for state in np.stack([x, v], 1)])
    far = int(np.argmax(np.abs(x)))
    speed = CubicHermiteSpline(t, v, force)
    turning = brentq(speed, t[far - 1], t[far + 1], xtol=1e-15)
    side = "right" if x[far] > 0.0 else "left"
    exact = pk.separatrix_motion(system, t - turning, side=side)
    np.testing.assert_allclose(v, exact.motion_dphi, atol=1e-10)
    np.testing.assert_allclose(x, exact.motion_phi, atol=1e-10)


@pytest.mark.parametrize(
    ("k", "near", "exact"),
    [
        (-0.15, -1.851185, -1.8511851232986621635),
        pytest.param(-0.15, -1.84, -1.8511851232986621635, marks=pytest.mark.slow),
        (-0.1760749, -1.82547, -1.8254697967508212107),
    ],
)
def test_loop_beside_a_fold_is_where_its_manifold_changes_sides(
    k: float, near: float, exact: float
) -> None:
    """Koper's model, by bisection of its unstable manifold in Taylor series of 40 digits."""
    problem = pk.Problem(
        {"x": "10*(k*y - x^3 + 3*x - l)", "y": "x - 2*y + z", "z": "y - z"},
        parameters={"k": k, "l": near},
    )
    loop = pk.connection(problem, ([-0.959] * 3, [-0.959] * 3), free="l")
    assert float(loop.points.l[0]) == pytest.approx(exact, abs=1e-14)


def test_predator_and_prey_with_a_weak_eigenvalue() -> None:
    problem = pk.Problem(
        {
            "x": "x*(1 - x/K)/2 - 0.4*x*y/(0.6 + x) + 0.01*K",
            "y": "0.24*x*y/(0.6 + x) - 0.15*y - Z*y^2/(y^2 + 0.25)",
        },
        parameters={"K": 9.17683, "Z": 0.0768},
    )
    loop = pk.connection(problem, ([8.879, 0.6294], [8.879, 0.6294]), free="Z")
    assert float(loop.points.Z[0]) == pytest.approx(0.0767873656086, abs=1e-11)
    assert float(loop.points.leading_unstable[0]) < 0.02


@pytest.mark.parametrize("free", [(), [], 3.0])
def test_a_connection_frees_a_parameter(free: object) -> None:
    front = pk.Problem({"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}, parameters={"c": 0.3, "a": 0.3})
    with pytest.raises(pk.ParameterError, match="free: got .*, wants one or more names"):
        pk.connection(front, ([0, 0], [1, 0]), free=free)


@pytest.mark.parametrize("seed", [3, pytest.param(30018, marks=pytest.mark.slow)])
def test_loops_on_algebraic_curves_are_found_from_guesses_and_manifolds(seed: int) -> None:
    random = np.random.default_rng(seed)
    loop = random_loop(random)
    turned = loop.problem.replace(p=0.01)
    saddle = loop.saddle
    for orbit in (loop.guess(random, 0.02), (saddle, saddle)):
        found = pk.connection(turned, orbit, free="p")
        assert float(found.points.p[0]) == pytest.approx(0.0, abs=1e-11)
        assert loop.off(found.orbit(0)) < 1e-10
        assert ends_of(found.walker.curve).same  # curves of loops alone end where these shrink


def test_samples_whose_times_do_not_differ_are_left_out() -> None:
    time = np.sort(np.append(np.linspace(0.0, 2.0, 81), [0.5, 1.0 + 2e-16, 2.0]))
    x = np.stack([np.sin(time), np.cos(time)], axis=1)
    trial = SimpleNamespace(m=4)
    orbit = connection_guess._through(trial, time, x, np.array([2.0, 0.1]))  # noqa: SLF001
    assert orbit.y.tolist() == [2.0, 0.1]
    ends = np.stack([np.sin(2.0 * orbit.mesh), np.cos(2.0 * orbit.mesh)], axis=1)
    np.testing.assert_allclose(orbit.x[::4], ends, atol=1e-3)


def test_a_neutral_saddle_is_found_far_from_the_origin() -> None:
    """States far larger than the loop are no reason to end it elsewhere."""
    random = np.random.default_rng(272)
    loop = random_loop(random)
    random.choice(2), random.uniform()  # what the script draws first
    found = pk.connection(loop.problem.replace(p=0.002), loop.guess(random, 0.02), free="p")
    curve = found.curve("q", (-1.0, 1.0))
    (point,) = curve.special("NSS")
    assert point["q"] == pytest.approx(loop.neutral, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [70043, 70048])
def test_curves_begin_however_f_is_rounded_and_however_long_intervals_are(seed: int) -> None:
    """Time is long in the first, which has to be cut; terms of f cancel in the second."""
    random = np.random.default_rng(seed)
    loop = random_loop(random)
    found = pk.connection(loop.problem.replace(p=0.002), loop.guess(random, 0.02), free="p")
    curve = found.curve("q", (-0.05, 0.05))
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
    np.testing.assert_allclose(curve.points.p, 0.0, atol=1e-11)


def test_an_orbit_that_rests_between_its_ends_is_no_connection() -> None:
    """So long a guess is filled by passing another saddle, over steps too long to see it leave."""
    loop = random_loop(np.random.default_rng(0))
    time = np.linspace(0.0, 1.0, len(loop.time))
    states = loop.states + 0.02 * np.ptp(loop.states, axis=0) * np.sin(np.pi * time)[:, None]
    guess = xr.Dataset(
        {"x": ("time", states[:, 0]), "y": ("time", states[:, 1])}, {"time": loop.time}
    )
    try:
        found = pk.connection(loop.problem.replace(p=-0.03), guess, free="p")
    except pk.ConvergenceError:
        return
    assert float(found.points.p[0]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("s", [1e-15, 1e9])
def test_a_front_is_found_in_any_units(s: float) -> None:
    """Nagumo's, whose speed is sqrt(2) (1/2 - a), with u in units of s."""
    formulas = {"u": "v", "v": "c*v - u*(1 - u/s)*(u/s - a)"}
    nagumo = pk.Problem(formulas, parameters={"c": 0.3, "a": 0.3, "s": s})
    front = pk.connection(nagumo, ([0, 0], [s, 0]), free="c")
    assert float(front.points.c[0]) == pytest.approx(0.2 * np.sqrt(2), abs=1e-9)


def test_orbits_are_followed_across_themselves_whatever_their_pulse_does_in_time() -> None:
    """What only moves an orbit in time has no length; its part across it stays what it is."""
    nagumo = {"u": "v", "v": "c*v - u*(1 - u)*(u - a)"}
    problem = pk.Problem(nagumo, parameters={"c": 0.3, "a": 0.3})
    bounded = pk.connection(problem, ([0, 0], [1, 0]), free="c").walker.curve
    orbit = pk.connection(problem, ([0, 0], [1, 0]), free="c").path[0].orbit
    u, v = orbit.x.T  # the front is v = u (1 - u)/sqrt(2)
    along = orbit.y[0] * np.stack([v, 0.2 * 2**0.5 * v - u * (1 - u) * (u - 0.3)], axis=1)
    nothing = np.zeros(len(orbit.y))
    assert moving.length(bounded, orbit, along, nothing) < 1e-8 * bounded.length(
        orbit.mesh, along, nothing
    )
    across = np.stack(
        [-along[:, 1] * bounded.scale[0] ** 2, along[:, 0] * bounded.scale[1] ** 2], 1
    )
    both = moving.tangent(bounded, orbit, across + 3.0 * along, nothing)
    np.testing.assert_allclose(both.across, across, atol=1e-9 * np.abs(across).max())
