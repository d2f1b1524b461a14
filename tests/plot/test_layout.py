"""Every public picture, narrow and wide, light and dark, on ordinary and on degenerate input.

A picture is laid out as it would be saved; its texts must lie inside the figure and clear of each
other, and what is drawn must have at least half of the width.
"""

import functools
import importlib
import inspect
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from witnesses.text_boxes import drawn_texts, faults
from witnesses.variants import some

import phasekit as pk
from phasekit.labelled.accessor import MapPlots
from phasekit.plot.parts import style as parts

WIDTHS = (3.4, 6.4)
EIGHT = pk.Reduced(lam=0.4, psi=0.1)
CUSP = pk.Reduced(lam=1.0, psi=0.0)
FORCELESS = pk.Coefficients(0.0, 0.0, 0.0)
DISK = pk.GyroRotorDisk(beta=1.4, e=0.05, a=0.012, r=0.2, omega1=31.4, m=2.0, half_span=0.2, g=9.81)
#: As it swings, turns over, and rests.
STARTS = {"swing": (0.5, 3.0), "turn": (0.0, -60.0)}


@functools.cache
def plane():
    beta, a = np.linspace(0.0, np.pi / 2, 15), np.arange(-5, 6) * 12e-3
    return pk.sweep(DISK, beta=beta, a=a, of=("equilibria", "separatrices", "separatrix_forces"))


@functools.cache
def turns():
    problem = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 0.5})
    few = pk.ContinuationOptions(max_points=5, intervals=10)
    orbit = pk.periodic_orbit(problem, [2.0, 0.0], options=few)
    return pk.continuation(problem, "mu", orbit=orbit, span=(0.5, 2.0), options=few)


@functools.cache
def motions():
    return pk.flow(DISK, [0.5, 1.0, 2.0], [3.0, 0.0, -60.0], np.linspace(0.0, 2.0, 101))


@functools.cache
def pendulums():
    return pk.flow(pk.Pendulum(length=[0.5, 1.0, 2.0]), 0.5, 0.0, np.linspace(0.0, 20.0, 201))


@functools.cache
def loop():
    field = np.concatenate([np.linspace(3, -3, 60), np.linspace(-3, 3, 60)])
    return pk.quasi_static(pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.5), h_x=field)


@functools.cache
def crowded_atlas():
    """Three kinds of points whose names and regions touch in a narrow figure."""
    pushed = pk.Problem(
        {"x": "y", "y": "c + a*x + 0.3*y - x^3 - x^2*y"}, parameters={"a": 0.5, "c": 0.0},
        window={"x": (-2, 2), "y": (-2, 2)},
    )  # fmt: skip
    return pk.atlas(pushed, "a", "c", span={"a": (-1, 1), "c": (-1, 1)})


@functools.cache
def folding_atlas():
    rate = "(p + q*(x^2 + y^2) - (x^2 + y^2)^2)"
    folding = pk.Problem(
        {"x": f"x*{rate} - y", "y": f"y*{rate} + x"}, parameters={"p": 0.0, "q": 0.0},
        window={"x": (-1, 1), "y": (-1, 1)},
    )  # fmt: skip
    return pk.atlas(folding, "p", "q", span={"p": (-0.25, 0.15), "q": (-0.6, 0.8)}, cycles=True)


@functools.cache
def loci(kind):
    if kind == "disk":
        return pk.bifurcation_set(DISK, "beta", "a", xlim=(0.0, 1.5), ylim=(-0.06, 0.06))
    ends = {"astroid": (-1.5, 1.5), "empty": (3.0, 4.0)}[kind]
    return pk.bifurcation_set(pk.Reduced(0.0, 0.0), "lam", "psi", xlim=ends, ylim=ends)


@functools.cache
def atlas():
    return pk.branches(DISK, "beta", (0.0, np.pi / 2))


@functools.cache
def cubic():
    problem = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
    return pk.continuation(problem, "mu", x0=[-1.3], span=(-1.0, 1.0))


@functools.cache
def diagram():
    return pk.diagram(DISK, "beta", span=(0.05, 1.5))


