"""Eigenvalues that cross the axis within one step, at places that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.continuation.crowds import (
    Steps,
    crowded,
    doubtful,
    doubtful_of_all,
    falls,
)
from phasekit.systems.problem_parts import equilibrium_curve


def special(f, at):
    branch = pk.continuation(
        pk.Problem(f, parameters={"p": 0.0}), "p", x0=np.zeros(len(f)), span=(0.0, 1.0)
    )
    kinds = {"hopf": "hopf", "pitchfork": "crossing", "branch_point": "crossing"}
    found = [one for one in branch.special_points if one.kind in kinds]
    assert all(one.status == "converged" for one in found)
    got = sorted((one["p"], kinds[one.kind]) for one in found)
    assert [kind for _, kind in got] == [kind for _, kind in sorted(at)]
    assert np.allclose([p for p, _ in got], [p for p, _ in sorted(at)], rtol=0.0, atol=1e-9)


def system(growths):
    """Decoupled unknowns x' = g x - x^3, and pairs (g, w) that turn with w."""
    f = {}
    for k, (growth, turns) in enumerate(growths):
        if turns:
            f[f"x{k}"] = f"({growth})*x{k} - {turns}*y{k} - x{k}^3"
            f[f"y{k}"] = f"({growth})*y{k} + {turns}*x{k} - y{k}^3"
        else:
            f[f"x{k}"] = f"({growth})*x{k} - x{k}^3"
    return f


def places(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    near = np.sort(rng.choice(np.arange(-20, 21), count, replace=False)) * 1e-3
    return rng, rng.uniform(0.15, 0.85) + near


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_all_that_cross_within_a_step_are_found(seed):
    rng, at = places(seed)
    growths, known = [], []
    for place in at.tolist():
        turns = float(rng.uniform(0.5, 3.0)) if rng.random() < 0.4 else 0.0
        growths.append((f"{rng.choice([-1, 1])}*(p - {place!r})", turns))
        known.append((place, "hopf" if turns else "crossing"))
    special(system(growths), known)


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0.0, 2.0])
@pytest.mark.parametrize(("place", "width", "beside"), [
    (0.6897, 0.0032, 0.7091), (0.6369, 0.0014, 0.6179), (0.2795, 0.0023, None),
    (0.6306, 0.0096, 0.6479),
])  # fmt: skip
def test_one_that_crosses_and_returns_is_found_twice(place, width, beside, turns):
    growths = [(f"-16*(p - {place!r})*(p - {place + width!r})", turns)]
    kind = "hopf" if turns else "crossing"
    known = [(place, kind), (place + width, kind)]
    if beside:
        growths.append((f"p - {beside!r}", 0.0))
        known.append((beside, "crossing"))
    else:
        growths.append(("-1 - p", 0.0))
    special(system(growths), known)


@pytest.mark.slow
def test_rotated_states_cross_where_others_do():
    """(p - .3), (.305 - p), (p - .31) on axes that are turned."""
    q, _ = np.linalg.qr(np.array([[2.0, 1.0, 0.5], [-1.0, 3.0, 1.0], [0.3, -0.7, 2.0]]))
    names = ("x", "y", "z")
    along = [
        "(" + " + ".join(f"({q[i, k]:.17g})*{names[i]}" for i in range(3)) + ")" for k in range(3)
    ]
    growths = ("p - 0.3", "0.305 - p", "p - 0.31")
    rates = [f"({g})*{u} - {u}^3" for g, u in zip(growths, along, strict=True)]
    f = {
        name: " + ".join(f"({q[i, k]:.17g})*({rates[k]})" for k in range(3))
        for i, name in enumerate(names)
    }
    special(f, [(0.3, "crossing"), (0.305, "crossing"), (0.31, "crossing")])


def crowded_by_arrays(slopes, scale, growth, values):
    """The same steps by arrays of all of them."""
    n = len(scale)
    change = np.diff(slopes[..., :n] * scale / scale[:, None], axis=0)
    sums = [np.abs(change).sum(axis=k).max(axis=1) for k in (1, 2)]
    own = np.minimum(np.linalg.norm(change, axis=(1, 2)), np.sqrt(sums[0] * sums[1]))
    move = np.max([own, np.append(own[1:], 0.0), np.insert(own[:-1], 0, 0.0)], axis=0)[:, None]
    off = np.where(values.imag >= 0.0, np.abs(growth), np.inf)
    found = np.minimum(*(np.sum(one <= move, axis=1) for one in (off[:-1], off[1:]))) > 1
    parts = np.sort(growth, axis=-1)
    left, middle, right = np.abs(parts[:-2]), np.abs(parts[1:-1]), np.abs(parts[2:])
    most = np.maximum(move[1:], move[:-1])
    low = np.abs(np.sign(parts[:-2]) + np.sign(parts[1:-1]) + np.sign(parts[2:])) == 3
    low &= (middle <= most) & (middle <= np.minimum(left, right))
    several = np.sum(off[1:-1] <= most, axis=1, keepdims=True) > 1
    low = (low & (several | falls(left, middle, right))).any(axis=1)
    return found | np.append(low, False) | np.insert(low, 0, False)


