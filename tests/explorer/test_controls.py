"""The page in a browser: every control works, by mouse, keyboard and link; what is taken away."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import numpy as np
import pytest

import phasekit as pk

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("silent")]

DISK = pk.GyroRotorDisk(
    beta=40 * pk.deg, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm, m=2.0, half_span=0.15
)
WELL = pk.Potential("x^4/4 - mu*x^2/2 + c*x", "x", {"mu": 1.3, "c": 0.1})


def state(page):
    return page.run("phasekit.state")


def at(page, canvas, x, y):
    """Where a point of a picture lies on the screen."""
    page.place(canvas)
    return page.run(
        f"(() => {{ const p = phasekit.plots[{canvas[1:]!r}]; const b = p.canvas"
        f".getBoundingClientRect(); return [b.x + p.px({x}), b.y + p.py({y})]; }})()"
    )


def test_every_slider_and_every_number_moves_its_parameter(shown):
    page = shown(DISK)
    count = page.run("document.querySelectorAll('.slider').length")
    assert count == len(DISK.declared) + 2
    for i in range(count):
        page.run(
            f"(() => {{ const s = document.querySelectorAll('.slider input[type=range]')[{i}];"
            " s.focus(); })()"
        )
        before = state(page)
        page.key("ArrowRight", 39)
        after = state(page)
        changed = [k for k in ("values", "damping", "torque") if before[k] != after[k]]
        assert len(changed) == 1
        if i < len(DISK.declared):
            moved = [a != b for a, b in zip(before["values"], after["values"], strict=True)]
            assert moved == [j == i for j in range(len(moved))]
    names = [parameter.name for parameter in DISK.declared]
    for text, value, index in (("0.3", 0.3, 0), ("-0.01", -0.01, names.index("a"))):
        type_in(page, index, text)
        assert state(page)["values"][index] == value
        assert page.run("document.getElementById('alert').hidden")


def type_in(page, index, text):
    page.run(
        f"(() => {{ const e = document.getElementById('value-{index}'); e.value = '{text}';"
        " e.dispatchEvent(new Event('change')); })()"
    )


def test_what_a_parameter_cannot_be_is_refused_by_its_name(shown):
    page = shown(DISK)
    before = state(page)["values"]
    for index, text in ((0, "4"), (1, "-1"), (5, "0"), (2, "abc"), (2, "")):
        type_in(page, index, text)
        assert state(page)["values"] == before
        said = page.run("document.getElementById('alert').textContent")
        assert said.startswith(f"{DISK.declared[index].name}: wants a")
        assert page.run(f"document.getElementById('value-{index}').getAttribute('aria-invalid')")
    page.run("(() => { phasekit.state.values[3] = 0; phasekit.state.values[1] = 0; })()")
    page.run("phasekit.update(null)")
    page.settle()
    assert "no such system" in page.run("document.getElementById('alert').textContent")
    assert page.run("document.body.classList.contains('invalid')")
    assert page.run("document.querySelectorAll('td').length") == 0
    for name in ("values", "hover", "map-text", "odds"):
        assert page.run(f"document.getElementById('{name}').textContent") == ""
    assert "e=0," in page.run("document.getElementById('python').value")
    type_in(page, 3, "0,2")
    page.settle()
    assert not page.run("document.body.classList.contains('invalid')")
    assert page.run("document.getElementById('alert').hidden")
    assert page.run("document.querySelectorAll('td').length") > 10


def test_a_complaint_goes_with_the_next_move(shown):
    page = shown(DISK)
    type_in(page, 0, "9rad")
    assert not page.run("document.getElementById('alert').hidden")
    page.run("document.querySelector('[aria-label=\"e, slider\"]').focus()")
    page.key("ArrowRight", 39)
    assert page.run("document.getElementById('alert').hidden")
    assert page.run("document.getElementById('value-0').value") == "0.6981317"


#: Numbers as people write them, and what only looks like one.
WRITTEN = (
    "40deg", "24mm", "300rpm", "pi/4", "0,7", "-π/8", "1.5e-1", "2*pi", "3pi", "2 π", "24 mm",
    "1.153mm", "-24mm", "\u22125 cm", "+.5", "5.", ",5m", "1e3", "1E-3 um", "90 degrees",
    "1 rev/min", "2 rad/s^2", "3 rad s-1", "1.5pi/7", "pi", "-pi/2rad", "1e308", "7°",
    "1,234", "12,345mm", "1,2,3", "1.2.3", "", " ", "abc", "1e999", "pi/0", "pi*", "pi/", "--1",
    "1;2", "alert(1)", "constructor", "2 toString", "2 __proto__", "1/2", "40 parsec", "NaN",
    "Infinity", "0x10", "1_000", "٣", "3²", "1e", "mm", "4 0", "1e5e5", "pipi", "2pie", "1\n",
    "1\u00a0mm",
)  # fmt: skip


def test_numbers_are_read_as_python_and_the_command_line_read_them(shown):
    from phasekit.labels.units import number

    page = shown(DISK)
    for units in ("rad", "m", "s-1", "s-2", "1"):
        found = page.run(
            f"{json.dumps(WRITTEN)}.map((text) => phasekit.readNumber(text, {units!r}))"
        )
        assert len(found) == len(WRITTEN)
        for text, value in zip(WRITTEN, found, strict=True):
            try:
                wants = number("q", text, units)
            except pk.ParameterError:
                assert not math.isfinite(float(value)), (text, units)
            else:
                assert value == pytest.approx(wants, rel=4e-16), (text, units)
    read = [
        not math.isnan(float(page.run(f"phasekit.readNumber({t!r}, 'm')")))
        for t in ("24mm", "24deg")
    ]
    assert read == [True, False]
    assert page.run("phasekit.readNumber('1.153mm', 'm')") == 0.001153
    type_in(page, 1, "1,234")
    assert page.run("document.getElementById('alert').textContent") == "e: wants 1234 or 1.234"


def test_a_click_in_the_portrait_starts_an_orbit(shown):
    page = shown(DISK, "#orbits=")
    assert state(page)["orbits"] == []
    where = at(page, "#portrait", 0.6, 5.0)
    page.mouse("mouseMoved", *where)
    assert "libration, lower well, period " in page.run(
        "document.getElementById('hover').textContent"
    )
    page.click(*where)
    ((phi, dphi),) = state(page)["orbits"]
    assert phi == pytest.approx(0.6, abs=0.02)
    assert dphi == pytest.approx(5.0, abs=0.3)
    page.settle()
    cells = page.run("[...document.querySelectorAll('#orbits td')].map((e) => e.textContent)")
    orbit = pk.orbits(DISK, phi, dphi)
    assert cells[0] == "libration, lower well"
    assert float(cells[1]) == pytest.approx(orbit.period.item(), rel=1e-9)
    assert float(cells[2]) == pytest.approx(orbit.action.item(), rel=1e-9)
    page.press("#clear")
    assert state(page)["orbits"] == []


@pytest.mark.parametrize(
    ("system", "link"),
    [(DISK, ""), (DISK, "#orbits=0.4_30"), (WELL, ""), (DISK, "#torque=40&damping=2")],
    ids=["start", "rotation", "well", "damped"],
)
def test_the_time_history_is_a_motion_of_the_library(shown, system, link):
    """The page begins with an orbit; a damped and tilted one is held against SciPy."""
    page = shown(system, link)
    rows = np.array(page.run("phasekit.scene.history.rows"))
    assert len(rows) > 300
    (start,) = state(page)["orbits"]
    assert rows[0].tolist() == [0.0, *start]
    if "damping" not in link:
        period = pk.orbits(system, *start).period.item()
        assert rows[-1, 0] == pytest.approx(3 * period, rel=1e-6)
        motion = pk.flow(system, *start, rows[:, 0])
        wants = np.array([motion.motion_phi.values, motion.motion_dphi.values])
        scale = np.abs(wants).max(axis=1)
        assert np.all(np.abs(rows[:, 1:].T - wants).max(axis=1) < 1e-4 * scale)
        return
    from scipy.integrate import solve_ivp

    A, B, C = system.coefficients()

    def force(t, y):
        x, v = y
        slope = (B - A * math.cos(x)) * math.sin(x) - C * math.cos(x)
        return v, 40.0 - 2.0 * v - slope

    wants = solve_ivp(force, (0, rows[-1, 0]), start, t_eval=rows[::40, 0], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(rows[::40, 1:].T, wants.y, atol=1e-3)


def test_dot_and_machine_move_pause_and_go_on(shown):
    page = shown(DISK)
    seen = "document.getElementById('machine').toDataURL()"
    first = page.run(seen)
    page.press("#play")
    page.until("phasekit.clock.t > 0.05")
    page.press("#play")
    stopped = page.run("phasekit.clock.t")
    assert page.run("document.getElementById('play').textContent") == "Play"
    page.settle()
    assert page.run("phasekit.clock.t") == stopped > 0.05
    assert page.run(seen) != first
    x, v = page.run("phasekit.scene.now")
    wants = pk.flow(DISK, *state(page)["orbits"][0], [stopped])
    assert x == pytest.approx(wants.motion_phi.item(), abs=1e-3)
    assert v == pytest.approx(wants.motion_dphi.item(), abs=1e-2)
    page.press("#play")
    page.until(f"phasekit.clock.t > {stopped}")
    page.run("document.getElementById('series').focus()")
    page.key("Enter", 13, "\r")
    page.key("ArrowRight", 39)
    said = page.run("document.getElementById('series-text').textContent")
    assert said.startswith("t = ")
    page.press("#clear")
    assert page.run("phasekit.clock.t") == 0
    page.press("#play")
    assert page.run("document.getElementById('play').textContent") == "Play"


def test_a_click_in_map_or_diagram_moves_the_system(shown):
    page = shown(DISK)
    page.click(*at(page, "#map", 1.1, -0.03))
    beta, _, a = state(page)["values"][:3]
    assert beta == pytest.approx(1.1, abs=0.02)
    assert a == pytest.approx(-0.03, abs=0.002)
    page.click(*at(page, "#diagram", 0.5, 0.1))
    assert state(page)["values"][0] == pytest.approx(0.5, abs=0.02)
    for select, name in (("#map-x", "omega1"), ("#map-y", "e"), ("#diagram-x", "torque")):
        page.run(
            f"(() => {{ const s = document.querySelector('{select}'); s.value = '{name}';"
            " s.dispatchEvent(new Event('change')); })()"
        )
    assert [state(page)[k] for k in ("x", "y", "diagram")] == ["omega1", "e", "torque"]


def test_the_keyboard_does_what_the_mouse_does(shown):
    page = shown(DISK, "#orbits=")
    page.run("document.getElementById('portrait').focus()")
    for _ in range(3):
        page.key("ArrowRight", 39)
        page.key("ArrowUp", 38)
    page.key("Enter", 13, "\r")
    ((phi, dphi),) = state(page)["orbits"]
    assert phi > 0.1
    assert dphi > 0.5
    page.settle()
    assert page.run("document.getElementById('status').textContent").startswith("Orbit started")
    page.key("Delete", 46)
    assert state(page)["orbits"] == []
    page.run("document.getElementById('map').focus()")
    before = state(page)["values"]
    page.key("ArrowLeft", 37)
    page.key("ArrowDown", 40)
    after = state(page)["values"]
    assert [a < b for a, b in zip(after, before, strict=True)] == [True, False, True] + 5 * [False]


def test_the_fold_curve_of_the_map_is_the_fold(shown):
    page = shown(DISK)
    edges = page.run("phasekit.scene.map.edges.flat()")
    assert len(edges) > 200
    for beta, a in edges[::17]:
        margin = pk.equilibria(DISK.replace(beta=beta, a=a)).fold_margin.item()
        assert abs(margin) < 1e-9


def test_the_fold_curve_is_right_under_torque(shown):
    """There V' and V'' vanish together: roots of a polynomial in exp(i x), by NumPy."""

    def gap(A, B, C, torque):
        # V'' = B cos x - A cos 2x + C sin x, times 2 z^2 with z = exp(i x).
        z = np.roots([-A, B - 1j * C, 0.0, B + 1j * C, -A])
        x = np.angle(z[np.abs(np.abs(z) - 1.0) < 1e-4])
        slope = (B - A * np.cos(x)) * np.sin(x) - C * np.cos(x) - torque
        return np.abs(slope).min() / (abs(A) + abs(B) + abs(C) + abs(torque))

    page = shown(DISK, "#torque=60")
    page.until("phasekit.scene.map.next > phasekit.scene.map.columns")
    edges = page.run("phasekit.scene.map.edges.flat()")
    assert len(edges) > 200
    for beta, a in edges[::17]:
        assert gap(*DISK.replace(beta=beta, a=a).coefficients(), 60.0) < 1e-9
    page = shown(DISK, "#x=a&y=torque")
    page.until("phasekit.scene.map.next > phasekit.scene.map.columns")
    edges = page.run("phasekit.scene.map.edges.flat()")
    assert len(edges) > 200
    for a, torque in edges[::17]:
        assert gap(*DISK.replace(a=a).coefficients(), torque) < 1e-9


