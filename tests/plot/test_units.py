"""Quantities are shown in the units that are asked for by their names."""

import functools
import inspect

import numpy as np
import pytest

import phasekit as pk

DEG, MM, RPM = 180.0 / np.pi, 1000.0, 30.0 / np.pi
EIGHT = pk.Coefficients(1.0, 0.4, 0.1)
DISK = pk.GyroRotorDisk(beta=1.4, e=0.05, a=0.012, r=0.2, omega1=31.4, m=2.0, half_span=0.2, g=9.81)


@functools.cache
def the_motion():
    return pk.flow(DISK, 0.5, 3.0, np.linspace(0.0, 2.0, 51))


@functools.cache
def the_map():
    return pk.sweep(
        DISK,
        beta=np.linspace(0.2, 1.5, 9),
        a=np.linspace(-0.06, 0.06, 7),
        of=("equilibria", "separatrices", "separatrix_forces"),
    )


@functools.cache
def the_atlas():
    return pk.branches(DISK, "beta", (0.2, 1.5))


@functools.cache
def the_plane():
    return pk.atlas(DISK, "beta", "a", span={"beta": (0.2, 1.5), "a": (-0.06, 0.06)})


@functools.cache
def the_set():
    return pk.bifurcation_set(DISK, "beta", "a", xlim=(0.0, 1.5), ylim=(-0.06, 0.06))


@functools.cache
def the_diagram():
    return pk.diagram(DISK, "beta", span=(0.05, 1.5))


@functools.cache
def the_loop():
    return pk.quasi_static(DISK.replace(beta=1.2), omega1=np.linspace(5.0, 40.0, 9), phi0=3.0)


NERVE = pk.Problem(
    {"v": "v - v^3/3 - w + 0.5", "w": "v + 0.7 - 0.8*w"},
    window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
).described({"v": {"units": "m"}, "w": {"units": "s"}})
SWINGS = pk.Problem(
    ["v", "-a*v - sin(phi) + 0.2*cos(t)"], ("phi", "v"), {"a": 0.3}, periods={"phi": 2 * np.pi},
    time="t", period=2 * np.pi,
)  # fmt: skip


@functools.cache
def rotations():
    oscillator = pk.Problem(["y", "(1 - x**2)*y - mu*x"], ("x", "y"), {"mu": 1.0}).described(
        {"time": {"units": "s"}}
    )
    few = pk.ContinuationOptions(intervals=12)
    return pk.periodic_orbit(oscillator, [2.0, 0.0], 6.7, options=few)


@functools.cache
def the_cycles():
    return pk.continuation(
        SWINGS, "a", orbit=pk.periodic_orbit(SWINGS, [0.0, 0.0]), span=(0.2, 0.5)
    )


DAMPED = pk.Perturbed(EIGHT, damping=0.2)


@functools.cache
def the_fates():
    return pk.basins(DAMPED, phi=np.linspace(-3.0, 3.0, 25), dphi=np.linspace(-1.5, 1.5, 21))


@functools.cache
def the_section():
    return pk.stroboscopic(
        pk.Perturbed(EIGHT, damping=0.1, forcing=pk.Harmonic(0.6, 1.0)), [0.1, 0.4], 0.0, n=30
    )


STILL, EVEN = DISK.replace(omega1=0.0), np.linspace(0.0, 2.0, 41)


@functools.cache
def the_samples():
    logistic = pk.Problem("r*x*(1 - x/K)", "x", {"r": 3.0, "K": 1.0}, map=True).described(
        {"x": {"units": "m"}, "r": {"units": "s"}}
    )
    return pk.orbit_diagram(logistic, "r", [2.0, 3.2, 3.5, 3.2], 0.3, n=8)


@functools.cache
def the_exponents():
    logistic = pk.Problem("r*x*(1 - x/K)", "x", {"r": 3.0, "K": 1.0}, map=True).described(
        {"K": {"units": "m"}, "r": {"units": "s"}}
    )
    return pk.sweep(logistic, r=[2.0, 3.2, 3.9], K=[1.0, 2.0], of="lyapunov", x=0.3, n=400)


@functools.cache
def the_speeding():
    return pk.run_up(STILL, omega1=lambda t: 5.0 * t, phi0=0.1, dphi0=0.0, t=EVEN)


STATE_UNITS = ({"phi": "deg", "dphi": "rpm"}, (DEG, RPM), ("(°)", "(rpm)"))
P = pk.plot
SPAN = {"xlim": (0.2, 1.5), "ylim": (-0.05, 0.05), "cells": 4, "legend": False}


#: A picture, the units asked for, what both axes are multiplied by, and words at them.
def pendulums():
    """Pendulums of three lengths."""
    return pk.flow(pk.Pendulum(length=[0.5, 1.0, 2.0]), 0.5, 0.0, np.linspace(0.0, 20.0, 201))


