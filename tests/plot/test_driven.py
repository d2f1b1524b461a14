"""Pictures of damped and driven motions: what they show is what was computed."""

import numpy as np
import pytest

import phasekit as pk
from phasekit.plot.parts import style

EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
DAMPED = pk.Perturbed(EIGHT, damping=0.2)
DISK = pk.GyroRotorDisk(beta=1.0, e=0.01, a=0.1, r=0.1, omega1=0.0, m=2.0, half_span=0.1)


def test_manifolds_end_at_rest_and_begin_at_saddles(ax):
    pk.plot.damped_portrait(DAMPED, ax=ax)
    found = pk.equilibria(DAMPED).phi
    rests = found.values[[0, 2]]
    unstable = [line for line in ax.get_lines() if line.get_color() == style.VERMILLION
                and line.get_linestyle() == "-"]  # fmt: skip
    assert len(unstable) == 4
    ends = []
    for line in unstable:
        x, v = line.get_data()
        keep = np.isfinite(x)
        assert abs(v[keep][-1]) < 1e-2
        ends.append(np.abs(x[keep][-1] - rests + np.pi) % (2 * np.pi) - np.pi)
    assert (np.abs(ends).min(axis=1) < 0.05).all()


def test_a_motion_crosses_no_stable_manifold(ax):
    pk.plot.damped_portrait(DAMPED, orbits=[[1.0, 0.5], [-1.5, 0.2]], angles="deg", ax=ax)
    assert ax.get_xlabel() == "$\\varphi$ (°)"
    with pytest.raises(pk.ParameterError, match="a system that does not vary with time"):
        pk.plot.damped_portrait(pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.1, 1.0)))
    with pytest.raises(pk.ParameterError, match="perturbed: got"):
        pk.plot.damped_portrait(EIGHT)


def test_basins_show_shares_and_odds(ax):
    ds = pk.basins(DAMPED, phi=np.linspace(-3, 3, 31), dphi=np.linspace(-1.5, 1.5, 25))
    pk.plot.basins(ds, capture=pk.capture(DAMPED), ax=ax)
    shown = ax.collections[0].get_array().reshape(25, 31)
    assert np.array_equal(shown, ds.basin.values.T)
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    for i, region in enumerate(("left", "right")):
        odds = pk.capture(DAMPED).capture_probability.sel(region=region).item()
        assert f"{ds.basin_fraction.values[i]:.3f}" in texts[i]
        assert f"predicted odds {odds:.3f}" in texts[i]
    with pytest.raises(pk.ParameterError, match="dataset"):
        pk.plot.basins(ds.drop_vars("basin"))


def test_basins_of_equations_show_their_plane(ax):
    flow = pk.Problem(
        {"x": "x - x^3", "y": "-y", "z": "-2*z"}, window={n: (-1.5, 1.5) for n in "xyz"}
    ).described({"y": {"units": "m"}})
    axis = np.linspace(-1.5, 1.5, 6)
    ds = pk.basins(flow, {"x": axis, "y": axis[:5], "z": axis[:4]})
    pk.plot.basins(ds, x="y", z=0.5, ax=ax)  # the nearest is 0.3
    shown = ax.collections[0].get_array().reshape(6, 5)
    assert np.array_equal(shown, ds.basin.values[:, :, 3])
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("$y$ (m)", "$x$", "z = 0.3")
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts[0].startswith("at (0, −1): 0.500")
    with pytest.raises(pk.ParameterError, match="states x, y, z, wants two.*z=0.0"):
        pk.plot.basins(ds)
    with pytest.raises(pk.ParameterError, match="state of the grid 'w' is unknown"):
        pk.plot.basins(ds, w=0.0)
    with pytest.raises(pk.ParameterError, match="angles"):
        pk.plot.basins(ds, z=0.0, angles="deg")


def test_cycles_are_closed_lines_wherever_an_angle_is_seen(ax):
    # r' = r (1 - r^2) in the angle and the rate of a circle of radius 1 about (0, 0).
    turning = pk.Problem(
        {"q": "1 + 0.2*sin(q)", "r": "r*(1 - r^2)"}, periods={"q": 2 * np.pi}, window={"r": (0, 2)}
    )
    ds = pk.basins(turning, {"q": np.linspace(0.0, 12.0, 13), "r": np.linspace(0.1, 2.0, 9)})
    pk.plot.basins(ds, ax=ax)
    (line,) = ax.get_lines()
    q, r = line.get_data()
    seen = np.isfinite(q) & (q >= 0.0) & (q <= 12.0)
    np.testing.assert_allclose(r[seen], 1.0, atol=1e-8)
    assert np.ptp(q[seen]) > 11.5
    period = 2 * np.pi / np.sqrt(1.0 - 0.04)
    assert f"cycle of period {period:.4g}" in ax.get_legend().get_texts()[0].get_text()