DAMPED = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.2)
DOUBLE_WELL = pk.Potential("x^4/4 - x^2/2", "x")


@functools.cache
def fates(kind):
    if kind == "well":
        driven = pk.Perturbed(DOUBLE_WELL, damping=0.25, forcing=pk.Harmonic(0.1, 1.0))
        return pk.basins(driven, phi=np.linspace(-2.0, 2.0, 25), dphi=np.linspace(-2.0, 2.0, 25))
    if kind == "cycles":  # one of two cycles about a rest, and what runs away
        rate = "(x^2 + y^2 - 1)*(4 - x^2 - y^2)/4"
        flow = pk.Problem({"x": f"{rate}*x - y", "y": f"{rate}*y + x"})
        axis = np.linspace(-3.0, 3.0, 21)
        return pk.basins(flow, {"x": axis, "y": axis})
    if kind == "space":
        flow = pk.Problem({"x": "x - x^3", "y": "-y", "z": "-2*z"})
        axis = np.linspace(-1.5, 1.5, 6)
        return pk.basins(flow, {"x": axis, "y": axis, "z": axis})
    ends = {"damped": 3.0, "two turns": 6.5}[kind]
    phi, dphi = np.linspace(-ends, ends, 41), np.linspace(-1.5, 1.5, 31)
    return pk.basins(DAMPED, phi=phi, dphi=dphi)


LOGISTIC = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0, 1)})
HENON = pk.Problem(
    {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True,
    window={"x": (-2, 2), "y": (-2, 2)},
)  # fmt: skip


@functools.cache
def samples():
    r = np.linspace(2.8, 3.9, 60)
    return pk.orbit_diagram(LOGISTIC, "r", np.concatenate([r, r[::-1]]), n=32, skip=200)


@functools.cache
def exponents():
    a, b = np.linspace(0.9, 1.5, 13), np.linspace(0.0, 0.4, 9)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "lyapunov_exponent: ")  # some run to infinity
        return pk.sweep(HENON, a=a, b=b, of="lyapunov", x=0.1, y=0.1, n=300)


@functools.cache
def section(kind):
    base = {"well": DOUBLE_WELL, "eight": pk.Coefficients(1.0, 0.35, 0.12)}[kind]
    driven = pk.Perturbed(base, damping=0.25, forcing=pk.Harmonic(0.4, 1.0))
    return pk.stroboscopic(driven, [0.1, 0.4], 0.0, n=60, skip=5)


@functools.cache
def speeding():
    still = DISK.replace(omega1=0.0)
    times = np.linspace(0.0, 4.0, 201)
    return pk.run_up(still, omega1=lambda t: 5.0 * t, phi0=0.1, dphi0=0.0, t=times)


@functools.cache
def cycles():
    rate = "(p + x**2 + y**2 - (x**2 + y**2)**2)"
    problem = pk.Problem([f"x*{rate} - y", f"y*{rate} + x"], ("x", "y"), {"p": -0.5})
    rest = pk.continuation(problem, "p", x0=[0.0, 0.0], span=(-0.5, 0.5))
    return [rest, rest.special("H")[0].switch()]


@functools.cache
def swings():
    """Swings of a driven disk, through folds."""
    disk = pk.Perturbed(DISK.replace(omega1=2.0), damping=0.4, forcing=pk.Harmonic(8.0, 6.0))
    orbit = pk.periodic_orbit(disk, [0.0, 0.0], settle=60.0)
    return pk.continuation(disk, "forcing_frequency", orbit=orbit, span=(3.0, 9.0))


@functools.cache
def column():
    return pk.equilibria(pk.Reduced(lam=np.linspace(0.0, 1.5, 31), psi=0.1))


def without_values(ds):
    """A Dataset all of whose numbers are missing."""
    return ds.map(lambda one: one * np.nan if one.dtype.kind == "f" else one, keep_attrs=True)