def test_numbers_of_equilibria_under_torque_are_those_of_a_fine_grid(shown):
    page = shown(pk.Coefficients(1.0, 0.2, 0.1))
    rng = np.random.default_rng(8)
    cases = [*rng.normal(size=(300, 4)), *(rng.normal(size=(60, 4)) * [1, 0, 0, 1])]
    cases += [
        *(rng.normal(size=(60, 4)) * [0, 1, 1, 1]),
        *(rng.normal(size=(60, 4)) * [1, 1, 0, 1e-3]),
    ]
    found = page.run(
        f"{json.dumps([c.tolist() for c in cases])}.map(([A, B, C, T]) => "
        "phasekit.countEquilibria(phasekit.law, [A, B, C], T))"
    )
    x = np.linspace(-np.pi, np.pi, 40001)
    for (A, B, C, torque), count in zip(cases, found, strict=True):
        slope = (B - A * np.cos(x)) * np.sin(x) - C * np.cos(x) - torque
        assert count == np.count_nonzero(slope[1:] * slope[:-1] < 0), (A, B, C, torque)
    assert {*found} == {0, 2, 4}


def test_a_link_brings_the_state_back(shown):
    link = "#p.beta=0.31&p.omega1=-12.5&damping=0.2&orbits=0.4_-1.5~1_0&x=e&y=omega1&angles=deg"
    page = shown(DISK, link)
    assert page.run("document.getElementById('alert').hidden")
    made = state(page)
    assert made["orbits"] == [[0.4, -1.5], [1, 0]]
    assert (made["values"][0], made["values"][4], made["damping"]) == (0.31, -12.5, 0.2)
    again = page.run("document.getElementById('link').value")
    page.open(again)
    assert state(page) == made
    page.open(f"{again.split('#')[0]}#p.beta=9&p.nothing=1&orbits=x&damping=-1&x=%3Cb%3E")
    said = page.run("document.getElementById('alert').textContent")
    for name in ("beta", "p.nothing", "orbits", "damping", "x"):
        assert f"{name}: " in said
    assert state(page)["values"][0] == DISK.beta


