"""Fits of parameters to special points, amplitudes and periods."""

from __future__ import annotations

import functools
import importlib

import numpy as np
import pytest

import phasekit as pk

fit_module = importlib.import_module("phasekit.labelled.continuation.fit")

NERVE = pk.Problem(
    ["v - v**3/3 - w + I", "eps*(v + a - b*w)"], ("v", "w"),
    {"I": 0.0, "eps": 0.08, "a": 0.7, "b": 0.8},
)  # fmt: skip
#: r' = mu r + b r^3 - r^5, theta' = w + c r^2: cycles fold at mu = -b^2/4, r^2 = b/2.
QUINTIC = pk.Problem(
    [
        "(mu + b*(x*x + y*y) - (x*x + y*y)**2)*x - (w + c*(x*x + y*y))*y",
        "(mu + b*(x*x + y*y) - (x*x + y*y)**2)*y + (w + c*(x*x + y*y))*x",
    ],
    ("x", "y"), {"mu": -0.5, "b": 1.0, "w": 2.0, "c": 0.3},
)  # fmt: skip


@functools.cache
def hopf_points(**changes):
    problem = NERVE.replace(**changes)
    return pk.continuation(problem, "I", x0=[-1.2, -0.6], span=(0, 2)).special("H")


def onset(**changes):
    """Currents at both Hopf points, and the period at the first."""
    low, high = hopf_points(**changes)
    return low["I"], high["I"], 2.0 * np.pi / low.normal_form["omega"]


def targets_of(values, error=1e-3):
    low, high = hopf_points()
    pairs = zip([(low, "I"), (high, "I"), (low, "period")], values, strict=False)
    return [(*pair, float(value), error) for pair, value in pairs]


def test_hopf_points_give_their_parameters_back():
    wanted = {"a": 0.72, "b": 0.78, "eps": 0.09}
    found = pk.fit(NERVE, targets_of(onset(**wanted)), free=list(wanted))
    assert found.converged
    assert found.chi2 < 1e-15
    for name, value in wanted.items():
        assert found.parameters[name] == pytest.approx(value, rel=1e-9)
        assert found.system.parameters[name] == found.parameters[name]
    assert list(found.targets.target.values) == ["H 1 I", "H 2 I", "H 1 period"]
    assert "converged" in repr(found)


def test_covariance_is_that_of_the_derivatives():
    """Folds of the cusp at mu = +-2 (l/3)^(3/2): dl = dmu/sqrt(l/3)."""
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
    fold = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1)).special("LP")[0]
    found = pk.fit(cusp, [(fold, "mu", 0.3, 0.01)], free=["l"])
    wanted = 3.0 * 0.15 ** (2.0 / 3.0)
    assert found.parameters["l"] == pytest.approx(wanted, rel=1e-12)
    assert found.errors["l"] == pytest.approx(0.01 / np.sqrt(wanted / 3.0), rel=1e-9)


def test_what_is_not_identified_is_named_and_not_announced():
    found = pk.fit(NERVE, targets_of(onset(a=0.72, b=0.78, eps=0.09)[:2]), free=["a", "b", "eps"])
    assert not found.converged
    assert found.status == "not identified"
    assert all(f"in {name}" in found.message for name in ("a", "b", "eps"))
    assert np.isnan(list(found.errors.values())).all()


@pytest.mark.slow
def test_cycles_give_their_parameters_back():
    rest = pk.continuation(QUINTIC, "mu", x0=[0.0, 0.0], span=(-0.5, 0.3))
    (fold,) = rest.special("H")[0].switch().special("LPC")
    targets = [(fold, "x_amplitude", 0.8, 1e-3), (fold, "period", 3.0, 1e-2)]
    found = pk.fit(QUINTIC, targets, free=["b", "w"])
    assert found.converged
    assert found.parameters["b"] == pytest.approx(2.0 * 0.64, rel=1e-8)
    assert found.parameters["w"] == pytest.approx(2.0 * np.pi / 3.0 - 0.3 * 0.64, rel=1e-8)


def test_cycles_at_given_parameters_are_events():
    flow = QUINTIC.replace(mu=0.2)
    start = pk.periodic_orbit(flow, [1.08, 0.0], settle=30.0)
    family = pk.continuation(flow, "mu", orbit=start, span=(0.0, 0.4), events={"at": "mu - 0.3"})
    (point,) = family.special("at")
    targets = [(point, "x_amplitude", 1.1, 1e-3), (point, "period", 2.5, 1e-3)]
    found = pk.fit(flow, targets, free=["b", "c"])
    assert found.converged
    # mu + b r^2 - r^4 = 0 at mu = 0.3, r = 1.1; w + c r^2 = 2 pi/2.5.
    assert found.parameters["b"] == pytest.approx((1.1**4 - 0.3) / 1.21, rel=1e-7)
    assert found.parameters["c"] == pytest.approx((2.0 * np.pi / 2.5 - 2.0) / 1.21, rel=1e-7)