CASES = {
    "basins": (lambda **o: P.basins(the_fates(), **o), *STATE_UNITS),
    "damped_portrait": (
        lambda **o: P.damped_portrait(DAMPED, orbits=(1.0, 0.5), **o),
        *STATE_UNITS,
    ),
    "poincare_section": (lambda **o: P.poincare_section(the_section(), **o), *STATE_UNITS),
    "run_up": (
        lambda **o: P.run_up(the_speeding(), **o),
        {"time": "ms", "force": "kN", "omega1": "rpm"},
        (1e3, 1e-3),
        ("(ms)", "(kN)"),
    ),
    "phase_portrait": (
        lambda **o: P.phase_portrait(EIGHT, orbits=(0.3, 0.2), **o),
        {"phi": "deg", "dphi": "rpm"},
        (DEG, RPM),
        ("(°)", "(rpm)"),
    ),
    "potential_well": (
        lambda **o: P.potential_well(EIGHT, **o)[0],
        {"phi": "deg", "potential": "deg/s2"},
        (DEG, DEG),
        ("", r"(°/s$^2$)"),
    ),
    "bifurcation_diagram": (
        lambda **o: P.bifurcation_diagram(the_atlas(), **o),
        {"beta": "deg"},
        (DEG, 1.0),
        ("(°)", "(rad)"),
    ),
    "branch": (
        lambda **o: P.branch(the_diagram(), **o),
        {"beta": "deg", "phi": "degrees"},
        (DEG, DEG),
        ("(°)", "(°)"),
    ),
    "atlas": (
        lambda **o: P.atlas(the_plane(), **o),
        {"beta": "deg", "a": "mm"},
        (DEG, MM),
        ("(°)", "(mm)"),
    ),
    "bifurcation_set": (
        lambda **o: P.bifurcation_set(the_set(), **o),
        {"beta": "deg", "a": "mm"},
        (DEG, MM),
        ("(°)", "(mm)"),
    ),
    "branch_surface": (
        lambda **o: P.branch_surface(DISK, "beta", "a", **SPAN, **o),
        {"beta": "deg", "a": "mm", "phi": "deg"},
        (DEG, MM),
        ("(°)", "(mm)"),
    ),
    "force_polygon": (
        lambda **o: P.force_polygon(DISK, 0.5, 2.0, **o),
        {"force": "kN"},
        (1e-3, 1e-3),
        ("(kN)", "(kN)"),
    ),
    "bearing_forces": (
        lambda **o: P.bearing_forces(the_motion(), x="time", **o),
        {"time": "ms", "force": "kN"},
        (1e3, 1e-3),
        ("(ms)", "(kN)"),
    ),
    "bearing_load_map": (
        lambda **o: P.bearing_load_map(the_map(), **o),
        {"beta": "deg", "a": "mm"},
        (DEG, MM),
        ("(°)", "(mm)"),
    ),
    "hodograph": (
        lambda **o: P.hodograph(EIGHT, orbits=(0.3, 0.2), **o),
        {"rotator": "deg/s2"},
        (DEG, DEG),
        (r"(°/s$^2$)", r"(°/s$^2$)"),
    ),
    "hysteresis_loop": (
        lambda **o: P.hysteresis_loop(the_loop(), **o),
        {"phi": "deg", "omega1": "rpm"},
        (RPM, DEG),
        ("(rpm)", "(°)"),
    ),
    "orbit_diagram": (
        lambda **o: P.orbit_diagram(the_samples(), **o),
        {"x": "mm", "r": "ms"},
        (1e3, 1e3),
        ("(ms)", "(mm)"),
    ),
    "lyapunov_map": (
        lambda **o: P.lyapunov_map(the_exponents(), **o),
        {"r": "ms", "K": "mm"},
        (1e3, 1e3),
        ("(ms)", "(mm)"),
    ),
    "multipliers": (  # pure numbers
        lambda **o: P.multipliers(the_cycles(), **o),
        {"beta": "deg"},
        (1.0, 1.0),
        ("multipliers", "part"),
    ),
    "parameter_map": (
        lambda **o: P.parameter_map(the_map(), "exponent", equilibrium="lower_saddle", **o),
        {"beta": "deg", "a": "mm"},
        (DEG, MM),
        ("(°)", "(mm)"),
    ),
    "period_energy": (
        lambda **o: P.period_energy(EIGHT, 9, **o),
        {"period": "ms"},
        (1.0, 1e3),
        ("(s$^{-2}$)", "(ms)"),
    ),
    "frequency_action": (
        lambda **o: P.frequency_action(EIGHT, 9, **o),
        {"frequency": "rpm"},
        (1.0, RPM),
        ("(rad$^2$/s)", "(rpm)"),
    ),
    "phase_response": (
        lambda **o: P.phase_response(pk.phase_response(rotations()), "x", **o),
        {"time": "ms", "phase_response": "ms"},
        (1e3, 1e3),
        ("(ms)", "(ms)"),
    ),
    "spectrum": (
        lambda **o: P.spectrum(pk.spectrum(pendulums()).isel(length=0), "amplitude_phi", **o),
        {"frequency": "rpm", "amplitude_phi": "deg"},
        (RPM, 1.0 / pk.deg),
        ("(rpm)", "(°)"),
    ),
    "waterfall": (
        lambda **o: P.waterfall(pk.spectrum(pendulums(), "phi"), **o),
        {"frequency": "rpm", "length": "mm"},
        (RPM, 1e3),
        ("(rpm)", "(mm)"),
    ),
    "nullclines": (
        lambda **o: P.nullclines(NERVE, **o),
        {"v": "mm", "w": "ms"},
        (1e3, 1e3),
        ("(mm)", "(ms)"),
    ),
    "time_history": (
        lambda **o: P.time_history(the_motion(), "motion_dphi", **o),
        {"time": "ms", "dphi": "rpm"},
        (1e3, RPM),
        ("(ms)", "(rpm)"),
    ),
}