def test_bearing_forces_are_those_of_the_library(shown):
    page = shown(DISK, "#orbits=0.5_3~0.4_30")
    for phi0, dphi0 in ((0.5, 3.0), (0.4, 30.0)):
        rows = page.run(
            "phasekit.forceCurves(phasekit.law, phasekit.scene.p, phasekit.orbitCurve("
            f"phasekit.scene.pot, [{phi0}, {dphi0}], 0, phasekit.scene.view))"
        )
        assert len(rows) > 80
        phi, dphi, *forces = np.array(rows).T
        wants = pk.bearing_forces(DISK, phi, dphi).force_magnitude
        np.testing.assert_allclose(np.array(forces), wants.transpose("bearing", "point"), 1e-10)
    text = page.run("document.getElementById('force-text').textContent")
    assert text.startswith("Solid: bearing A2, at most ")
    page = shown(DISK.replace(m=None, half_span=None))
    text = page.run("document.getElementById('force-text').textContent")
    assert text == "Give m and half_span for the forces."
    page = shown(pk.Pendulum(length=1.0))
    assert page.run("document.getElementById('forces').hidden")


def test_shares_of_areas_are_told_as_odds_of_capture(shown):
    page = shown(DISK)
    odds = page.run("phasekit.scene.pot.separatrices().find((one) => one.shares).shares")
    lobes = pk.separatrices(DISK).lobe_area.sel(saddle="lower").values
    assert odds == pytest.approx(list(lobes / lobes.sum()), rel=1e-9)
    assert "odds" in page.run("document.getElementById('odds').textContent")


