"""Proved branches, against exact elimination that shares no code with them."""

from __future__ import annotations

import os
import pickle
from fractions import Fraction

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp
from witnesses.variants import some

import phasekit as pk
from phasekit import ParameterError
from phasekit.bifurcation.continuation import certificates

#: Parts of a thousand random curves that are tried.
PARTS = 1 if os.environ.get("PHASEKIT_PUBLISHED") == "all" else 10
X, Y, MU, W = sp.symbols("x y mu w", real=True)
DEGREES = [(i, j) for i in range(5) for j in range(3) if i + j <= 4]
NAMES = [f"c{i}{j}" for i, j in DEGREES]
#: A plane curve whose coefficients are parameters, so that it is compiled once.
QUARTIC = pk.Problem(
    " + ".join(f"{name}*x**{i}*mu**{j}" for name, (i, j) in zip(NAMES, DEGREES, strict=True)),
    "x", {"mu": 0.0, **dict.fromkeys(NAMES, 0.0)},
)  # fmt: skip


def polynomial(coefficients):
    """The same, exactly."""
    return sp.Poly(
        {key: sp.Rational(value) for key, value in zip(DEGREES, coefficients, strict=True)},
        X, MU, domain="QQ",
    )  # fmt: skip


def follow(coefficients, x0, mu, **options):
    """A branch, the tubes that it is proved by, and the units they are measured in."""
    problem = QUARTIC.replace(mu=mu, **dict(zip(NAMES, coefficients, strict=True)))
    kept, own = [], certificates.chain_of

    def chain(system, u):
        kept.append((own(system, u), system.units))
        return kept[-1][0]

    certificates.chain_of = chain
    try:
        branch = pk.continuation(
            problem, "mu", x0=[x0], span=(-1.0, 1.0), certify=True,
            options=pk.ContinuationOptions(bounds={"x": (-3.0, 3.0)}, **options),
        )  # fmt: skip
        assert branch.points.certified_onward.size > 0
    finally:
        certificates.chain_of = own
    return branch, kept[0]


def random_curve(rng):
    """Coefficients of a curve through a point, made of doubles."""
    coefficients = np.round(rng.normal(size=len(DEGREES)) * 64) / 64
    x0, mu = np.round(rng.uniform(-0.9, 0.9, 2) * 64) / 64
    value = sum(c * x0**i * mu**j for c, (i, j) in zip(coefficients, DEGREES, strict=True))
    coefficients[0] -= value
    return coefficients, x0, mu


def crossed(rng, separation):
    """Two lines that cross, moved apart by a little: (x - a)(x - b) = separation."""
    (x0, mu0), first, last = (np.round(rng.uniform(-0.8, 0.8, 2) * 32) / 32 for _ in range(3))
    lines = [
        X - sp.Rational(x0) - sp.Rational(s) * (MU - sp.Rational(mu0)) for s in (first[0], last[1])
    ]
    whole = sp.Poly(lines[0] * lines[1], X, MU)
    found = {key: float(value) for key, value in whole.as_dict().items()}
    found[0, 0] = found.get((0, 0), 0.0) - separation
    coefficients = np.array([found.pop(key, 0.0) for key in DEGREES])
    assert not found
    return coefficients, float(x0 + first[0] * (-0.875 - mu0)), -0.875


def check_sections(chain, units, exact, rng, count):
    """On cuts across proved tubes there is exactly one zero: counted by Sturm's theorem."""
    tubes = chain.tubes
    for k in rng.permutation(np.flatnonzero(tubes.proved))[:count]:
        s = Fraction(float(rng.uniform(-0.5, 0.5)))
        base = [
            Fraction(float(c)) + s * Fraction(float(d))
            for c, d in zip(tubes.middle[k], tubes.chord[k], strict=True)
        ]
        x, mu = (
            sp.Poly([Fraction(float(t[0] * u)), b * Fraction(float(u))], W, domain="QQ")
            for b, t, u in zip(base, tubes.across[k], units, strict=True)
        )
        cut = sp.Poly(0, W, domain="QQ")
        for (p, q), c in exact.as_dict().items():
            cut += x**p * mu**q * c
        for reach in (tubes.radius[k, 0], tubes.alone[k, 0]):
            end = sp.Rational(float(reach))
            assert cut.count_roots(-end, end) == 1, (k, float(s))