def drawn(ax):
    """All that has a place on the axes: lines, names of points and arrows, cells, contours."""
    solid = ax.name == "3d"
    data = [line.get_data_3d()[:2] if solid else line.get_data() for line in ax.lines]
    found = [np.array(one, dtype=float) for one in data]
    if solid:
        return [*found, np.array([ax.get_xlim(), ax.get_ylim()])]
    found += [np.array([text.xy]).T for text in ax.texts if hasattr(text, "xy")]
    for one in ax.collections:
        if hasattr(one, "get_coordinates"):
            found.append(one.get_coordinates().reshape(-1, 2).T)
        elif hasattr(one, "levels"):
            found += [path.vertices.T for path in one.get_paths()]
    return [points for points in found if points.size]


def test_every_picture_takes_units():
    names = set(pk.plot.__all__)
    assert set(CASES) == names
    for name in names:
        assert "units" in inspect.signature(getattr(pk.plot, name)).parameters, name


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_what_is_drawn_is_multiplied(name):
    draw, units, factors, words = CASES[name]
    plain, ax = draw(), draw(units=units)
    pairs = list(zip(drawn(plain), drawn(ax), strict=True))
    assert len(pairs) > 0
    whole = np.concatenate([one.T for one, _ in pairs])
    size = np.nanmax(np.abs(whole[np.isfinite(whole).all(axis=1)]), axis=0)
    for one, other in pairs:
        if np.ptp(one[1][np.isfinite(one[1])]) == 1.0 and (one[1] >= 0.0).all():
            continue  # a line from edge to edge, in shares of the axes
        for which, factor in enumerate(factors):
            np.testing.assert_allclose(
                other[which], factor * one[which], rtol=1e-9, atol=1e-9 * factor * size[which]
            )
    for text, word in zip((ax.get_xlabel(), ax.get_ylabel()), words, strict=True):
        assert text.replace("\n", " ").endswith(word)


def test_degrees_by_name_are_degrees_of_all():
    one = P.phase_portrait(EIGHT, angles="deg")
    other = P.phase_portrait(EIGHT, units={"phi": "deg", "dphi": "deg/s"})
    for line, same in zip(one.lines, other.lines, strict=True):
        np.testing.assert_allclose(line.get_data(), same.get_data(), rtol=1e-14)
    assert one.get_ylabel() == other.get_ylabel() == r"$\dot\varphi$ (°/s)"
    mixed = P.parameter_map(the_map(), angles="deg", units={"beta": "rad"})
    assert mixed.get_xlabel().endswith("(rad)")


def test_colors_have_units_too():
    bar = P.bearing_load_map(the_map(), units={"peak_force": "kN"}).collections[0]
    plain = P.bearing_load_map(the_map()).collections[0]
    np.testing.assert_allclose(bar.get_array(), plain.get_array() / 1000.0)
    assert bar.colorbar.ax.get_ylabel().endswith("(kN)")
    colored = P.phase_portrait(EIGHT, color_by="period", units={"period": "ms"})
    assert colored.figure.axes[1].get_ylabel() == "period (ms)"