def test_targets_that_contradict_each_other_leave_residuals():
    low, _ = hopf_points()
    targets = [(low, "I", 0.34, 0.001), (low, "I", 0.36, 0.001)]
    found = pk.fit(NERVE, targets, free=["a"])
    assert found.converged
    np.testing.assert_allclose(found.targets.residual, [10.0, -10.0], rtol=1e-6)


def test_what_cannot_be_met_is_not_announced():
    cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
    fold = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1)).special("LP")[0]
    found = pk.fit(cusp, [(fold, "mu", -0.3, 0.01)], free=["l"])  # this one is at mu > 0
    assert not found.converged
    assert found.message


@pytest.mark.parametrize(
    ("targets", "free", "match"),
    [
        ([], ["a"], "targets"),
        ([("hopf", "I", 0.3, 0.1)], ["a"], r"targets\[0\]\[0\]"),
        ("point", [], "free"),
        ("point", ["q"], "parameter"),
        ("point", ["a", "a"], "differ"),
        ("zero", ["a"], "> 0"),
        ("unknown", ["a"], "one of"),
    ],
)
def test_bad_arguments(targets, free, match):
    if isinstance(targets, str):
        low, _ = hopf_points()
        error, name = (0.0 if targets == "zero" else 0.1), ("q" if targets == "unknown" else "I")
        targets = [(low, name, 0.3, error)]
    with pytest.raises(pk.ParameterError, match=match):
        pk.fit(NERVE, targets, free=free)


def test_points_of_another_problem_are_refused():
    (low, _) = hopf_points()
    with pytest.raises(pk.ParameterError, match="follow the branch of the problem"):
        pk.fit(NERVE.replace(a=0.6), [(low, "I", 0.3, 0.1)], free=["a"])


@pytest.mark.parametrize(
    "other",
    [
        pk.Problem({**dict(zip("vw", NERVE.f, strict=True)), "w": "eps*(v + a - 2*b*w)"},
                   parameters=dict(NERVE.parameters)),
        pk.Problem(["v - v**3/3 - w + I", "eps*(v + a - b*w)"], ("v", "w"),
                   dict(NERVE.parameters), time="t", period=1.0),
        pk.Problem(lambda x, **p: [x[0] + p["I"], p["eps"]*(x[1] + p["a"])], ("v", "w"),
                   dict(NERVE.parameters)),
        pk.Problem(NERVE.f, ("v", "w"), dict(NERVE.parameters), map=True),
    ],
    ids=["one coefficient", "forced", "function", "map"],
)  # fmt: skip
def test_points_of_other_equations_with_the_same_names_are_refused(other):
    (low, _) = hopf_points()
    with pytest.raises(pk.ParameterError, match=r"targets\[0\]\[0\].*its equations are others"):
        pk.fit(other, [(low, "I", 0.3, 0.1)], free=["a"])
    again = pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"}, parameters=dict(NERVE.parameters)
    )
    assert pk.fit(again, [(low, "I", 0.35, 0.1)], free=["a"]).converged  # the same, typed again


def test_a_fit_whose_derivatives_are_lost_has_not_converged(monkeypatch):
    (low, _) = hopf_points()
    slopes = fit_module._Search.slopes
    calls = []

    def lost(self):
        calls.append(slopes(self))
        return calls[-1] if len(calls) < 3 else calls[-1] * np.nan

    monkeypatch.setattr(fit_module._Search, "slopes", lost)
    found = pk.fit(NERVE, [(low, "I", low["I"], 0.1)], free=["a"])
    assert len(calls) >= 3
    assert not found.converged
    assert "derivatives are not known" in found.message
    assert np.isnan(found.errors["a"])


@pytest.mark.slow
def test_noise_is_covered_by_the_covariance():
    wanted = {"a": 0.72, "b": 0.78, "eps": 0.09}
    values, rng = np.array(onset(**wanted)), np.random.default_rng(1)
    within, runs = 0, 100
    for _ in range(runs):
        noisy = values + 1e-3 * rng.standard_normal(3)
        found = pk.fit(NERVE, targets_of(noisy), free=list(wanted))
        assert found.converged
        off = np.array([found.parameters[name] - value for name, value in wanted.items()])
        # 99 % of the chi-squared distribution of three degrees of freedom.
        within += off @ np.linalg.solve(found.covariance.values, off) < 11.345
    assert within >= 95