def test_damped_motion_and_tilted_potential_are_those_of_scipy(shown):
    from scipy.integrate import solve_ivp

    page = shown(DISK, "#damping=0.7&torque=30&orbits=0.5_3")
    A, B, C = DISK.coefficients()

    def force(t, state):
        phi, dphi = state
        slope = (B - A * math.cos(phi)) * math.sin(phi) - C * math.cos(phi)
        return dphi, 30.0 - slope - 0.7 * dphi

    times = [0.2, 1.0, 3.0]
    found = page.run(f"phasekit.scene.pot.flow(0.5, 3, {times}, 0.7)")
    wants = solve_ivp(
        force, (0, 3), (0.5, 3.0), t_eval=times, rtol=1e-12, atol=1e-13, method="DOP853"
    )
    np.testing.assert_allclose(found, wants.y.T, rtol=1e-9, atol=1e-9)
    points = page.run("phasekit.scene.pot.points.map((one) => one.x)")
    assert len(points) == 4
    assert max(abs(force(0, (x, 0.0))[1]) for x in points) < 1e-10


def choose(page, select, value):
    page.run(
        f"(() => {{ const s = document.getElementById('{select}'); s.value = '{value}';"
        " s.dispatchEvent(new Event('change')); })()"
    )


def test_units_are_switched_for_all_that_is_shown(shown):
    page = shown(DISK)
    for select, unit in (("unit-m", "mm"), ("unit-s-1", "rpm"), ("unit-kg", "g")):
        choose(page, select, unit)
    page.settle()
    texts = page.run("[...document.querySelectorAll('.name input')].map((e) => e.value)")
    assert texts[1:6] == ["50", "24", "200", "300", "2000"]
    assert page.run("document.getElementById('map-text').textContent").startswith(
        "beta = 0.698132 rad, a = 24 mm: "
    )
    assert page.run("phasekit.plots.map.labels.y") == "a, mm"
    assert "50" in page.run("phasekit.plots.map.yTicks.map((one) => one[1])")
    type_in(page, 1, "60")
    type_in(page, 4, "250")
    type_in(page, 2, "0.03m")
    values = state(page)["values"]
    assert values[1:3] == [0.06, 0.03]
    assert values[4] == pytest.approx(250 * pk.rpm, rel=1e-15)
    type_in(page, len(DISK.declared), "0.5")  # damping, which is no angular velocity
    assert state(page)["damping"] == 0.5
    page.settle()
    link = page.run("document.getElementById('link').value")
    made = state(page)
    page.open(link)
    assert state(page) == made
    assert made["units"] == {"m": "mm", "s-1": "rpm", "kg": "g"}
    for text in ("m:parsec", "m", "constructor:m", "m:mm:cm", "__proto__:mm"):
        page.open(f"{link.split('#')[0]}#units={text}")
        assert page.run("document.getElementById('alert').textContent").startswith("units: ")
        assert state(page)["units"] == {}