def root_index(exact, x, mu):
    """How many real roots lie below the one next to x; None where that is not clear."""
    found = np.roots([float(c.subs(MU, mu)) for c in sp.Poly(exact.as_expr(), X).all_coeffs()])
    roots = np.sort(found[np.abs(found.imag) < 1e-9].real)
    if not roots.size:  # two that are all but equal
        return None
    gaps = np.abs(roots - x)
    near = int(np.argmin(gaps))
    apart = np.delete(gaps, near).min(initial=np.inf)
    return near if gaps[near] < 1e-7 and apart > 1e-4 else None


def check_stretches(branch, exact, rng, count):
    """Where no roots meet, proved stretches stay on the root that they begin on."""
    met = sp.Poly(sp.discriminant(exact.as_expr(), X), MU)
    x, mu = branch.points.x.values, branch.points.mu.values
    proved = np.flatnonzero(branch.points.certified_onward.values)
    for k in rng.permutation(proved)[:count]:
        low, high = sorted((sp.Rational(float(mu[k])), sp.Rational(float(mu[k + 1]))))
        if low == high or met.is_zero or met.count_roots(low, high):
            continue
        first, last = (root_index(exact, x[i], float(mu[i])) for i in (k, k + 1))
        assert first == last or None in (first, last), (k, x[k], mu[k])


def check_folds(branch, exact):
    """Each box of a fold holds exactly one common zero of f and f_x, and it is a simple one."""
    met = sp.Poly(sp.discriminant(exact.as_expr(), X), MU)
    for fold in branch.special("fold"):
        if fold.certified:
            low, high = (sp.Rational(end) for end in fold.enclosure["mu"])
            assert met.count_roots(low, high) == 1
            assert fold.enclosure["x"][0] <= fold.x[0] <= fold.enclosure["x"][1]


def check(branch, tubes, exact, rng, sections=4, stretches=2):
    check_sections(*tubes, exact, rng, sections)
    check_stretches(branch, exact, rng, stretches)
    check_folds(branch, exact)


def try_random(count, seed):
    rng = np.random.default_rng(seed)
    proved = total = 0
    for _ in range(count):
        coefficients, x0, mu = random_curve(rng)
        try:
            branch, tubes = follow(coefficients, x0, mu)
        except pk.ConvergenceError:
            continue
        onward = branch.points.certified_onward.values[:-1]
        proved, total = proved + onward.sum(), total + onward.size
        check(branch, tubes, polynomial(coefficients), rng)
    assert proved > 0.97 * total > 0
    return total


@pytest.mark.slow
def test_random_curves_are_proved_and_no_certificate_is_wrong():
    assert try_random(15, 1) > 300


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 6 if PARTS == 1 else 3))
def test_many_random_curves_are_proved_and_no_certificate_is_wrong(seed):
    assert try_random(250 // PARTS, seed) > 5_000 // PARTS


def try_apart(count, seed):
    rng = np.random.default_rng(seed)
    proved = 0
    for _ in range(count):
        separation = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12.0, -3.0))
        coefficients, x0, mu = crossed(rng, separation)
        try:
            branch, tubes = follow(coefficients, x0, mu)
        except pk.ConvergenceError:
            continue
        for point in branch.special("BP"):
            assert not point.certified
            assert "branches meet" in point.doubt
        proved += branch.points.certified_onward.values.sum()
        check(branch, tubes, polynomial(coefficients), rng)
    return proved


@pytest.mark.slow
def test_curves_that_nearly_cross_are_never_proved_to_be_others():
    assert try_apart(8, 3) > 100


