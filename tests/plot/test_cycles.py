"""Branches of periodic orbits, drawn."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import phasekit as pk


def test_largest_and_least_values_with_stability(ax):
    rate = "(p + x**2 + y**2 - (x**2 + y**2)**2)"
    system = pk.Problem([f"x*{rate} - y", f"y*{rate} + x"], ("x", "y"), {"p": -0.5})
    rest = pk.continuation(system, "p", x0=[0.0, 0.0], span=(-0.5, 0.5))
    cycles = rest.special("H")[0].switch()
    assert pk.plot.branch([rest, cycles], ax=ax) is ax
    drawn = [line for line in ax.lines if len(line.get_xdata()) > 3]
    values = np.concatenate([line.get_ydata() for line in drawn])
    assert np.isclose(np.nanmax(values), float(cycles.points.x_max.max()))
    assert np.isclose(np.nanmin(values), float(cycles.points.x_min.min()))
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"stable equilibrium", "unstable cycle, max and min", "LPC"} <= set(labels)
    ax.clear()
    cycles.plot(ax=ax, y="period")
    assert ax.get_ylabel() == "period of the orbit"


def test_multipliers_are_shown_beside_the_unit_circle(ax):
    pendulum = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.1, torque=0.5)
    orbit = pk.periodic_orbit(pendulum, [0.0, 5.0])
    family = pk.continuation(pendulum, "torque", orbit=orbit, span=(0.4, 0.8))
    assert pk.plot.multipliers(family, ax=ax) is ax
    (dots,) = (one for one in ax.collections if len(one.get_offsets()))
    x, y = dots.get_offsets().T
    found = family.points["multiplier"].values
    assert np.array_equal(x + 1j * y, found.ravel())
    assert np.array_equal(dots.get_array(), np.repeat(family.points.torque.values, 2))
    (circle,) = ax.lines
    np.testing.assert_allclose(np.hypot(*circle.get_data()), 1.0, rtol=1e-15)
    assert ax.get_aspect() == 1.0
    low, high = ax.get_xlim()
    assert low <= -1.0 < x.max() <= high
    with pytest.raises(pk.ParameterError, match="^branch: got"):
        pk.plot.multipliers(orbit)


def test_one_family_alone(ax):
    system = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 0.5})
    few = pk.ContinuationOptions(max_points=3, intervals=10)
    orbit = pk.periodic_orbit(system, [2.0, 0.0], options=few)
    cycles = pk.continuation(system, "mu", orbit=orbit, span=(0.4, 0.6), options=few)
    cycles.plot(ax=ax)
    values = np.concatenate([line.get_ydata() for line in ax.lines])
    assert np.isclose(np.nanmax(values), float(cycles.points.x_max.max()))


@pytest.mark.slow
def test_branches_of_a_perturbed_system_have_its_words_and_units(ax, tmp_path):
    driven = pk.Perturbed(
        pk.Pendulum(length=1.0, g=1.0), damping=0.1, forcing=pk.Harmonic(0.2, 1.3)
    )
    few = pk.ContinuationOptions(max_points=3, intervals=10)
    orbit = pk.periodic_orbit(driven, [0.0, 0.0], settle=100.0, options=few)
    family = pk.continuation(driven, "forcing_frequency", orbit=orbit, span=(1.2, 1.4), options=few)
    family.save(tmp_path / "family.zarr")
    loaded = pk.Branch.load(tmp_path / "family.zarr")
    copied = pickle.loads(pickle.dumps(family))
    for one in (family, loaded, copied):
        attrs = {name: one.points[name].attrs for name in ("phi_max", "dphi_min", "damping")}
        assert {name: words["units"] for name, words in attrs.items()} == {
            "phi_max": "rad", "dphi_min": "s-1", "damping": "s-1",
        }  # fmt: skip
        assert attrs["phi_max"]["long_name"] == "largest angle"
        assert one.orbit(0).phi.attrs == orbit.phi.attrs == {"long_name": "angle", "units": "rad"}
        assert one.orbit(0).time.attrs["units"] == "s"
        one.plot(ax=ax, angles="deg")
        assert ax.get_ylabel() == r"$\varphi$ (°)"
        assert ax.get_xlabel() == r"angular frequency of the forcing (s$^{-1}$)"
        ax.clear()


def test_equilibria_of_a_perturbed_system_have_units_and_a_problem_of_ones_own_its_words(ax):
    damped = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.1)
    rest = pk.continuation(damped, "damping", x0=[0.0, 0.0], span=(0.1, 0.3))
    rest.plot(y="dphi", ax=ax)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "linear damping (s$^{-1}$)", "angular velocity (rad/s)",
    )  # fmt: skip
    fall = pk.Problem("g - d*v", "v", {"g": 9.81, "d": 1.0})
    words = {"v": {"long_name": "speed", "units": "m s-1"}}
    ax.clear()
    pk.continuation(fall.described(words), "d", x0=[9.81], span=(1, 2)).plot(ax=ax)
    assert ax.get_ylabel() == "speed (m s$^{-1}$)"
    assert fall.described(words).replace(d=2.0).words == words
    for wrong in ({"w": {}}, {"v": {"unit": "m"}}, {"v": {"units": 1}}, [1]):
        with pytest.raises(pk.ParameterError, match="^words"):
            fall.described(wrong)


@pytest.mark.parametrize("level", [0.0, 1.0 / 3.0, -7e6])
def test_a_constant_state_is_drawn_as_one_and_not_as_its_rounding(ax, level):
    level_of = pk.Problem(["m - x**3", "(c - y)*(1 + m**2)"], ("x", "y"), {"m": 1.0, "c": level})
    branch = pk.continuation(level_of, "m", x0=[1.0, level], span=(0.5, 2.0))
    branch.plot(y="y", ax=ax)
    low, high = ax.get_ylim()
    assert low < level < high
    assert high - low > 1e-3 * max(abs(level), 1e-3)
    ax.clear()
    branch.plot(y="x", ax=ax)
    assert np.ptp(ax.get_ylim()) < 1.0
