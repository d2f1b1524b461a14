"""Where a test function along a family vanishes: few points, also where it is steep or unknown."""

from types import SimpleNamespace

import numpy as np
import pytest

from phasekit.cycles import between
from phasekit.cycles.between import root


def search(value, length=1.0):
    """The zero of a function of the distance, and at how many points it was asked for."""
    asked = []
    line = SimpleNamespace(
        cycles=SimpleNamespace(forced=False), length=length, a=0.0, b=length,
        point=lambda s: asked.append(s) or s,
    )  # fmt: skip
    return root(line, lambda s, forced: value(s)), len(asked)


@pytest.mark.parametrize("zero", [0.123, 0.5, 0.987])
@pytest.mark.parametrize(
    ("shape", "most"),
    [
        (lambda d: d, 4),
        (lambda d: 1e10 * d * (1 + d), 12),
        (lambda d: np.expm1(8 * d), 12),
        (lambda d: np.sinh(25 * d), 18),
        (lambda d: np.sign(d) * abs(d) ** 0.5, 40),
        (lambda d: np.sign(d), 40),  # a jump
    ],
)
def test_zeros_are_found_with_few_points(zero, shape, most):
    found, asked = search(lambda s: shape(s - zero))
    assert found == pytest.approx(zero, abs=2e-11)
    assert asked <= most


def test_noise_ends_the_search():
    rng = np.random.default_rng(1)
    found, asked = search(lambda s: 1e8 * (s - 0.3) + rng.uniform(-1.0, 1.0))
    assert found == pytest.approx(0.3, abs=1e-7)
    assert asked <= 12


def test_where_a_value_is_not_known_the_bracket_stays():
    """Unknown values have no sign: the zero is not sought on one side of them."""
    found, _ = search(lambda s: np.nan if abs(s - 0.4) < 1e-9 else s - 0.4)
    assert found == pytest.approx(0.4, abs=1e-2)
    found, _ = search(lambda s: np.nan if abs(s - 0.7) < 1e-2 else (s - 0.4) * (1 + s))
    assert found == pytest.approx(0.4, abs=1e-10)


@pytest.mark.parametrize("shown", [0, 1, 2])
def test_a_branch_point_stays_that_a_narrower_window_hides(shown, monkeypatch):
    """Orbits x = s whose determinant s - 0.3 rounding makes 1 in all windows but the first."""
    asked = []

    def determinant(point, forced):
        asked.append(point)
        return point.orbit.x[0] - 0.3 if len(asked) <= shown * between.NODES else 1.0

    def point(s):
        orbit = between.Orbit(np.array([0.0, 1.0]), np.array([s]), np.array([1.0, s]))
        return SimpleNamespace(orbit=orbit, dx=np.ones(1), dy=np.ones(2))

    monkeypatch.setattr(between, "determinant_whole", determinant)
    monkeypatch.setattr(between, "point_of", lambda cycles, checked, *at: checked)
    monkeypatch.setattr(between, "SETTLED", -1.0)
    cycles = SimpleNamespace(
        closes=True, forced=False, looked_at=lambda orbit, *rates: SimpleNamespace(orbit=orbit)
    )
    line = SimpleNamespace(cycles=cycles, length=1.0, a=SimpleNamespace(arclength=0.0), point=point)
    found = between.branching(line, None)
    assert (found is None) == (not shown)
    if shown:
        assert found.orbit.x[0] == pytest.approx(0.3, abs=1e-12)
