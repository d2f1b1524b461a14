"""What begins at points of codimension two, against systems in which it is known exactly."""

import numpy as np
import pytest

import phasekit as pk

ROTATING = ("{rate}*x - {turn}*y", "{rate}*y + {turn}*x")


def bautin():
    """R' = r (m + b r^2 - r^4): cycles fold where m = -b^2/4."""
    rate = "(m + b*(x**2 + y**2) - (x**2 + y**2)**2)"
    return pk.Problem(
        [f"{rate}*x - y", f"{rate}*y + x"], ("x", "y"), {"m": -0.5, "b": -0.5},
    )  # fmt: skip


def special(problem, parameter, start, second, kind, label):
    """The first point of a kind on the curve of the first fold or Hopf point of a branch."""
    branch = pk.continuation(problem, parameter, x0=start, span=(-1.0, 1.0))
    return branch.special(kind)[0].curve(second, (-1.0, 1.0)).special(label)[0]


def test_cycles_fold_from_generalized_hopf_points():
    point = special(bautin(), "m", [0.0, 0.0], "b", "H", "GH")
    curve = point.switch()
    assert curve.kind == "fold_of_cycles"
    np.testing.assert_allclose(curve.points.m, -(curve.points.b**2) / 4, atol=1e-12)
    assert float(curve.points.b.min()) < 1e-2  # and it shrinks to the point
    assert curve.stops[0].reason == "hopf"
    with pytest.raises(pk.ParameterError, match=r"kind: got 'hopf', wants 'fold_of_cycles'"):
        point.switch("hopf")
    with pytest.raises(pk.ParameterError, match="direction"):
        point.switch(direction=1)


def test_bogdanov_takens_points_lead_from_folds_to_hopf_curves_and_back():
    """X' = y, y' = m + n y + x^2 + x y: folds m = 0, Hopf points m = -n^2, n > 0."""
    system = pk.Problem(["y", "m + n*y + x**2 + x*y"], ("x", "y"), {"m": -1.0, "n": 0.5})
    point = special(system, "m", [1.0, 0.0], "n", "LP", "BT")
    assert point.normal_form == pytest.approx({"a": 1.0, "b": 1.0}, rel=1e-12)
    hopf = point.switch()
    assert hopf.kind == "hopf"
    np.testing.assert_allclose(hopf.points.m, -(hopf.points.n**2), atol=1e-12)
    (back,) = hopf.special("BT")
    fold = back.switch()
    assert fold.kind == "fold"
    np.testing.assert_allclose(fold.points.m, 0.0, atol=1e-12)


def zero_hopf(sign):
    """Xi' = m + xi^2 + sign |w|^2, w' = (n + 1.3 i + 0.8 xi + xi^2) w: tori n = 0, m > 0."""
    rate = "(n + 4/5*z + z**2)"
    return pk.Problem(
        [f"m + z**2 + ({sign})*(x**2 + y**2)", f"{rate}*x - 13/10*y", f"{rate}*y + 13/10*x"],
        ("z", "x", "y"), {"m": -0.5, "n": 0.3},
    )  # fmt: skip


@pytest.mark.slow
def test_zero_hopf_points_lead_to_hopf_curves_and_tori():
    point = special(zero_hopf(-1), "m", [-(0.5**0.5), 0.0, 0.0], "n", "LP", "ZH")
    hopf = point.switch("hopf")
    n, z = hopf.points.n, hopf.points.z
    np.testing.assert_allclose(n + 0.8 * z + z**2, 0.0, atol=1e-12)
    tori = point.switch("torus", options=pk.ContinuationOptions(bounds={"m": (-1.0, 1.0)}))
    assert tori.kind == "torus"
    np.testing.assert_allclose(tori.points.n, 0.0, atol=1e-9)
    assert float(tori.points.m.min()) > 0.0


def test_zero_hopf_points_of_other_signs_have_no_tori():
    point = special(zero_hopf(1), "m", [-(0.5**0.5), 0.0, 0.0], "n", "LP", "ZH")
    with pytest.raises(pk.ParameterError, match="no torus begins here: c d = "):
        point.switch("torus")


@pytest.mark.slow
def test_hopf_hopf_points_lead_to_the_other_hopf_curve_and_to_two_curves_of_tori():
    """Radii r' = r (a - r^2 + s^2/2), s' = s (b - 7/10 r^2 - 6/5 s^2): b = 7/10 a, a = -5/12 b."""
    one = "(a - (x**2 + y**2) + (u**2 + v**2)/2)"
    two = "(b - 7/10*(x**2 + y**2) - 6/5*(u**2 + v**2))"
    system = pk.Problem(
        [f"{one}*x - 27/10*y", f"{one}*y + 27/10*x", f"{two}*u - v", f"{two}*v + u"],
        ("x", "y", "u", "v"), {"a": -0.5, "b": -0.2},
    )  # fmt: skip
    point = special(system, "a", np.zeros(4), "b", "H", "HH")
    other = point.switch("hopf", options=pk.ContinuationOptions(bounds={"a": (-1.0, 1.0)}))
    np.testing.assert_allclose(other.points.b, 0.0, atol=1e-12)
    assert float(other.points.a.max() - other.points.a.min()) == pytest.approx(2.0, abs=1e-6)
    tori = point.switch("torus")
    np.testing.assert_allclose(tori.points.b, 0.7 * tori.points.a, atol=1e-9)
    assert float(tori.points.a.min()) > 0.0
    tori = point.switch("torus", direction=1)
    np.testing.assert_allclose(tori.points.a, -5 / 12 * tori.points.b, atol=1e-9)
    assert float(tori.points.b.min()) > 0.0