@pytest.mark.slow
def test_many_curves_that_nearly_cross_are_never_proved_to_be_others():
    assert try_apart(300 // PARTS, 4) > 5_000 // PARTS


@pytest.mark.slow
@pytest.mark.parametrize("formula", ["l*x - x^3 + e", "l*x - x^2 + e", "l*x - x^2 - e"])
@pytest.mark.parametrize("size", some([1e-12, 1e-9, 1e-6, 1e-3], 2))
def test_what_is_nearly_a_branch_point_is_not_proved_to_be_one(formula, size):
    problem = pk.Problem(formula, "x", {"l": -1.0, "e": size})
    for branch in pk.diagram(problem, "l", span=(-1.0, 1.0), certify=True):
        for point in branch.special("BP"):
            assert not point.certified
            assert point.enclosure == {}
        for fold in branch.special("fold"):
            if fold.certified:  # 27 e^2 = 4 l^3, or l^2 = -4 e and the like
                load, x = sp.symbols("l x", real=True)
                f = sp.sympify(formula.replace("^", "**"), {"l": load, "x": x})
                f = f.subs("e", sp.Rational(size))
                met = sp.Poly(sp.discriminant(f, x), load)
                assert met.count_roots(*map(sp.Rational, fold.enclosure["l"])) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("f", "state", "x0", "kept"),
    [
        (["l*x - x^3"], "x", [0.0], {"x": 0.0}),
        (["x*(l - x)*(x + 2)"], "x", [-1.0], {"x": 0.0}),
        (["y - x", "x*(l - z) + x^3 - y + x", "x*y - z"], "xyz", [0.0, 0.0, 0.0], {"z": 0.0}),
        (["l*x - tanh(x)^3 - y", "l*y - sin(y)^3 - x/4"], "xy", [0.0, 0.0], {"x": 0.0}),
        (["l*x + y - exp(x) + 1 - x", "l*y + x - exp(y) + 1 - y"], "xy", [0.0, 0.0], {"x": 0.0}),
    ],
)  # fmt: skip
def test_branch_points_that_formulas_split_are_proved(f, state, x0, kept):
    """By factors and by subspaces; tubes pass them, as nothing else crosses next to them."""
    problem = pk.Problem(f, tuple(state), {"l": -1.0})
    options = pk.ContinuationOptions(bounds=dict.fromkeys(state, (-1.5, 1.5)))
    branch = pk.continuation(problem, "l", x0=x0, span=(-1.0, 1.8), certify=True, options=options)
    points = branch.special("BP")
    assert points
    for point in points:
        assert point.certified, point.doubt
        for name, value in kept.items():
            assert point.enclosure[name][0] <= value <= point.enclosure[name][1]
        low, high = point.enclosure["l"]
        assert low <= point["l"] <= high
        assert high - low < 1e-12
    assert branch.points.certified_onward.values[:-1].all()


@pytest.mark.slow
@pytest.mark.parametrize("apart", [1e-2, 1e-5, 1e-8])
def test_each_of_two_branch_points_is_in_a_box_of_its_own(apart):
    problem = pk.Problem("x*(x - l^2 + e^2)", "x", {"l": -1.0, "e": apart})
    branch = pk.continuation(problem, "l", x0=[0.0], span=(-1.0, 1.0), certify=True)
    for point in branch.special("BP"):
        if point.certified:
            low, high = point.enclosure["l"]
            assert sum(low <= at <= high for at in (-apart, apart)) == 1
    if apart == 1e-2:
        assert [point.certified for point in branch.special("BP")] == [True, True]


@pytest.mark.slow
def test_a_third_branch_through_a_branch_point_is_seen():
    problem = pk.Problem("x*(x - l)*(x + l + e)", "x", {"l": -1.0, "e": 0.0})
    for e in (0.0, 1e-14):
        branch = pk.continuation(
            problem.replace(e=e), "l", x0=[0.0], span=(-1.0, 1.0), certify=True
        )
        assert not any(point.certified for point in branch.special("BP"))


def test_formulas_of_very_many_terms_are_not_expanded():
    """Factoring these would take for ever."""
    problem = pk.Problem(
        ["x*(l - x) + x^3*sin(x)^40*(1 + x + l)^60*(2 + x*l)^60/4^60"], "x", {"l": -0.25}
    )
    branch = pk.continuation(problem, "l", x0=[0.0], span=(-0.5, 0.5), certify=True)
    assert branch.special("BP")[0].certified


def test_a_jump_to_another_branch_is_not_proved():
    """Steps too long for curves 1e-5 apart, which cross in the eyes of Newton's method."""
    problem = pk.Problem("(x - l)*(x + l) - e", "x", {"l": -1.0, "e": 1e-10})
    branch = pk.continuation(problem, "l", x0=[1.0], span=(-1.0, 1.0), certify=True)
    x, onward = branch.points.x.values, branch.points.certified_onward.values
    changed = np.flatnonzero(x[1:] * x[:-1] < 0.0)
    assert not onward[changed].any()


