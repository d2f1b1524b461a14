"""The page of equations in a browser: its numbers are those of the library, and its hands work."""

from __future__ import annotations

import json

import numpy as np
import pytest
from explorer.test_controls import at, run_python, type_in
from witnesses.variants import some

import phasekit as pk
from phasekit.systems.problem import as_problem

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("silent")]

NEURON = pk.Problem(
    {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
    parameters={"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8},
    window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
)
LORENZ = pk.Problem(
    {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"},
    parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
    window={"x": (-25, 25), "y": (-30, 30), "z": (0, 60)},
)
DUFFING = pk.Problem(
    {"x": "v", "v": "F*cos(w*t) - d*v + x - x^3"},
    parameters={"F": 0.3, "d": 0.2, "w": 1.2},
    time="t", period="2*pi/w", window={"x": (-2, 2), "v": (-2, 2)},
)  # fmt: skip
HENON = pk.Problem(
    {"x": "1 - a*x^2 + y", "y": "b*x"},
    parameters={"a": 1.4, "b": 0.3},
    map=True,
    window={"x": (-2, 2), "y": (-1, 1)},
    start={"x": 0.1, "y": 0.1},
)
PENDULUM = pk.Problem(
    {"phi": "w", "w": "-sin(phi) - d*w + T"},
    parameters={"d": 0.3, "T": 0.8},
    periods={"phi": 2 * np.pi},
    window={"w": (-3, 4)},
)
#: Three cycles by r' = r (1 - r^2)(4 - r^2)(9 - r^2)/100, in Cartesian coordinates.
RINGS = pk.Problem(
    {"x": "x*q/100 - k*y", "y": "y*q/100 + k*x"},
    parameters={"k": 1.0},
    definitions={"q": "(1 - x^2 - y^2)*(4 - x^2 - y^2)*(9 - x^2 - y^2)"},
    window={"x": (-3.7, 3.7), "y": (-3.7, 3.7)},
)
#: Most functions that formulas may hold.
ZOO = pk.Problem(
    {
        "x": "sin(x)*exp(-y^2) + a*tanh(z) - abs(x - y) + sqrt(1 + z^2)/3 + 2^x",
        "y": "Piecewise((x*y, x < a), (cos(z) + y^3, True)) + atan2(y, 2 + x^2) - erf(x)",
        "z": "log(2 + x^2) - z/(1 + exp(-b*x)) + max(x, y, b) - sign(z)*acos(tanh(x)/2) + x^(-3)",
        "u": "sinh(x)/cosh(y) + asinh(z) + tan(u/3) - u*(x - 1)^7 + Heaviside(y - a) + erfc(u)",
        "k": "asin(tanh(k)) + acosh(2 + x^2) + atanh(y/9) + atan(k) + log(1 + b^2) - min(k, x)",
    },
    parameters={"a": 0.3, "b": -1.2},
    window=dict.fromkeys("xyzuk", (-2.0, 2.0)),
)


def idle(page):
    """Wait until nothing is looked for any more."""
    page.settle()
    page.until("!document.body.classList.contains('searching')", wait=60)
    page.settle()


@pytest.mark.parametrize(
    "system",
    some(
        [
            ZOO,
            NEURON,
            DUFFING,
            HENON,
            pk.Perturbed(pk.Pendulum(length=0.5), damping=0.3, torque=2.0),
        ],
        2,
    ),
    ids=some(["zoo", "planar", "forced", "map", "perturbed"], 2),
)
def test_rates_and_slopes_at_random_states_are_those_of_the_library(shown, system):
    problem = as_problem(system)
    n = len(problem.state)
    rng = np.random.default_rng(2)
    states, times = rng.uniform(-2, 2, (40, n)), rng.uniform(0, 9, 40)
    values = list(problem.parameters.values())
    page = shown(system)
    found = page.run(
        "(() => {"
        f"const [states, times, p] = {json.dumps([states.tolist(), times.tolist(), values])};"
        "return states.map((x, i) => {"
        f"const [f, j] = [new Float64Array({n}), new Float64Array({n * n})];"
        "phasekit.law.rates(x, p, times[i], f); phasekit.law.slopes(x, p, times[i], j);"
        "return [[...f], [...j]]; }); })()"
    )
    assert len(found) == 40
    for x, t, (rates, slopes) in zip(states, times, found, strict=True):
        value, jacobian = problem.derivatives(x, t)
        np.testing.assert_allclose(np.array(rates, float), value, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(
            np.array(slopes, float).reshape(n, n), jacobian, rtol=1e-10, atol=1e-10
        )


def same_equilibria(page, system, box=None):
    wants = pk.equilibria(system, box)
    assert wants.complete.item()
    found = page.run("phasekit.scene.rests")
    assert len(found) == wants.n_equilibria.item() > 0
    for one in found:
        gap = np.abs(wants.x.values - one["x"]).max(axis=1)
        other = wants.isel(equilibrium=int(np.argmin(gap)))
        assert gap.min() < 1e-9
        kind = pk.FlowEquilibriumKind(other.kind.item()).name.lower().replace("_", " ")
        assert one["kind"] == kind
        got = np.array([complex(*value) for value in one["eigenvalues"]])
        np.testing.assert_allclose(got, other.eigenvalue.values, rtol=1e-8, atol=1e-9)


COMPETITION = pk.Problem(
    {"n": "n*(1 - n - c*m)", "m": "m*(1 - m - d*n)"},
    parameters={"c": 1.5, "d": 1.3},
    window={"n": (-0.1, 1.3), "m": (-0.1, 1.3)},
)
LINE = pk.Problem("x - x^3 + h", "x", {"h": 0.1}, window={"x": (-2, 2)})


@pytest.mark.parametrize(
    "system",
    some([LORENZ, NEURON, PENDULUM, COMPETITION, HENON, LINE, HENON.iterated(2)], 2),
    ids=some(["lorenz", "focus", "pendulum", "competition", "map", "line", "iterate"], 2),
)
def test_equilibria_are_those_of_the_library(shown, system):
    page = shown(system)
    idle(page)
    same_equilibria(page, system)


def test_eigenvalues_of_random_matrices_are_those_of_numpy(shown):
    rng = np.random.default_rng(4)
    for n in (3, 4, 6):
        matrix = rng.normal(size=(n, n))
        names = [f"x{i}" for i in range(n)]
        rates = {
            name: " + ".join(f"({float(a)!r})*{x}" for a, x in zip(row, names, strict=True))
            for name, row in zip(names, matrix, strict=True)
        }
        page = shown(pk.Problem(rates, window=dict.fromkeys(names, (-1.0, 1.0))))
        (found,) = page.run("phasekit.scene.rests")
        got = [complex(*one) for one in found["eigenvalues"]]
        assert got == sorted(got, key=lambda z: (-z.real, -z.imag))
        order = lambda values: sorted(values, key=lambda z: (round(z.real, 6), z.imag))  # noqa: E731
        np.testing.assert_allclose(order(got), order(np.linalg.eigvals(matrix)), atol=1e-9)


@pytest.mark.parametrize("system", [NEURON, PENDULUM], ids=["planar", "cylinder"])
def test_cycles_are_those_of_the_library(shown, system):
    page = shown(system)
    idle(page)
    wants = pk.periodic_orbits(system)
    (found,) = page.run("phasekit.scene.cycles")
    assert found["period"] == pytest.approx(wants.period.item(), rel=1e-7)
    assert np.log(found["multiplier"]) == pytest.approx(np.log(wants.multiplier.item()), rel=1e-5)
    name = system.state[1]
    for got, wanted in zip(found["ends"][1], ("min", "max"), strict=True):
        assert got == pytest.approx(wants[f"{name}_{wanted}"].item(), abs=1e-3)


def test_three_cycles_that_are_built_in_are_found_with_their_multipliers(shown):
    """Stable and unstable ones; the multiplier is exp(2 pi f'(r)) of r' = f(r)."""
    page = shown(RINGS)
    idle(page)
    found = sorted(page.run("phasekit.scene.cycles"), key=lambda one: one["ends"][0][1])
    assert [round(one["ends"][0][1]) for one in found] == [1, 2, 3]
    for r, one in zip((1, 2, 3), found, strict=True):
        slope = {1: -2 * 3 * 8, 2: 2 * 4 * 3 * 5, 3: -2 * 9 * 8 * 5}[r] / 100
        assert one["period"] == pytest.approx(2 * np.pi, rel=1e-8)
        assert np.log(one["multiplier"]) == pytest.approx(2 * np.pi * slope, rel=1e-6)
    cells = page.run("[...document.querySelectorAll('#cycles td')].map((e) => e.textContent)")
    words = sorted(word for word in cells if "stable" in word)
    assert words == ["stable", "stable", "unstable"]


@pytest.mark.parametrize("system", [NEURON, DUFFING], ids=["planar", "forced"])
def test_motions_end_where_those_of_the_library_do(shown, system):
    page = shown(system, "#motions=0.3_0.2&duration=30")
    (found,) = page.run("phasekit.scene.motions")
    wants = pk.flow(system, [0.3, 0.2], [0.0, 30.0])
    for got, name in zip(found["x"], system.state, strict=True):
        assert got == pytest.approx(wants[f"motion_{name}"].values[-1], abs=1e-6)
    if system.time is not None:
        strobes = pk.stroboscopic(system, [0.3, 0.2], n=6)
        got = np.array(found["strobes"])[:5]
        np.testing.assert_allclose(got[:, 0], strobes.section_x.values[1:6].ravel(), atol=1e-4)


def test_manifolds_of_a_saddle_go_to_both_winners(shown):
    page = shown(COMPETITION)
    curves = page.run("phasekit.scene.manifolds")
    assert sorted(one["stable"] for one in curves) == [False, False, True, True]
    ends = sorted(np.round(one["points"][-1], 2).tolist() for one in curves if not one["stable"])
    np.testing.assert_allclose(ends, [[0, 1], [1, 0]], atol=0.02)


def test_points_of_the_curves_are_where_the_page_has_the_bifurcation(shown):
    """At the Hopf curves the page's own eigenvalues of its own equilibrium are imaginary."""
    page = shown(NEURON)
    (one,) = page.run("phasekit.dataOf().curves")
    points = [p for curve in one["curves"] for p in curve["points"] if 0.02 < p[1] < 0.3]
    assert len(points) > 8
    for current, eps in points[:8]:
        values = [current, eps, 0.7, 0.8]
        (found,) = page.run(
            f"phasekit.make({json.dumps(values)}).equilibria().map((one) => one.eigenvalues[0])"
        ) or [[1, 1]]
        assert abs(float(found[0])) < 1e-6
        assert abs(float(found[1])) > 1e-3


def test_a_click_starts_a_motion_and_a_click_in_the_map_moves_the_parameters(shown):
    page = shown(NEURON)
    page.click(*at(page, "#portrait", 1.5, 1.0))
    state = page.run("phasekit.state")
    np.testing.assert_allclose(state["motions"][-1], [1.5, 1.0], atol=0.02)
    assert len(page.run("phasekit.scene.motions")) == 2
    page.click(*at(page, "#map", 0.2, 0.15))
    state = page.run("phasekit.state")
    assert state["values"][0] == pytest.approx(0.2, abs=0.02)
    assert state["values"][1] == pytest.approx(0.15, abs=0.01)
    idle(page)
    assert page.run("phasekit.scene.rests")[0]["kind"] == "stable focus"
    assert page.run("phasekit.scene.cycles") == []
    page.click(*at(page, "#diagram", 1.0, 0.0))
    assert page.run("phasekit.state.values[0]") == pytest.approx(1.0, abs=0.03)
    idle(page)
    same_equilibria(
        page, NEURON.replace(I=page.run("phasekit.state.values[0]"), eps=state["values"][1])
    )
    page.press("#clear")
    assert page.run("phasekit.state.motions") == []


def test_a_slider_moves_equilibria_and_cycles_with_it(shown):
    page = shown(NEURON)
    idle(page)
    page.run("(() => { document.querySelector('[aria-label=\"b, slider\"]').focus(); })()")
    for _ in range(3):
        page.key("ArrowRight", 39)
    idle(page)
    b = page.run("phasekit.state.values[3]")
    assert b > 0.8
    wants = pk.periodic_orbits(NEURON.replace(b=b))
    (found,) = page.run("phasekit.scene.cycles")
    assert found["period"] == pytest.approx(wants.period.item(), rel=1e-7)
    said = page.run("document.getElementById('map-text').textContent")
    assert "The curves are those at b = 0.8" in said


def test_a_motion_that_takes_long_goes_on_when_the_slider_rests(shown):
    """By a clock that goes on by one millisecond each time that it is asked."""
    page = shown(NEURON)
    idle(page)
    cut = page.run(
        "(() => { let n = 0; performance.now = () => n++;"
        " const s = document.querySelector('.slider input[type=range]');"
        " s.value = 480; s.dispatchEvent(new Event('input')); delete performance.now;"
        " return phasekit.scene.motions[0]; })()"
    )
    assert cut["why"] == "hurried"
    idle(page)
    (whole,) = page.run("phasekit.scene.motions")
    assert whole["why"] == "end"
    assert 0 < cut["t"] < whole["t"] == page.run("phasekit.state.duration")
    assert cut["rows"] == whole["rows"][: len(cut["rows"])]
    moved = NEURON.replace(I=page.run("phasekit.state.values[0]"))
    wants = pk.flow(moved, whole["rows"][0][1:], [0.0, whole["t"]])
    assert whole["x"][0] == pytest.approx(wants.motion_v.values[-1], abs=1e-5)


def test_numbers_are_taken_as_people_write_them(shown):
    system = pk.Problem(
        {"x": "v", "v": "-k*sin(x - q) - w*v"}, parameters={"q": 0.1, "k": 1.0, "w": 0.2},
        window={"x": (-4, 4), "v": (-3, 3)},
    ).described({"q": {"units": "rad"}, "w": {"units": "s-1"}})  # fmt: skip
    page = shown(system)
    cases = (
        (0, "40deg", 40 * pk.deg), (0, "pi/4", np.pi / 4), (0, "-π/8", -np.pi / 8),
        (1, "0,7", 0.7), (1, "1.5e-1", 0.15), (1, "2*pi", 2 * np.pi), (1, "3pi", 3 * np.pi),
        (2, "3 rpm", 3 * pk.rpm),
    )  # fmt: skip
    for index, text, value in cases:
        type_in(page, index, text)
        assert page.run(f"phasekit.state.values[{index}]") == pytest.approx(value, rel=1e-14)
        assert page.run("document.getElementById('alert').hidden")
    for text in ("3rpm", "abc", "", "alert(1)", "1;2", "pi*", "1e999", "constructor", "2 toString"):
        type_in(page, 1, text)
        assert page.run("phasekit.state.values[1]") == pytest.approx(3 * np.pi)
        assert page.run("document.getElementById('alert').textContent").startswith("k: wants")


def test_what_is_not_finite_greys_the_pictures_and_leaves_no_table(shown):
    system = pk.Problem("sqrt(a - x^2) - b", "x", {"a": 5.0, "b": 1.0}, window={"x": (-2, 2)})
    page = shown(system)
    assert len(page.run("phasekit.scene.rests")) == 2
    type_in(page, 0, "-3")
    assert page.run("document.body.classList.contains('invalid')")
    assert "no finite value" in page.run("document.getElementById('alert').textContent")
    assert page.run("document.querySelectorAll('#equilibria td').length") == 0
    type_in(page, 0, "5")
    assert not page.run("document.body.classList.contains('invalid')")
    assert page.run("document.getElementById('alert').hidden")


def test_a_force_without_a_period_greys_the_page_and_a_short_one_ends_the_motion(shown):
    page = shown(DUFFING, "#diagram=w")
    for text in ("-1.2", "-0", "0"):
        type_in(page, 2, text)
        said = page.run("document.getElementById('alert').textContent")
        assert said == "With these parameters the force has no period > 0"
        assert page.run("document.body.classList.contains('invalid')")
    type_in(page, 2, "1e9")
    assert not page.run("document.body.classList.contains('invalid')")
    (motion,) = page.run("phasekit.scene.motions")
    assert motion["why"] == "steps"
    type_in(page, 2, "1.2")
    idle(page)
    assert page.run("document.getElementById('alert').hidden")
    assert page.run("phasekit.scene.motions[0].why") == "end"
    seen = [one["value"] for one in page.run("phasekit.scene.diagram.found")]
    assert len(seen) > 60
    assert min(seen) > 0


def test_a_link_brings_the_state_back_and_a_hostile_one_does_nothing(shown):
    page = shown(LORENZ, "#p.r=20&motions=1_2_3&x=x&y=z&series=z&diagram=r&duration=12")
    state = page.run("phasekit.state")
    assert (state["values"], state["y"], state["duration"]) == ([10, 20, 8 / 3], "z", 12)
    page.settle()
    link = page.run("document.getElementById('link').value")
    page = shown(LORENZ, link[link.index("#") :])
    assert page.run("phasekit.state") == state
    for text in ("p.r=alert(1)", "p.constructor=1", "x=__proto__", "motions=1_2", "duration=-1",
                 "map=99", "<script>=1"):  # fmt: skip
        page = shown(LORENZ, f"#{text}")
        assert not page.run("document.getElementById('alert').hidden"), text
        assert page.run("phasekit.state.values") == [10, 28, 8 / 3]


@pytest.mark.parametrize(
    "system",
    some([NEURON.described({"I": {"units": "s-1", "long_name": "current"}}), LORENZ, DUFFING,
          HENON, PENDULUM, LINE, HENON.iterated(2), NEURON], 2),
    ids=some(["units", "lorenz", "forced", "map", "cylinder", "line", "iterate", "planar"], 2),
)  # fmt: skip
def test_the_python_runs_and_makes_the_same_system(shown, system):
    page = shown(system, f"#p.{next(iter(system.parameters))}=0.35&duration=20")
    idle(page)
    made = run_python(page.run("document.getElementById('python').value"))
    changed = system.replace(**{next(iter(system.parameters)): 0.35})
    assert made["system"] == changed
    assert len(made["motions"]) == 1
    if system.time is None:
        assert made["equilibria"].n_equilibria.item() == len(page.run("phasekit.scene.rests"))
    end = page.run("phasekit.scene.motions[0].x")
    for got, name in zip(end, system.state, strict=True):
        wanted = made["motions"][0][f"motion_{name}"].values[-1]
        assert got == pytest.approx(wanted, rel=1e-4, abs=1e-5) or system is LORENZ


def test_the_diagram_of_the_logistic_map_doubles_where_it_does(shown):
    logistic = pk.Problem(
        "r*x*(1 - x)", "x", {"r": 3.3}, map=True, window={"x": (0, 1)}, start={"x": 0.3}
    )
    folder = "#diagram=r"
    page = shown(logistic, folder)
    idle(page)
    columns = page.run("phasekit.scene.diagram.found")
    assert len(columns) == 300
    for one in columns:
        count = len(np.unique(np.round(one["samples"], 5)))
        if 1.2 < one["value"] < 2.9:
            assert count == 1
        elif 3.05 < one["value"] < 3.42:
            assert count == 2
        elif 3.47 < one["value"] < 3.53:
            assert count == 4


def test_pictures_follow_theme_width_and_size(shown, tmp_path):
    for system in (NEURON, LORENZ):
        for width in (1400, 400):
            for dark in (False, True):
                page = shown(system, width=width, dark=dark)
                assert page.run("document.documentElement.scrollWidth") <= width
                high = page.run("document.getElementById('portrait').clientHeight")
                assert high == (360 if width == 400 else 440)  # a phone has room for sliders, too
                page.screenshot(tmp_path / "page.png")
                assert (tmp_path / "page.png").stat().st_size > 30_000


STIFF = pk.Problem(
    {"x": "mu*(x - x^3/3 - y)", "y": "x/mu"}, parameters={"mu": 1000.0},
    window={"x": (-3, 3), "y": (-2, 2)},
)  # fmt: skip
REACTION = pk.Problem(
    {"a": "-k1*a + k3*b*c", "b": "k1*a - k3*b*c - k2*b^2", "c": "k2*b^2"},
    parameters={"k1": 0.04, "k2": 3e7, "k3": 1e4},
    window={"a": (0, 1), "b": (0, 4e-5), "c": (0, 1)},
)
PULLED = pk.Problem(
    {"x": "-L*(x - cos(w*t))", "v": "x - v"}, parameters={"L": 1e5, "w": 1.0}, time="t",
    period="2*pi/w", window={"x": (-2, 2), "v": (-2, 2)},
)  # fmt: skip


@pytest.mark.parametrize(
    ("system", "start", "duration"),
    [(STIFF, [2.0, 0.0], 2000.0), (REACTION, [1.0, 0.0, 0.0], 1e4), (PULLED, [1.5, 0.0], 20.0)],
    ids=["relaxation", "reaction", "forced"],
)
def test_stiff_motions_are_those_of_scipy(shown, system, start, duration):
    from scipy.integrate import solve_ivp

    problem = as_problem(system)
    page = shown(system, f"#motions={'_'.join(map(str, start))}&duration={duration}")
    (found,) = page.run("phasekit.scene.motions")
    assert found["stiff"]
    assert found["why"] == "end"
    wants = solve_ivp(
        lambda t, x: problem.derivatives(x, t)[0], (0, duration), start, method="Radau",
        rtol=1e-9, atol=1e-13, jac=lambda t, x: problem.derivatives(x, t)[1],
    )  # fmt: skip
    np.testing.assert_allclose(found["x"], wants.y[:, -1], rtol=1e-5)
    assert "stiff" in page.run("document.getElementById('motions').textContent")
    if system is STIFF:
        page.until("phasekit.scene.searched !== ''", wait=60)
        (cycle,) = page.run("phasekit.scene.cycles")
        page.until("phasekit.scene.diagram.done", wait=60)
        columns = page.run("phasekit.scene.diagram.found")
        ends = [abs(x) for one in columns if one["value"] > 20 for x in one["samples"]]
        assert len(ends) > 100
        np.testing.assert_allclose(ends, 2.0, atol=0.05)  # the amplitude for large mu
        # Dorodnitsyn's expansion of the period of van der Pol's equation.
        assert cycle["period"] == pytest.approx((3 - 2 * np.log(2)) * 1e3 + 7.0143e-1, rel=1e-4)


def test_basins_are_where_scipy_ends(shown):
    from scipy.integrate import solve_ivp

    page = shown(COMPETITION)
    idle(page)
    assert page.run("phasekit.scene.basins.done")
    x, y, found, rests = page.run(
        "[phasekit.scene.basins.x, phasekit.scene.basins.y, [...phasekit.scene.basins.found],"
        " phasekit.scene.rests.filter((one) => one.unstable === 0).map((one) => one.x)]"
    )
    assert rests == [[0, 1], [1, 0]]
    c, d = COMPETITION.parameters.values()
    for cell in np.random.default_rng(6).choice(len(found), 30, replace=False):
        j, i = divmod(int(cell), 72)
        n, m = x[0] + (x[1] - x[0]) * (i + 0.5) / 72, y[0] + (y[1] - y[0]) * (j + 0.5) / 48
        if n < 0 or m < 0:
            continue
        end = solve_ivp(
            lambda t, s: (s[0] * (1 - s[0] - c * s[1]), s[1] * (1 - s[1] - d * s[0])),
            (0, 300), (n, m), rtol=1e-9, atol=1e-12,
        ).y[:, -1]  # fmt: skip
        assert found[cell] == (0 if end[1] > 0.5 else 1)
    assert 2 in found  # what begins with fewer than none goes far away
    # What goes out a hundred times as far as the window is wide, and comes back, is not far away.
    page = shown(
        pk.Problem({"x": "200*y - x", "y": "-1.1*y"}, window={"x": (-0.1, 0.1), "y": (-0.1, 0.1)})
    )
    idle(page)
    assert set(page.run("[...phasekit.scene.basins.found]")) == {0}
    page = shown(RINGS)  # of three cycles the first and the last attract
    idle(page)
    found = np.array(page.run("[...phasekit.scene.basins.found]")).reshape(48, 72)
    (x0, x1), (y0, y1) = page.run("[phasekit.scene.basins.x, phasekit.scene.basins.y]")
    radius = np.hypot(
        x0 + (x1 - x0) * (np.arange(72) + 0.5) / 72,
        (y0 + (y1 - y0) * (np.arange(48) + 0.5) / 48)[:, None],
    )
    inner, outer = found[radius < 1.9], found[radius > 2.1]
    assert len(set(inner)) == len(set(outer)) == 1
    assert set(inner) != set(outer)
    assert -1 not in found[np.abs(radius - 2.0) > 0.1]
    page.press("#basins")
    assert page.run("phasekit.scene.basins") is None
    page.settle()
    assert "basins=0" in page.run("document.getElementById('link').value")


def test_the_dot_moves_pauses_and_goes_on(shown):
    page = shown(NEURON)
    idle(page)
    page.press("#play")
    page.until("phasekit.clock.t > 1")
    assert page.run("document.getElementById('play').textContent") == "Pause"
    page.press("#play")
    stopped = page.run("phasekit.clock.t")
    page.settle()
    assert page.run("phasekit.clock.t") == stopped > 1
    page.press("#play")
    page.until(f"phasekit.clock.t > {stopped}")


def test_the_keyboard_starts_motions_and_every_control_has_a_name(shown):
    page = shown(NEURON)
    page.run("document.getElementById('portrait').focus()")
    page.key("ArrowRight", 39)
    page.key("Enter", 13, "\r")
    assert len(page.run("phasekit.state.motions")) == 2
    page.key("Delete", 46)
    assert page.run("phasekit.state.motions") == []
    told = {"button", "slider", "textbox", "combobox", "application", "img", "image"}
    seen = 0
    for node in page.send("Accessibility.getFullAXTree")["nodes"]:
        role = node.get("role", {}).get("value", "").lower()
        if role in told and not node.get("ignored"):
            seen += 1
            assert node.get("name", {}).get("value"), node
    assert seen > 20