@pytest.mark.parametrize(
    ("system", "torque", "damping"),
    [(DISK, 0.0, 4.0), (DISK, 30.0, 5.0), (pk.Pendulum(length=0.5), 8.0, 0.6), (WELL, 0.0, 0.4)],
    ids=["disk", "tilted", "turning", "line"],
)
def test_basins_are_where_scipy_ends(shown, system, torque, damping):
    from scipy.integrate import solve_ivp

    page = shown(system, f"#torque={torque}&damping={damping}")
    page.until("phasekit.scene.basins.done", wait=60)
    x, y, columns, rows, found, points, period = page.run(
        "[phasekit.scene.basins.x, phasekit.scene.basins.y, 72, 48,"
        " [...phasekit.scene.basins.found],"
        " phasekit.scene.pot.points.map((one) => one.x), phasekit.scene.pot.period]"
    )
    assert len(found) == columns * rows
    assert np.mean(np.array(found) == -1) < 0.05
    assert len(set(found) - {-1}) == 2
    assert "Tinted: where motions end" in page.run("document.getElementById('legend').textContent")

    A, B, C = (0.0, 0.0, 0.0) if system is WELL else map(float, system.coefficients())

    def force(t, state):
        q, v = state
        if system is WELL:
            slope = q**3 - 1.3 * q + 0.1
        else:
            slope = (B - A * math.cos(q)) * math.sin(q) - C * math.cos(q)
        return v, torque - slope - damping * v

    wrong = 0
    for cell in np.random.default_rng(6).choice(columns * rows, 25, replace=False):
        j, i = divmod(int(cell), columns)
        start = [
            x[0] + (x[1] - x[0]) * (i + 0.5) / columns, y[0] + (y[1] - y[0]) * (j + 0.5) / rows
        ]  # fmt: skip
        end = solve_ivp(force, (0, 40 / damping), start, "DOP853", rtol=1e-8, atol=1e-8).y[:, -1]
        if abs(end[1]) > 0.5:  # it turns for ever
            wants = len(points) + 1
        else:
            gaps = [abs(math.remainder(end[0] - one, period or math.inf)) for one in points]
            wants = int(np.argmin(gaps))
            assert min(gaps) < 1e-3
        wrong += found[cell] not in (wants, -1)
    assert wrong == 0
    type_in(page, len(system.declared), "0")  # without damping there are none
    assert page.run("phasekit.scene.basins") is None