@pytest.mark.parametrize("discrete", [False, True])
def test_steps_in_which_more_may_cross_are_those_of_arrays(discrete):
    rng = np.random.default_rng(7)
    seen = set()
    for _ in range(200):
        n, count = int(rng.integers(2, 6)), int(rng.integers(3, 12))
        steps = rng.normal(size=(count, n, n + 1)) * 10.0 ** rng.uniform(-2, 0)
        slopes = rng.normal(size=(n, n + 1)) + np.cumsum(steps, axis=0)
        scale = 10.0 ** rng.uniform(-3, 3, n + 1)
        slopes[..., :n] *= scale[:n, None] / scale[:n]
        values = np.linalg.eigvals(slopes[..., :n]).astype(complex)
        growth = np.abs(values) - 1.0 if discrete else values.real
        curve = SimpleNamespace(n=n, scale=scale, growth=lambda _, own=growth: own)
        got = crowded(curve, slopes, values)
        assert got.tolist() == crowded_by_arrays(slopes, scale[:n], growth, values).tolist()
        seen.update(got.tolist())
    assert seen == {True, False}


@pytest.mark.parametrize("half", [1e-3, 1.4e-6])
def test_one_state_crosses_the_axis_and_returns_within_a_step(half):
    """The growth (p - c)^2 - e^2 of one state alone, of which no signs nor counts tell."""
    for c in (0.3137, 0.71):
        special({"x": f"((p - {c})^2 - {half**2})*x - x^3"},
                [(c - half, "crossing"), (c + half, "crossing")])  # fmt: skip


@pytest.mark.parametrize(("gap", "signs", "turns"), [
    (1e-7, (1, 1, 1), (0.0, 0.0, 0.0)), (1e-5, (1, -1), (0.0, 0.0)),
    (1e-5, (1, 1), (1.3, 1.8)), (1e-7, (1, -1), (1.3, 1.8)),
])  # fmt: skip
def test_several_that_cross_almost_together_are_found_each(gap, signs, turns):
    """Growths of (p - c), 2 (p - c - gap), 3 (p - c - 2 gap), or their opposites."""
    growths, known = [], []
    for k, (sign, turn) in enumerate(zip(signs, turns, strict=True)):
        place = 0.650637 + k * gap
        growths.append((f"{sign * (k + 1)}*(p - {place!r})", turn))
        known.append((place, "hopf" if turn else "crossing"))
    special(system(growths), known)


@pytest.mark.parametrize(("half", "c"), [(5e-6, 0.5410810180321839), (5e-8, 0.489525649070417)])
def test_a_pair_crosses_and_returns_next_to_the_end_of_a_half_step(half, c):
    special(
        system([(f"(p - {c!r})^2 - {half**2!r}", 1.3)]), [(c - half, "hopf"), (c + half, "hopf")]
    )


@pytest.mark.parametrize(("more", "lines"), [("- x^3", 3), ("- x^3 + y*x", 3), ("+ x^3", 0)])
def test_a_double_branch_point_is_announced(more, lines):
    """(p - c)^2 x - x^3 vanishes on three lines; with + x^3 on one, with a double point on it."""
    c = 0.337
    f = {"x": f"(p - c)^2*x {more}"} | ({"y": "-y + x^2/2"} if "y" in more else {})
    problem = pk.Problem(f, parameters={"p": 0.0, "c": c})
    (point,) = pk.continuation(problem, "p", x0=np.zeros(len(f)), span=(0.0, 1.0)).special("BP")
    assert point.status != "converged"
    assert "touches zero" in point.message
    assert abs(point["p"] - c) < 1e-8
    assert ("3 branches meet" in point.message) == (lines == 3)


@pytest.mark.parametrize(("bend", "count"), [(0.0, 0), (1e-16, 0), (1e-12, 2)])
def test_a_parameter_that_stands_still_and_goes_on_is_no_fold(bend, count):
    """Of p = (x - c)^3 - 3 bend (x - c): folds 2 sqrt(bend) apart, a cusp at bend = 0."""
    problem = pk.Problem(
        {"x": "p - (x - 0.337)^3 + 3*e*(x - 0.337)"}, parameters={"p": -1.0, "e": bend}
    )
    branch = pk.continuation(problem, "p", x0=[-1.0], span=(-1.0, 1.0))
    assert len(branch.special("LP")) == count


def test_a_determinant_that_almost_touches_zero_is_no_point():
    problem = pk.Problem({"x": "((p - 0.337)^2 + 1e-13)*x - x^3"}, parameters={"p": 0.0})
    branch = pk.continuation(problem, "p", x0=[0.0], span=(0.0, 1.0))
    assert [point.kind for point in branch.special_points] == ["end", "end"]