@pytest.mark.parametrize("draw", [P.bifurcation_diagram, P.parameter_map, P.time_history])
def test_a_dataset_in_other_units_is_drawn_in_them(draw):
    ds = {
        P.bifurcation_diagram: the_map().isel(a=3, drop=False),
        P.parameter_map: the_map(),
        P.time_history: the_motion(),
    }[draw]
    options = {"variable": "fold_margin"} if draw is P.parameter_map else {}
    other = ds.copy()
    units = {"beta": ("deg", DEG), "a": ("mm", MM), "phi": ("deg", DEG), "motion_phi": ("deg", DEG)}
    units = {name: unit for name, unit in units.items() if name in ds.variables}
    for name, (unit, factor) in units.items():
        values = (ds[name].dims, ds[name].values * factor, {**ds[name].attrs, "units": unit})
        assign = other.assign_coords if name in ds.coords else other.assign
        other = assign({name: values})
    one = draw(other, **options)
    same = draw(ds, units={name: unit for name, (unit, _) in units.items()}, **options)
    assert one.get_xlabel() == same.get_xlabel()
    assert one.get_ylabel() == same.get_ylabel()
    pairs = list(zip(drawn(one), drawn(same), strict=True))
    assert pairs
    for got, want in pairs:
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-9)


def test_a_map_in_other_units_is_selected_in_them():
    three = pk.sweep(
        DISK, beta=the_map().beta.values[::2], a=the_map().a.values[::2], omega1=[10.0, 20.0, 30.0]
    )
    speeds = three.omega1
    other = three.assign_coords(omega1=("omega1", speeds.values * RPM, {"units": "rpm"}))
    other = other.assign_coords(a=("a", three.a.values * MM, {**three.a.attrs, "units": "mm"}))
    for draw, options in ((P.bearing_load_map, {}), (P.parameter_map, {"variable": "fold_margin"})):
        one = draw(other, omega1=20.0 * RPM, **options)
        same = draw(three, omega1=20.0, units={"a": "mm"}, **options)
        assert np.isfinite(same.collections[0].get_array()).any()
        for got, want in zip(drawn(one), drawn(same), strict=True):
            np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-12)
        values = (ax.collections[0].get_array() for ax in (one, same))
        np.testing.assert_allclose(*values, rtol=1e-9)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"bata": "deg"}, "^name in units 'bata' is unknown; did you mean 'beta'"),
        ({"beta": "mm"}, "^units: beta: got 'mm', wants rad or deg"),
        ({"beta": None}, "^units: beta: got None, wants rad or deg"),
        ({"a": "deg"}, "^units: a: got 'deg', wants m or cm or mm"),
        ({"topology": "deg"}, "^units: topology: got 'deg', wants '1'"),
        ({3: "deg"}, "^name in units 3 is unknown"),
        ("deg", "^units: got 'deg', wants a mapping"),
        (["deg"], "^units: got .*wants a mapping"),
    ],
)
def test_wrong_units_are_named(units, message):
    for draw in (P.parameter_map, P.bearing_load_map):
        with pytest.raises(pk.ParameterError, match=message):
            draw(the_map(), units=units)
    with pytest.raises(pk.ParameterError, match=message):
        P.phase_portrait(DISK, units=units)


def test_names_of_other_pictures_are_understood():
    assert P.phase_portrait(EIGHT, units={"beta": "deg", "omega1": "rpm", "a": "mm"}).lines


def test_the_rate_of_an_angle_of_any_name_is_shown_in_the_unit_of_the_angle():
    axes = {
        name: pk.plot.phase_portrait(
            pk.Potential(f"-cos({name})", name, period=2 * np.pi), energies=[0.5], angles="deg"
        )
        for name in ("phi", "theta")
    }
    assert axes["theta"].get_ylabel() == r"$\dot\theta$ (°/s)"
    lines, same = (axes[name].get_lines() for name in ("theta", "phi"))
    assert len(lines) == len(same) > 2
    for line, other in zip(lines, same, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), other.get_xydata())
    fastest = max(np.nanmax(line.get_ydata()) for line in lines)
    assert fastest == pytest.approx(2.0 * DEG, rel=1e-4)  # of the separatrix


@pytest.mark.slow
def test_angles_of_a_flow_are_shown_in_degrees():
    pendulum = pk.Problem(
        {"phi": "v", "v": "-sin(phi) - v/5"}, periods={"phi": 2 * np.pi},
        window={"phi": (-np.pi, np.pi), "v": (-3.0, 3.0)},
    )  # fmt: skip
    ax = pk.plot.phase_portrait(pendulum, angles="deg")
    assert ax.get_xlabel().endswith("(°)")
    ax.figure.canvas.draw()
    places = ax.get_xticks()
    words = [label.get_text().replace("\N{MINUS SIGN}", "-") for label in ax.get_xticklabels()]
    assert len(words) == 5
    np.testing.assert_allclose([float(word) for word in words], np.degrees(places))
    with pytest.raises(pk.ParameterError, match="angles: got 'deg', wants 'rad' where no state"):
        pk.plot.phase_portrait(
            pk.Problem({"x": "y", "y": "-x"}, window=dict.fromkeys("xy", (-1, 1))), angles="deg"
        )
