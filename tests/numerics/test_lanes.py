"""Machine code of eight lanes against mpmath and NumPy."""

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from phasekit.errors import ParameterError
from phasekit.laws.formulas import read_formula
from phasekit.numerics.compile import kernel
from phasekit.numerics.lanes import LANES, LARGE, compile_lanes, invoke

X, Y = sp.symbols("x y", real=True)


@kernel
def run(address, x, p, z, out):
    invoke(address, x, p, z, out)


def values(expressions, x, y):
    """The expressions at eight points."""
    address = compile_lanes(expressions, {X: (0, 0), Y: (1, 0)})
    out = np.zeros(LANES * len(expressions))
    run(address, np.array(x, float), np.array(y, float), np.zeros(LANES), out)
    return out.reshape(len(expressions), LANES)


@pytest.mark.parametrize("size", [1e-300, 1e-9, 1.0, 30.0, 1e4, 0.9 * LARGE, 1e9])
def test_sine_and_cosine_to_rounding(size):
    rng = np.random.default_rng(3)
    address = compile_lanes([sp.sin(X), sp.cos(X)], {X: (0, 0)})
    out = np.zeros(2 * LANES)
    with mp.workdps(40):
        for _ in range(40):
            x = rng.uniform(-size, size, LANES)
            run(address, x, x, x, out)
            for i in range(LANES):
                for found, function in ((out[i], mp.sin), (out[LANES + i], mp.cos)):
                    exact = function(mp.mpf(float(x[i])))
                    assert abs(found - exact) <= 1.5 * 2.0**-53
                    assert abs(found - exact) <= 3.0 * 2.0**-53 * abs(exact)


def test_multiples_of_a_quarter_turn_and_what_is_no_number():
    x = [0.0, np.pi / 2, np.pi, -np.pi / 2, 3e6, np.inf, np.nan, -0.0]
    sine, cosine = values([sp.sin(X), sp.cos(X)], x, np.zeros(LANES))
    with np.errstate(invalid="ignore"):
        assert np.allclose(sine, np.sin(x), rtol=0, atol=1.2e-16, equal_nan=True)
        assert np.allclose(cosine, np.cos(x), rtol=0, atol=1.2e-16, equal_nan=True)


def test_one_large_lane_takes_the_others_along():
    x = np.array([0.3, 1e8, -0.7, 2.0, 1.0, -3.0, 12.0, 1e7])
    sine, cosine = values([sp.sin(X), sp.cos(X)], x, np.zeros(LANES))
    assert np.allclose(sine, np.sin(x), rtol=0, atol=2.3e-16)
    assert np.allclose(cosine, np.cos(x), rtol=0, atol=2.3e-16)


@pytest.mark.parametrize(
    "text",
    [
        "x^3 - 2*x*y + y^2/(1 + x^2)",
        "exp(-x^2)*tanh(y) + sqrt(1 + y^2)",
        "Piecewise((x, x > y), (y^2, (x < 0) & ~(y > 1)), (1, True))",
        "Max(x, y) - Abs(x) + sign(y) + Heaviside(x)",
        "x**0.3 + log(1 + y**2) + atan2(y, x)",
        "7",
    ],
)
def test_lanes_give_what_numpy_gives(text):
    expression = read_formula(text, {"x": X, "y": Y})
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.1, 2.0, LANES), rng.uniform(-2.0, 2.0, LANES)
    expected = [float(expression.subs({X: a, Y: b})) for a, b in zip(x, y, strict=True)]
    assert values([expression], x, y)[0] == pytest.approx(expected, rel=1e-14, abs=1e-15)


def test_an_unknown_function_is_refused():
    with pytest.raises(ParameterError, match="besselj"):
        compile_lanes([sp.besselj(0, X)], {X: (0, 0)})