P = pk.plot
PLANE = (pk.Reduced(0.0, 0.0), "lam", "psi")
#: Cases of every picture: what it shows, and how it is drawn.
CASES = {
    "basins": {
        "odds": lambda: P.basins(fates("damped"), capture=pk.capture(DAMPED)),
        "degrees": lambda: P.basins(fates("two turns"), units={"phi": "deg", "dphi": "rpm"}),
        "line": lambda: P.basins(fates("well")),
        "cycles": lambda: P.basins(fates("cycles")),
        "slice": lambda: P.basins(fates("space"), z=0.5),
    },
    "damped_portrait": {
        "eight": lambda: P.damped_portrait(DAMPED, orbits=[(1.0, 0.5), (-1.5, 0.2)]),
        "cut": lambda: P.damped_portrait(DAMPED, angles="deg", cut=0.0),
        "driven": lambda: P.damped_portrait(DAMPED.replace(damping=-0.2)),
    },
    "poincare_section": {
        "line": lambda: P.poincare_section(section("well")),
        "cut": lambda: P.poincare_section(section("eight"), units={"phi": "deg"}, cut=0.0),
        "all NaN": lambda: P.poincare_section(without_values(section("eight"))),
    },
    "run_up": {
        "disk": lambda: P.run_up(speeding()),
        "units": lambda: P.run_up(speeding(), units={"omega1": "rpm", "force": "kN"}),
        "all NaN": lambda: P.run_up(without_values(speeding())),
    },
    "phase_portrait": {
        "eight": lambda: P.phase_portrait(EIGHT, orbits=[(0.3, 0.0), (2.0, 2.0)]),
        "disk": lambda: P.phase_portrait(DISK, angles="deg", cut=0.0),
        "colored": lambda: P.phase_portrait(EIGHT, color_by="period"),
        "cusp": lambda: P.phase_portrait(CUSP),
        "no force": lambda: P.phase_portrait(FORCELESS),
        "support": lambda: P.phase_portrait(pk.FreeGyroRotor(DISK, 0.3)),
        "map": lambda: P.phase_portrait(HENON, orbits=(0.1, 0.1)),
    },
    "potential_well": {
        "eight": lambda: P.potential_well(EIGHT, orbits=(0.3, 0.0))[0],
        "no force": lambda: P.potential_well(FORCELESS)[0],
    },
    "bifurcation_diagram": {
        "atlas": lambda: P.bifurcation_diagram(atlas(), angles="deg"),
        "columns": lambda: P.bifurcation_diagram(column()),
        "frequency": lambda: P.bifurcation_diagram(column(), y="natural_frequency"),
        "all NaN": lambda: P.bifurcation_diagram(without_values(column())),
    },
    "branch": {
        "cubic": lambda: cubic().plot(),
        "cycles": lambda: P.branch(cycles()),
        "disk": lambda: P.branch(diagram(), units={"phi": "deg", "beta": "deg"}, cut=-90.0),
    },
    "atlas": {
        "crowded": lambda: P.atlas(crowded_atlas()),
        "portraits": lambda: P.atlas(folding_atlas(), portraits=True),
    },
    "bifurcation_set": {
        "astroid": lambda: P.bifurcation_set(loci("astroid")),
        "disk": lambda: P.bifurcation_set(loci("disk"), units={"beta": "deg", "a": "mm"}),
        "no curves": lambda: P.bifurcation_set(loci("empty")),
    },
    "branch_surface": {
        "folds": lambda: P.branch_surface(*PLANE, xlim=(0.0, 1.5), ylim=(-0.6, 0.6), cells=8),
    },
    "force_polygon": {
        "swing": lambda: P.force_polygon(DISK, *STARTS["swing"]),
        "turn": lambda: P.force_polygon(DISK, *STARTS["turn"], bearing="B2"),
        "no force": lambda: P.force_polygon(DISK.replace(g=0.0, omega1=0.0), 0.5, 0.0),
    },
    "bearing_forces": {
        "swing": lambda: P.bearing_forces(DISK, orbit=STARTS["swing"], angles="deg"),
        "turn": lambda: P.bearing_forces(DISK, orbit=STARTS["turn"], bearing="A2"),
        "time": lambda: P.bearing_forces(motions().isel(point=0), x="time", bearing="B2"),
        "rest": lambda: P.bearing_forces(DISK.replace(a=0.0), orbit=(0.0, 0.0)),
    },
    "bearing_load_map": {
        "disk": lambda: P.bearing_load_map(plane(), units={"a": "mm", "peak_force": "kN"}),
        "all NaN": lambda: P.bearing_load_map(without_values(plane())),
    },
    "hodograph": {
        "levels": lambda: P.hodograph(EIGHT),
        "point": lambda: P.hodograph(DISK, "R01"),
        "motions": lambda: P.hodograph(motions(), "R2"),
        "cusp": lambda: P.hodograph(CUSP),
        "no force": lambda: P.hodograph(FORCELESS, orbits=(0.0, 1.0)),
    },
    "hysteresis_loop": {
        "magnet": lambda: P.hysteresis_loop(loop(), units={"phi": "deg"}),
        "numbers": lambda: P.hysteresis_loop(loop(), y=np.cos(loop().phi)),
        "no jump": lambda: P.hysteresis_loop(loop().isel(step=slice(9))),
        "all NaN": lambda: P.hysteresis_loop(without_values(loop())),
    },
    "multipliers": {
        "driven": lambda: P.multipliers(swings()),
        "free": lambda: P.multipliers(turns()),
    },
    "parameter_map": {
        "topology": lambda: P.parameter_map(plane(), angles="deg"),
        "count": lambda: P.parameter_map(plane(), "n_equilibria"),
        "exponent": lambda: P.parameter_map(plane(), "exponent", equilibrium="lower_saddle"),
        "margin": lambda: P.parameter_map(plane(), "fold_margin"),
        "four cells": lambda: P.parameter_map(plane().isel(beta=[3, 9], a=[4, 5]), legend=False),
        "all NaN": lambda: P.parameter_map(without_values(plane()), "fold_margin"),
    },
    "period_energy": {
        "eight": lambda: P.period_energy(EIGHT, 40),
        "cusp": lambda: P.period_energy(CUSP, 40),
    },
    "frequency_action": {
        "eight": lambda: P.frequency_action(EIGHT, 40),
        "cusp": lambda: P.frequency_action(CUSP, 40),
    },
    "phase_response": {
        "two": lambda: P.phase_response(pk.phase_response(turns().orbit(0))),
        "one": lambda: P.phase_response(pk.phase_response(turns().orbit(0)), "x"),
    },
    "spectrum": {
        "three": lambda: P.spectrum(pk.spectrum(motions()), "amplitude_phi"),
        "stems": lambda: P.spectrum(pk.spectrum(motions().isel(point=0), period=1.0), log=False),
        "density": lambda: P.spectrum(pk.spectrum(pendulums(), kind="density").isel(length=1)),
    },
    "waterfall": {
        "swings": lambda: P.waterfall(pk.spectrum(pendulums()), "amplitude_dphi"),
        "low": lambda: P.waterfall(pk.spectrum(pendulums()), highest=20.0, log=False),
    },
    "orbit_diagram": {
        "both ways": lambda: P.orbit_diagram(samples()),
        "one way": lambda: P.orbit_diagram(samples().isel(r=slice(60)), "x"),
        "all NaN": lambda: P.orbit_diagram(without_values(samples())),
    },
    "lyapunov_map": {
        "largest": lambda: P.lyapunov_map(exponents()),
        "last": lambda: P.lyapunov_map(exponents(), 2, x="b"),
        "all NaN": lambda: P.lyapunov_map(without_values(exponents())),
    },
    "nullclines": {"neuron": lambda: P.nullclines(neuron())},
    "time_history": {
        "angles": lambda: P.time_history(motions(), angles="deg"),
        "rates": lambda: P.time_history(motions(), "motion_dphi"),
        "all NaN": lambda: P.time_history(without_values(motions()).isel(point=0)),
    },
}
#: Every third narrow, where there is least room, and the first of some pictures wide.
EVERY = [(name, case, WIDTHS[0]) for name, cases in CASES.items() for case in some(cases, 3)]
EVERY += [(name, next(iter(cases)), WIDTHS[1]) for name, cases in some(CASES.items(), 4)]