def test_a_hopf_point_is_enclosed_with_its_frequency():
    brusselator = pk.Problem(["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5})
    branch = pk.continuation(brusselator, "b", x0=[1.0, 1.5], span=(1.0, 3.0), certify=True)
    (hopf,) = branch.special("H")
    assert branch.certified
    assert hopf.doubt == ""
    for name, value in {"b": 2.0, "x": 1.0, "y": 2.0, "omega": 1.0}.items():
        low, high = hopf.enclosure[name]
        assert low < value < high
        assert high - low < 1e-13
    assert "proved: " in repr(branch)
    assert branch.table().certified.all()


@pytest.mark.parametrize("kind", ["hopf", "torus"])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_pair_that_may_be_one_eigenvalue_is_no_certified_pair(kind, turn):
    """At folds and doublings the equations of pairs hold, too, with a single root."""
    sign = -1 if kind == "torus" else 0
    c, s = sp.Float(np.cos(turn)), sp.Float(np.sin(turn))
    u, v = c * X + s * Y, c * Y - s * X
    # Eigenvalues 0 and -2, of the map -1 and -2, at u = v = 0, MU = 0.
    own = (MU - u**2 + sign * u, -2 * v + u * MU)
    f = (c * own[0] - s * own[1], s * own[0] + c * own[1])
    if kind == "torus":
        f = tuple(row - MU * (c, s)[i] + MU * u * (c, s)[i] for i, row in enumerate(f))
    equations = certificates.Equations(f, (X, Y), MU, {}, kind == "torus")
    points = np.zeros((3, 3))
    found = certificates.certificate(
        equations, points, np.ones(3), [certificates.Mark(kind, np.zeros(3), 1)]
    ).specials[0]
    assert not found.certified
    assert "may be one" in found.reason


@pytest.mark.parametrize("again", [1, 2, 3])
@pytest.mark.parametrize("place", [0, 4, 8])
def test_points_that_are_the_same_are_proved_as_far_as_their_neighbours(again, place):
    """Also the first ones of all, and where the stretch next to them is not proved."""
    turn = np.linspace(-1.0, 1.0, 9)
    points = np.insert(
        np.stack([turn, turn**2], axis=1), place, [[turn[place], turn[place] ** 2]] * again, axis=0
    )
    for f, proved in (
        (MU - X**2, True),
        ((MU - X**2) * (MU - X**2 - sp.Rational(1, 10**9)), False),
    ):
        equations = certificates.Equations((f,), (X,), MU, {}, False)
        found = certificates.certificate(equations, points, np.ones(2), [])
        assert found.stretches.tolist() == [proved] * (8 + again)
        known = np.isfinite(found.radius).all(axis=1)
        same = np.arange(place, place + again)
        assert not known[same].any()
        assert np.delete(known, same).tolist() == [proved] * 8
        assert len(found.reasons) == 8 + again
        assert all(bool(why) != proved for why in found.reasons)


def test_nothing_is_proved_of_a_branch_of_one_point():
    equations = certificates.Equations((MU - X**2,), (X,), MU, {}, False)
    found = certificates.certificate(equations, np.ones((4, 2)), np.ones(2), [])
    assert not found.stretches.any()
    assert not np.isfinite(found.radius).any()
    assert not np.isfinite(found.errors).any()
    assert len(found.reasons) == 3
    assert all("no tube" in why for why in found.reasons)


def test_the_error_of_a_point_is_about_its_own_curve(monkeypatch):
    """A tube that is turned about and holds another curve says nothing of the first point."""
    turn = np.linspace(0.5, 1.0, 9)
    points = np.stack([turn, turn**2], axis=1)
    equations = certificates.Equations(((MU - X**2) * (MU - X**2 - 1),), (X,), MU, {}, False)
    own = certificates.tubes_about

    def moved(system, start, end):
        again = len(start) == 1
        shift = again * np.array([0.0, 1.0]) / system.units
        return own(system, start + shift, end + shift)

    assert np.isfinite(certificates.certificate(equations, points, np.ones(2), []).errors).all()
    monkeypatch.setattr(certificates, "tubes_about", moved)
    errors = certificates.certificate(equations, points, np.ones(2), []).errors
    assert np.isnan(errors[0]).all()
    assert np.isfinite(errors[1:]).all()


def test_points_of_maps_are_enclosed():
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 2.0}, map=True)
    (doubling,) = pk.continuation(logistic, "r", x0=[0.5], span=(1.5, 3.5), certify=True).special(
        "PD"
    )
    assert doubling.enclosure["r"][0] <= 3.0 <= doubling.enclosure["r"][1]
    delayed = pk.Problem(["r*x*(1 - y)", "x"], ("x", "y"), {"r": 1.5}, map=True)
    (torus,) = pk.continuation(delayed, "r", x0=[0.3, 0.3], span=(1.3, 2.4), certify=True).special(
        "TR"
    )
    low, high = torus.enclosure["sine"]
    assert torus.enclosure["r"][0] <= 2.0 <= torus.enclosure["r"][1]
    assert low <= np.sin(np.pi / 3) <= high