def test_points_at_which_nothing_is_followed_say_what_begins():
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.5})
    point = special(cusp, "mu", [-1.3], "l", "LP", "CP")
    with pytest.raises(pk.ParameterError, match="two folds that meet there"):
        point.switch()
    with pytest.raises(pk.ParameterError, match="kind: got 'hopf', wants None"):
        pk.continuation(cusp, "mu", x0=[-1.3], span=(-1.0, 1.0)).special("LP")[0].switch("hopf")
    henon = pk.Problem(["1 - a*x**2 + y", "b*x"], ("x", "y"), {"a": -0.1, "b": 0.3}, map=True)
    flips = pk.continuation(henon, "a", x0=[0.9, 0.3], span=(-0.5, 1.0)).special("PD")[0]
    (point,) = flips.curve("b", (-1.5, 0.8)).special("R2")
    with pytest.raises(pk.ParameterError, match="resonance_2"):
        point.switch()


@pytest.mark.slow
def test_folds_of_cycles_are_those_of_the_family():
    """Of the oxidation of CO: the curve from its generalized Hopf point, and a family's fold."""
    values = {"q2": 0.6, "q1": 2.5, "q3": 10.0, "q4": 0.0675, "q5": 1.0, "q6": 0.1, "k": 0.3}
    z = "(1 - x - y - s)"
    oxidation = pk.Problem(
        [f"2*q1*{z}**2 - 2*q5*x**2 - q3*x*y", f"q2*{z} - q6*y - q3*x*y", f"q4*({z} - k*s)"],
        ("x", "y", "s"), values,
    )  # fmt: skip
    rest = pk.continuation(oxidation, "q2", x0=[0.07, 0.2, 0.5], span=(0.5, 2.0))
    hopf = rest.special("H")[0]
    folds = hopf.switch().special("LPC")
    assert folds
    curve = hopf.curve("k", (0.1, 2.0)).special("GH")[0].switch()
    at = curve.points.k.values
    crossing = np.flatnonzero(np.sign(at[1:] - 0.3) != np.sign(at[:-1] - 0.3))
    assert len(crossing)
    # Events are not looked for on curves of cycles: a point of it, followed to k = 0.3 as a family.
    near = []
    for i in crossing:
        k = float(at[i])
        there = pk.continuation(oxidation.replace(k=k), "q2", x0=[0.07, 0.2, 0.5], span=(0.5, 2.0))
        wanted = float(curve.points.q2[i])
        found = [fold["q2"] for one in there.special("H") for fold in one.switch().special("LPC")]
        near.append(min(abs(np.array(found) - wanted)))
    assert max(near) < 1e-8


@pytest.mark.parametrize("plain", [False, True])
def test_branch_points_form_curves_in_three_parameters(plain, tmp_path):
    """F = a + m x - x^3 + c m: f_m = 0 where x = -c, f_x = 0 where m = 3 c^2, so that a = -c^3."""
    values = {"m": 1.5, "a": -0.125, "c": 0.5}
    if plain:

        def f(x, m, a, c):
            return [a + m * x[0] - x[0] ** 3 + c * m, x[0] - x[1]]

        imperfect = pk.Problem(f, ("x", "y"), values)
    else:
        imperfect = pk.Problem(["a + m*x - x**3 + c*m", "x - y"], ("x", "y"), values)
    branch = pk.continuation(imperfect, "m", x0=[-0.5, -0.5], span=(-1.0, 2.0))
    (point,) = branch.special("BP")
    curve = point.curve(["a", "c"], [(-1.0, 1.0), (-0.9, 0.9)])
    assert curve.free == ("m", "a", "c")
    assert curve.kind == "branch_point"
    at = curve.points
    np.testing.assert_allclose(at.m, 3.0 * at.c**2, atol=1e-8 if plain else 1e-12)
    np.testing.assert_allclose(at.a, -(at.c**3), atol=1e-8 if plain else 1e-12)
    np.testing.assert_allclose(sorted(at.c.values[[0, -1]]), [-0.9, 0.9], atol=1e-12)
    if not plain:
        curve.save(tmp_path / "curve.nc")
        assert pk.Branch.load(tmp_path / "curve.nc") == curve
    with pytest.raises(pk.ConvergenceError, match=r"curve\(\[second, third\]"):
        point.curve("a", (-1.0, 1.0))
    with pytest.raises(pk.ParameterError, match="span: "):
        point.curve(["a", "c"], (-1.0, 1.0))
    with pytest.raises(pk.ParameterError, match="parameter: "):
        point.curve(["a", "a"], [(-1.0, 1.0), (-1.0, 1.0)])
    with pytest.raises(pk.ParameterError, match="one name, or of a branch point two"):
        point.curve(["a", "c", "m"], [(-1.0, 1.0)] * 3)