def test_a_section_shows_its_states(ax):
    system = pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.6, 1.0))
    ds = pk.stroboscopic(system, [0.1, 0.4], 0.0, n=30, skip=5)
    pk.plot.poincare_section(ds, angles="deg", ax=ax)
    assert len(ax.get_lines()) == 2
    x, v = ax.get_lines()[1].get_data()
    assert np.allclose(x, np.degrees(ds.section_phi.values[1]))
    assert np.allclose(v, np.degrees(ds.section_dphi.values[1]))


def test_a_run_up_shows_forces_and_speed(ax):
    ds = pk.run_up(DISK, omega1=lambda t: 5.0 * t, phi0=0.1, dphi0=0.0, t=np.linspace(0, 2, 41))
    pk.plot.run_up(ds, ax=ax)
    for line, bearing in zip(ax.get_lines(), ("A2", "B2"), strict=True):
        assert np.array_equal(line.get_ydata(), ds.force_magnitude.sel(bearing=bearing))
    speeds = [other for other in ax.figure.axes if other is not ax][0]
    assert speeds.get_lines()[0].get_ydata()[-1] == pytest.approx(10.0)
    many = pk.run_up(DISK, omega1=lambda t: t, phi0=[0.1, 0.2], dphi0=0.0, t=[0.0, 1.0])
    with pytest.raises(pk.ParameterError, match="one motion over time"):
        pk.plot.run_up(many)


@pytest.mark.slow
def test_speeds_without_end_are_drawn_as_far_as_they_are_seen(ax):
    # Backwards in time a damped motion speeds up: it would turn round 10^5 times.
    for damping in (0.3, -0.3):
        ax.clear()
        pk.plot.damped_portrait(DAMPED.replace(damping=damping), ax=ax, cut=0.0)
        assert ax.get_ylim()[1] < 5.0
        assert ax.get_xlim() == pytest.approx((0.0, 2.0 * np.pi))
        sizes = [line.get_xdata().size for line in ax.get_lines()]
        assert len(sizes) >= 10
        assert sum(sizes) < 200_000


def test_attractors_are_shown_wherever_they_are_seen(ax):
    ds = pk.basins(DAMPED, phi=np.linspace(0.0, 12.0, 31), dphi=np.linspace(-1.0, 1.0, 21))
    pk.plot.basins(ds, ax=ax)
    places = np.concatenate([line.get_xdata() for line in ax.get_lines()])
    assert places.size == 4
    assert ((places >= 0.0) & (places <= 12.0)).all()


def test_manifolds_against_strong_damping_stay_small(ax):
    pk.plot.damped_portrait(pk.Perturbed(pk.Coefficients(2.0, 1.0, 0.3), damping=0.5), ax=ax)
    assert len(ax.get_lines()) >= 10
    assert max(len(line.get_xdata()) for line in ax.get_lines()) < 1_000_000


def test_section_of_equations_shows_the_states_that_it_does_not_hold(ax):
    rates = {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8/3*z"}
    lorenz = pk.Problem(rates)
    ds = pk.poincare_section(lorenz, {"x": [1, 2], "y": 1, "z": 20}, section="x = y", n=3)
    held = pk.poincare_section(lorenz, {"x": 1, "y": 1, "z": 20}, section="y", n=3)
    for section, across, up in ((ds, "x", "y"), (held, "x", "z")):
        ax.clear()
        pk.plot.poincare_section(section, ax=ax)
        drawn = np.array([line.get_xydata() for line in ax.lines])
        names = (f"section_{across}", f"section_{up}")
        expected = np.stack([section[name].values for name in names], axis=-1)
        np.testing.assert_array_equal(drawn, expected.reshape(drawn.shape))
        assert (ax.get_xlabel(), ax.get_ylabel()) == (
            f"{across} in the section",
            f"{up} in the section",
        )
    with pytest.raises(pk.ParameterError, match="pk.poincare_section or pk.stroboscopic returns"):
        pk.plot.poincare_section(pk.equilibria(lorenz, box={s: (-30, 40) for s in "xyz"}))