def test_theme_angles_and_reset(shown):
    page = shown(DISK)
    theme = "document.documentElement.dataset.theme"
    assert page.run(theme) == "light"
    page.press("#theme")
    assert page.run(theme) == "dark"
    page.run(
        "(() => { const s = document.getElementById('angles'); s.value = 'deg';"
        " s.dispatchEvent(new Event('change')); })()"
    )
    assert page.run("document.getElementById('value-0').value") == "40"
    type_in(page, 0, "30")
    assert state(page)["values"][0] == pytest.approx(30 * pk.deg, rel=1e-15)
    page.press("#reset")
    assert state(page)["values"][0] == DISK.beta


def test_picture_data_and_python_are_taken_away(shown, tmp_path):
    page = shown(DISK, "#orbits=0.5_3~0.4_30")
    page.send("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    for button, name in (
        ("#save-picture", "phasekit.png"),
        ("#save-data", "phasekit.json"),
        ("#save-python", "phasekit.py"),
    ):
        page.press(button)
        wait_for(page, tmp_path / name)
    assert (tmp_path / "phasekit.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    data = json.loads((tmp_path / "phasekit.json").read_text())
    assert len(data["equilibria"]) == 4
    assert data["parameters"]["beta"] == DISK.beta
    assert [one["kind"] for one in data["orbits"]] == ["libration", "rotation"]
    made = run_python((tmp_path / "phasekit.py").read_text())
    assert made["system"] == DISK
    found = [one["phi"] for one in data["equilibria"]]
    np.testing.assert_allclose(found, sorted(made["equilibria"].phi.values), atol=1e-12)
    for one, period in zip(data["orbits"], made["orbits"].period.values, strict=True):
        assert one["period"] == pytest.approx(period, rel=1e-9)
    assert made["forces"].force_magnitude.shape == (401, 2)


def run_python(text):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    space = {}
    exec(text, space)
    plt.close("all")
    return space


def wait_for(page, path):
    end = time.monotonic() + 20
    while not path.exists() or not path.stat().st_size:
        assert time.monotonic() < end, f"{path} was not written"
        page.settle()


def test_python_of_a_potential_and_of_damped_motion_runs(shown):
    page = shown(WELL, "#p.mu=0.7&orbits=0.5_0.1")
    made = run_python(page.run("document.getElementById('python').value"))
    assert made["system"] == WELL.replace(mu=0.7)
    for system, link in (
        (WELL, "damping=0.3&torque=0.1"),
        (DISK, "torque=20"),
        (DISK, "damping=2"),
    ):
        page = shown(system, f"#{link}&orbits=0.5_0.1")
        made = run_python(page.run("document.getElementById('python').value"))
        (motion,) = made["motions"]
        damping = made["perturbed"].damping
        found = page.run(f"phasekit.scene.pot.flow(0.5, 0.1, [{made['t'][-1]}], {damping})")
        wants = [motion.motion_phi.values[-1], motion.motion_dphi.values[-1]]
        np.testing.assert_allclose(found[0], wants, atol=1e-6)
        points = page.run("phasekit.scene.pot.points.map((one) => one.x)")
        there = made["equilibria"].phi.values
        np.testing.assert_allclose(points, np.sort(there[np.isfinite(there)]), atol=1e-8)


def test_copying_leaves_the_text_selected_or_says_that_it_is_copied(shown):
    page = shown(DISK)
    for button in ("#copy-link", "#copy-python"):
        page.press(button)
        page.until("document.getElementById('copied').textContent !== ''")
    said = page.run("document.getElementById('copied').textContent")
    assert said in ("Copied.", "Selected; copy it with Ctrl+C.")


def test_it_works_in_a_frame_as_notebooks_show_it(browser, tmp_path):
    path = tmp_path / "notebook.html"
    path.write_text(
        f"<!doctype html><title>n</title>{pk.explore(DISK)._repr_html_()}", encoding="utf-8"
    )
    browser.open(path.as_uri())
    inside = "document.querySelector('iframe').contentWindow"
    browser.until(f"Boolean({inside}.phasekit)")
    assert browser.run(f"{inside}.phasekit.scene.pot.points.length") == 4
    link = browser.run(f"{inside}.document.getElementById('link').value")
    assert link == "" or link.startswith("#p.beta=")


def test_every_control_has_a_name_for_screen_readers(shown):
    page = shown(DISK, "#orbits=0.5_3")
    tree = page.send("Accessibility.getFullAXTree")["nodes"]
    told = {"button", "slider", "textbox", "combobox", "application", "img", "table", "image"}
    seen = 0
    for node in tree:
        role = node.get("role", {}).get("value", "").lower()
        if role in told and not node.get("ignored"):
            seen += 1
            assert role == "table" or node.get("name", {}).get("value"), node
    assert seen > 30


def test_pictures_follow_the_theme_and_the_width(shown, tmp_path):
    for width in (1400, 400):
        for dark in (False, True):
            page = shown(DISK, "#orbits=0.5_3", width=width, dark=dark)
            assert page.run("document.documentElement.scrollWidth") <= width
            path = Path(tmp_path) / "page.png"
            page.screenshot(path)
            assert path.stat().st_size > 30_000


#: Moves of a slider before the next frame: how often is drawn, and what stands there at last.
MOVES = """
(async () => {
  const plot = phasekit.plots.portrait;
  const begin = plot.begin.bind(plot);
  let drawn = 0;
  plot.begin = (...given) => { drawn += 1; return begin(...given); };
  const slider = document.querySelector('[aria-label="e, slider"]');
  for (let i = 0; i < 20; i++) {
    slider.value = String(300 + i);
    slider.dispatchEvent(new Event("input"));
  }
  const { coarse, map } = phasekit.scene;
  const first = [coarse.next > coarse.columns, map.next > map.columns];
  for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame);
  return [drawn, first, phasekit.scene.p[1] === phasekit.state.values[1]];
})()
"""


def test_moves_between_two_frames_are_drawn_twice_and_the_map_is_coarse_at_first(shown):
    page = shown(DISK)
    drawn, (coarse, fine), followed = page.run(MOVES)
    assert drawn == 2  # the first at once, the last with the next frame
    assert coarse
    assert not fine
    assert followed
    page.until("phasekit.scene.map.next > phasekit.scene.map.columns")


def test_pictures_follow_the_size_of_the_window(shown):
    page = shown(DISK)
    before = page.run("phasekit.plots.diagram.width")
    page.send(
        "Emulation.setDeviceMetricsOverride", width=500, height=900, deviceScaleFactor=1,
        mobile=False,
    )  # fmt: skip
    page.until("Math.abs(phasekit.plots.diagram.width - document.getElementById('diagram')"
               ".getBoundingClientRect().width) < 1")  # fmt: skip
    assert page.run("phasekit.plots.diagram.width") != before