def neuron():
    """FitzHugh and Nagumo's."""
    rates = {"v": "v - v^3/3 - w + 0.5", "w": "0.08*(v + 0.7 - 0.8*w)"}
    return pk.Problem(rates, window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)})


def drawn(name, case, width, style="default"):
    """Return the figure of a case."""
    with plt.style.context(style), plt.rc_context({"figure.figsize": (width, 0.75 * width)}):
        figure = CASES[name][case]().get_figure(root=True)
    assert figure.get_size_inches()[0] == pytest.approx(width)
    return figure


def test_every_picture_has_a_case():
    assert set(CASES) == set(pk.plot.__all__)
    methods = {name for name, _ in inspect.getmembers(MapPlots, inspect.isfunction)}
    assert {name for name in methods if not name.startswith("_")} <= set(CASES)


def test_names_under_plot_are_pictures():
    assert dir(pk.plot) == sorted(pk.plot.__all__)
    assert {name for name in vars(pk.plot) if not name.startswith("_")} <= set(pk.plot.__all__)
    for name in ("phase_potrait", "parts", "periods"):
        with pytest.raises(AttributeError, match=f"^picture '{name}' is unknown") as caught:
            getattr(pk.plot, name)
        if name != "parts":
            assert "did you mean 'p" in str(caught.value)