@pytest.mark.parametrize(
    ("first", "second", "kind"), [("-1", "-1", "period_doubling"), ("1", "1", "branch_point")]
)
@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_multipliers_that_cross_either_way_within_one_step(first, second, kind, gap):
    """One leaves the circle at mu = 0, the other enters it at mu = -gap, with other speeds."""
    law = [f"{first}*(1 + mu)*x + x^3", f"{second}*(1 - 2*(mu + gap))*y - y^3"]
    plane = pk.Problem(law, ("x", "y"), {"mu": -0.5, "gap": gap}, map=True)
    branch = pk.continuation(plane, "mu", x0=[0.0, 0.0], span=(-0.5, 0.6))
    found = [(one.kind, one["mu"]) for one in branch.special_points[1:-1]]
    if gap:
        assert len(found) == 2
        np.testing.assert_allclose([mu for _, mu in found], [-gap, 0.0], atol=1e-12)  # of a span 1
        assert [one.status for one in branch.special_points[1:-1]] == ["converged"] * 2
    else:
        assert [name for name, _ in found] == [kind]
        assert "2 eigenvalues cross together" in branch.special_points[1].message


def test_pairs_that_cross_the_circle_either_way_at_one_place_are_announced():
    turn = "{r}*(cos(1)*{a} - sin(1)*{b}) - {a}^3", "{r}*(sin(1)*{a} + cos(1)*{b}) - {b}^3"
    law = {
        a: text.format(r=r, a=one, b=two)
        for r, one, two in (("(1 + mu)", "x", "y"), ("(1 - 2*mu)", "z", "w"))
        for a, text in zip((one, two), turn, strict=True)
    }
    both = pk.Problem(law, parameters={"mu": -0.4}, map=True)
    branch = pk.continuation(both, "mu", x0=np.zeros(4), span=(-0.4, 0.45))
    (point,) = branch.special_points[1:-1]
    assert (point.kind, point.status) == ("torus", "guess")
    assert "4 eigenvalues cross together" in point.message


def test_steps_of_many_curves_are_judged_as_each_alone():
    """Of other parameters and scales; in one the eigenvalues are double and have one vector."""
    random, parts = np.random.default_rng(3), []
    for size, steps in ((1.0, 4), (1e-6, 1), (1e3, 7)):
        problem = pk.Problem(
            {"x": "c*y + p*x - x^3", "y": "p*y - c*x + x*y", "z": "p*z - c*x*z"},
            parameters={"p": 0.0, "c": size},
        )  # fmt: skip
        curve = equilibrium_curve(problem, "p", (-1.0, 1.0), pk.ContinuationOptions())
        curve = curve.replace(scale=np.array([size, 1.0, 1.0 / size, 2.0]))
        u, tangent = random.normal(size=(2, 2, steps, 4)) * curve.scale
        sizes = curve.scale / curve.scale[:3, None]
        slopes = random.normal(size=(2, steps, 3, 4)) / sizes
        if steps == 1:
            slopes[..., :3] = np.array([[0, 1, 0], [0, 0, 0], [0, 0, 1]]) / sizes[:, :3]
        parts.append(Steps(curve, u, tangent, slopes))
    together, alone = doubtful_of_all(parts), [doubtful(one) for one in parts]
    assert len(together) == 3
    for (doubt, both), (its, count), part in zip(together, alone, parts, strict=True):
        assert len(doubt) == part.u.shape[1]
        assert (doubt.tolist(), both.tolist()) == (its.tolist(), count.tolist())
    flags = np.concatenate([doubt for doubt, _ in together])
    assert 0 < flags.sum() < len(flags)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [1e8, 1e12, 1e14])
@pytest.mark.parametrize("code", [False, True])
def test_a_pitchfork_and_a_neutral_saddle_as_near_as_rates_differ(rate, code):
    """J = diag(rate p, -1): p = 0 and p = 1/rate, however short that is beside the span."""
    f = lambda x, p: [rate * p * x[0] - x[0] ** 3, -x[1]]  # noqa: E731
    law = f if code else [f"{rate!r}*p*x - x^3", "-y"]
    branch = pk.continuation(pk.Problem(law, ["x", "y"], {"p": -1.0}), "p", x0=[0, 0], span=(-1, 1))
    found = [(one.kind, one.message) for one in branch.special_points if one.kind != "end"]
    assert found == [("pitchfork", ""), ("neutral_saddle", "")]
    places = [one.parameters["p"] for one in branch.special_points if one.kind != "end"]
    assert places[0] == 0.0
    assert abs(places[1] * rate - 1.0) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e3])
@pytest.mark.parametrize(
    ("f", "x"), [("p - (x - .7)^2 + (x - .7)*y", 1.7), ("p*(x - .7) - (x - .7)^3 + p*y", 0.7)]
)
def test_two_eigenvalues_that_vanish_together_are_one_point(f, x, size):
    law = pk.Problem(["y", f"{size!r}*({f})"], ["x", "y"], {"p": 1.0})
    branch = pk.continuation(law, "p", x0=[x, 0], span=(-1, 1))
    found = [one for one in branch.special_points if "Bogdanov-Takens" in one.message]
    assert [abs(one.parameters["p"]) < 1e-9 for one in found] == [True]
