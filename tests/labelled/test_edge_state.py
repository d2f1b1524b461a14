"""States on the boundary of basins, against saddles and cycles in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import phasekit as pk

KIND = pk.AttractorKind


def test_the_edge_of_a_bistable_flow_is_its_saddle():
    """FitzHugh and Nagumo's with three equilibria: 0 is the saddle, by its derivatives."""
    system = pk.Problem(
        {"x": "10*(x - x^3 - y)", "y": "x - 3*y"}, window={"x": (-2, 2), "y": (-1, 1)}
    )
    ds = pk.edge_state(system, {"x": -1.0, "y": 0.0}, [1.0, 0.2])
    assert ds.edge_kind.item() == KIND.EQUILIBRIUM
    assert abs(ds.edge_x.item()) < 1e-12
    assert abs(ds.edge_y.item()) < 1e-12
    growth = np.linalg.eigvals(np.array([[10.0, -10.0], [1.0, -3.0]])).max()
    assert ds.edge_exponent.item() == pytest.approx(growth, rel=1e-9)
    assert ds.n_unstable.item() == 1
    assert ds.basin_of_a.item() != ds.basin_of_b.item()
    root = np.sqrt(2.0 / 3.0)
    np.testing.assert_allclose(np.sort(ds.attractor_x[:, 0]), [-root, root], rtol=1e-9)
    # The way there keeps to the stable manifold: its two ends are apart, its last state is at 0.
    assert abs(ds.track_x[0].item()) > 1e-3
    assert abs(ds.track_x[-1].item()) < 0.04


@pytest.mark.slow
def test_the_edge_between_two_cycles_is_the_one_that_repels():
    """R' = r (1 - r^2)(4 - r^2)(9 - r^2)/100: the multiplier at 2 is exp(1.2 pi)."""
    radial = "(1 - r2)*(4 - r2)*(9 - r2)/100"
    flow = pk.Problem(
        {"x": f"x*({radial}) - w*y", "y": f"y*({radial}) + w*x"}, parameters={"w": 2.0},
        definitions={"r2": "x^2 + y^2"}, window={"x": (-4, 4), "y": (-4, 4)},
    )  # fmt: skip
    ds = pk.edge_state(flow, [0.5, 0.0], [3.5, 0.2])
    assert ds.edge_kind.item() == KIND.CYCLE
    np.testing.assert_allclose(np.hypot(ds.edge_x, ds.edge_y), 2.0, rtol=1e-9)
    assert ds.edge_period.item() == pytest.approx(np.pi, rel=1e-9)
    assert ds.edge_multiplier.item() == pytest.approx(np.exp(1.2 * np.pi), rel=1e-6)
    assert ds.edge_exponent.item() == pytest.approx(1.2, rel=1e-6)


@pytest.mark.slow
def test_the_edge_of_infinity_of_henons_map_is_its_other_fixed_point():
    a, b = 1.4, 0.3
    henon = pk.Problem(
        {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": a, "b": b}, map=True,
        window={"x": (-2, 2), "y": (-2, 2)},
    )  # fmt: skip
    ds = pk.edge_state(henon, [0.1, 0.1], [-1.8, 0.1])
    x = (b - 1.0 - np.sqrt((1.0 - b) ** 2 + 4.0 * a)) / (2.0 * a)
    assert ds.edge_x.item() == pytest.approx(x, rel=1e-12)
    assert ds.basin_of_b.item() == -2
    multiplier = np.abs(np.roots([1.0, 2.0 * a * x, -b])).max()
    assert ds.edge_multiplier.item() == pytest.approx(multiplier, rel=1e-9)


@pytest.mark.slow
def test_the_edge_of_a_forced_oscillator_is_an_unstable_cycle():
    forced = pk.Problem(
        {"x": "v", "v": "x - x^3 - d*v + F*cos(t)"}, parameters={"d": 0.15, "F": 0.2},
        time="t", period="2*pi", window={"x": (-2.2, 2.2), "v": (-2.2, 2.2)},
    )  # fmt: skip
    sides = pk.attractors(forced)
    a, b = ([sides.attractor_x.values[k, 0], sides.attractor_v.values[k, 0]] for k in (0, 1))
    ds = pk.edge_state(forced, a, b)
    start = [ds.edge_x.values[0], ds.edge_v.values[0]]
    off = 1e-5 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    after = pk.flow(forced, list((start + off).T), 2.0 * np.pi, rtol=1e-12)
    x, v = after.motion_x.values, after.motion_v.values
    assert (x[0], v[0]) == pytest.approx(start, abs=1e-8)
    slope = np.array([[x[1] - x[2], x[3] - x[4]], [v[1] - v[2], v[3] - v[4]]]) / 2e-5
    found = np.abs(np.linalg.eigvals(slope))
    assert ds.edge_multiplier.item() == pytest.approx(found.max(), rel=1e-5)
    assert ds.n_unstable.item() == (found > 1.0).sum() == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: pk.edge_state(p, [1.0], [0.5]), "b: got .*both come to the attractor"),
        (lambda p: pk.edge_state(p, [0.0], [0.5]), "a: got .* came to no attractor"),
        (lambda p: pk.edge_state(p, [0.0, 1.0], [0.5]), r"a\['x'\]: got"),
        (lambda p: pk.edge_state(pk.Pendulum(length=1.0), [0.0], [0.5]), "system: got"),
        (lambda p: pk.edge_state(p.replace(r=[1.0, 2.0]), [-1.0], [0.5]), "array parameters"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    problem = pk.Problem("r*x - x^3", "x", {"r": 1.0}, window={"x": (-2, 2)})
    with pytest.raises(pk.ParameterError, match=message):
        call(problem)