def test_an_angle_is_enclosed_on_the_turn_that_it_is_shown_on():
    problem = pk.Problem("l - sin(a)", "a", {"l": 0.0}, periods={"a": 2 * np.pi})
    branch = pk.continuation(problem, "l", x0=[2 * np.pi], span=(-2.0, 2.0), certify=True)
    assert branch.special("fold")
    for fold in branch.special("fold"):
        low, high = fold.enclosure["a"]
        assert low <= fold.x[0] <= high
        assert high - low < 1e-10
        assert fold.enclosure["l"][0] <= np.round(fold["l"]) <= fold.enclosure["l"][1]


def test_poles_are_not_proved_and_no_error():
    problem = pk.Problem("l - x + 1e-6/(l - 0.3)", "x", {"l": 0.0})
    options = pk.ContinuationOptions(bounds={"x": (-9.0, 9.0)})
    branch = pk.continuation(
        problem, "l", x0=[0.0], span=(-1.0, 1.0), options=options, certify=True
    )
    onward = branch.points.certified_onward.values[:-1]
    assert onward.mean() > 0.5
    hole = pk.Problem("l - x*sin(x)/x", "x", {"l": 0.5})
    branch = pk.continuation(hole, "l", x0=[0.5], span=(-0.5, 0.9), certify=True)
    doubts = [text for text in branch.points.certified_doubt.values if text]
    assert doubts == [] or any("pole" in text for text in doubts)


@pytest.mark.slow
def test_certificates_are_kept_by_copies_stores_and_longer_branches(tmp_path):
    cusp = pk.Problem("mu + x - x**3", "x", {"mu": -1.0})
    branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1), stop="fold", certify=True)
    branch.save(tmp_path / "branch.nc")
    for again in (pk.Branch.load(tmp_path / "branch.nc"), pickle.loads(pickle.dumps(branch))):
        assert again == branch
        assert again.certified
        assert [p.enclosure for p in again.special_points] == [
            p.enclosure for p in branch.special_points
        ]
    longer = branch.extend()
    assert longer.certified
    assert len(longer.special("fold")) == 2
    part = branch.points.isel(point=slice(3, 9))
    assert part.certified_onward.sizes == {"point": 6}
    ds = branch.to_dataset()
    assert ds.special_certified.all()
    assert ds.special_mu_enclosure.sizes == {"special_point": len(ds.special_kind), "end": 2}


@pytest.mark.parametrize("f", ["l - x/(exp(x) - 1)", "l - 1 + x"])
def test_pictures_mark_what_is_not_proved(f):
    """The first formula is 0/0 at x = 0."""
    branch = pk.continuation(
        pk.Problem(f, "x", {"l": 0.5}), "l", x0=[1.0], span=(0.3, 2.0), certify=True
    )
    figure, ax = plt.subplots()
    branch.plot(ax=ax)
    bands = [line for line in ax.lines if line.get_label() == "not proved"]
    plt.close(figure)
    onward = branch.points.certified_onward.values[:-1]
    assert len(bands) == (not onward.all())
    if "exp" in f:
        first, last = bands[0].get_ydata()[[0, -1]]
        assert first * last < 0.0
        assert any("pole" in doubt for doubt in branch.points.certified_doubt.values)


def test_nothing_is_said_without_being_asked_for():
    branch = pk.continuation(
        pk.Problem("mu - x**2", "x", {"mu": 1.0}), "mu", x0=[1.0], span=(-1, 1)
    )
    assert not branch.certified
    assert "certified" not in branch.points
    (fold,) = branch.special("fold")
    assert (fold.certified, dict(fold.enclosure)) == (False, {})
    assert "certify=True" in fold.doubt


def test_what_cannot_be_proved_is_refused_by_name():
    function = pk.Problem(lambda x, mu: mu - x**2, "x", {"mu": 1.0})
    with pytest.raises(ParameterError, match="certify.*Python function"):
        pk.continuation(function, "mu", x0=[1.0], span=(-1, 1), certify=True)
    largest = pk.Problem(X - sp.Max(X, MU) ** 2, "x", {"mu": 0.5})
    with pytest.raises(ParameterError, match="certify.*Max"):
        pk.continuation(largest, "mu", x0=[0.5], span=(-1, 1), certify=True)
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 2.0}, map=True)
    with pytest.raises(ParameterError, match=r"certify.*several times"):
        pk.continuation(logistic.iterated(2), "r", x0=[0.5], span=(1, 3), certify=True)
    cusp = pk.Problem("mu + x - x**3", "x", {"mu": -1.0})
    with pytest.raises(ParameterError, match="certify"):
        pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1), certify="yes")