@pytest.mark.parametrize(("name", "case", "width"), EVERY)
def test_texts_are_inside_and_clear_of_each_other(name, case, width):
    figure = drawn(name, case, width)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of a layout that does not fit
        texts = drawn_texts(figure)
        assert len(texts) > 4
        assert faults(figure, texts) == []
    widest = max(axes.get_window_extent().width for axes in figure.axes)
    assert widest >= 0.5 * figure.bbox.width


def contrast(one, other):
    """Ratio of two lightnesses, from 1 to 21."""

    def light(color):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color]
        return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))

    low, high = sorted([light(to_rgb(one)), light(to_rgb(other))])
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize(
    ("name", "style"),
    [*((name, "default") for name in CASES), *((n, "dark_background") for n in some(CASES, 2))],
)
def test_lines_and_texts_stand_out(name, style):
    figure = drawn(name, next(iter(CASES[name])), 6.4, style)
    ground = figure.get_facecolor()
    checked = 0
    for axes in figure.axes:
        legend = axes.get_legend()
        lines = [*axes.lines, *(legend.get_lines() if legend else [])]
        for line in lines:
            if line.get_linestyle() != "None" and not line.get_path_effects():
                checked += 1
                assert contrast(line.get_color(), ground) > 1.5, (line.get_label(), axes)
        for text in [axes.xaxis.label, axes.yaxis.label, *axes.texts, *axes.get_xticklabels()]:
            checked += 1
            assert contrast(text.get_color(), ground) > 1.8, text
    assert checked > 3


def test_faces_and_arrows_differ_in_gray():
    faces = importlib.import_module("phasekit.plot.branch_surface")
    center, saddle = (
        np.dot(to_rgb(color), (0.2126, 0.7152, 0.0722)) for color in faces.FACES.values()
    )
    assert faces.SHADE * center > saddle + 0.05  # whatever way they face
    dashes = [str(look["linestyle"]) for look in parts.POLYGON]
    assert len(dashes) == len(set(dashes)) == 5


def test_texts_that_run_out_or_over_each_other_are_found():
    figure = plt.figure(figsize=(2.0, 2.0))
    figure.text(0.9, 0.5, "long enough to run out")
    figure.text(0.2, 0.2, "one")
    figure.text(0.2, 0.21, "other")
    figure.text(0.2, 0.8, "alone")
    found = faults(figure, drawn_texts(figure))
    assert len(found) == 2
    assert "run out' is outside" in found[0]
    assert found[1] == "'one' covers 'other'"
