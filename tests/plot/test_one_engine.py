"""One engine of portraits for every rung of the ladder of laws: each rung is another's witness."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from scipy.integrate import quad

import phasekit as pk
from phasekit.errors import Loop
from phasekit.laws.ladder import Law, Routhian
from phasekit.phase.answers import answers
from phasekit.phase.level_curves import LevelCurves
from phasekit.plot.parts import style
from phasekit.plot.phase_portrait import curves_of
from phasekit.systems.potential import Potential
from phasekit.table.quantities import TABLE

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, 0.02)
HILL = Potential("-x^2/2", "x")


class EvenRouthian(Routhian):
    """V = -B cos x + (A/2) cos^2 x - C sin x with a constant inertia, in other units."""

    coordinate, period, momentum = "phi", 2.0 * np.pi, ("p", 1.0, "1")
    A, B, C, M = 3.7, 1.3, 0.4, 2.5

    def potential(self, x):
        s, c = np.sin(x), np.cos(x)
        value = -self.B * c + 0.5 * self.A * c**2 - self.C * s
        slope = self.B * s - self.A * s * c - self.C * c
        return self.M * np.array([value, slope, self.B * c - self.A * np.cos(2 * x) + self.C * s])

    def inertia(self, x):
        return self.M + 0.0 * np.asarray(x), 0.0 * np.asarray(x)

    def equilibria(self):
        ds = pk.equilibria(pk.Coefficients(self.A, self.B, self.C)).sortby("phi")

        class Found:
            phi, kind = ds.phi.values, ds.kind.values
            energy, curvature = self.M * ds.energy.values, self.M * ds.curvature.values

        return Found


TEXT = "-1.3*cos(phi) + 3.7/2*cos(phi)^2 - 0.4*sin(phi)"
RUNGS = {
    "conservative": (curves_of(Potential(TEXT, "phi", period=2 * np.pi)), 1.0),
    "routhian": (None, EvenRouthian.M),
}


@pytest.mark.parametrize("rung", RUNGS)
def test_rungs_agree_on_the_same_law(rung):
    land, scale = RUNGS[rung]
    if land is None:
        land = LevelCurves.from_answers(answers(EvenRouthian(), {}))
    exact = curves_of(pk.Coefficients(3.7, 1.3, 0.4))
    known, other = exact.answers, land.answers
    for name in ("phi", "saddle_phi", "turning_offset"):
        np.testing.assert_allclose(getattr(other, name), getattr(known, name), atol=1e-12)
    for name in ("energy", "saddle_energy"):
        wanted = scale * getattr(known, name)
        np.testing.assert_allclose(getattr(other, name), wanted, rtol=1e-12)
    assert known.kind.tolist() == other.kind.tolist() == [2, 1, 2, 1]
    assert known.loop.tolist() == other.loop.tolist() == [Loop.WINDING, Loop.LOBES]
    levels, wanted = land.levels(), exact.levels()
    assert len(levels) == len(wanted) == 7
    for (h, x), (g, y) in zip(levels, wanted, strict=True):
        assert (h, x) == pytest.approx((scale * g, y), abs=1e-11)
        (one,), (two,) = land.arcs(h, x), exact.arcs(g, y)
        np.testing.assert_allclose(one, two, atol=1e-7)
        period = exact.orbit(two, g, "period")
        assert land.orbit(one, h, "period") == pytest.approx(period, rel=1e-8)
        action = scale * exact.orbit(two, g, "action")
        assert land.orbit(one, h, "action") == pytest.approx(action, rel=1e-8)


#: A system of each rung of which one system is drawn, on lines, circles and intervals.
DRAWN = {
    "trigonometric": DISK,
    "line": Potential("x^4/4 - x^2/2 + x/10", "x"),
    "circle": Potential("-cos(q) + cos(2*q)/2 + sin(3*q)/5", "q", period=2 * np.pi),
    "short circle": Potential("cos(2*pi*s)/3 + sin(4*pi*s)/9", "s", period=1.0),
    "interval": Potential("1/x^2 - 1/x", "x", interval=(0.3, 20.0)),
    "tilted trigonometric": pk.Perturbed(DISK, torque=0.5),
    "level": pk.Perturbed(DISK),
    "tilted line": pk.Perturbed(Potential("x^4/4 - x^2/2", "x"), torque=0.05),
    "tilted circle": pk.Perturbed(Potential("cos(2*pi*s)/3", "s", period=1.0), torque=0.05),
    "routhian": ROTOR,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_what_is_drawn_is_what_the_table_says(name):
    system = DRAWN[name]
    known = curves_of(system).answers
    points = pk.equilibria(system)
    points = points.isel({d: np.flatnonzero(np.isfinite(points.phi)) for d in points.phi.dims})
    points = points.sortby("phi")
    assert known.phi.size == points.phi.size >= 1
    for field in ("phi", "kind", "energy"):
        np.testing.assert_allclose(getattr(known, field), points[field], rtol=1e-13, atol=1e-15)
    places = np.linspace(0.4, 2.0, 5)
    np.testing.assert_array_equal(known.potential(places), pk.potential(system, places).potential)
    saddles = pk.separatrices(system)
    saddles = saddles.isel(saddle=np.argsort(-saddles.saddle_energy.values))
    saddles = saddles.isel(saddle=np.isfinite(saddles.saddle_energy.values))
    assert known.saddle_phi.size == saddles.sizes["saddle"]
    for field in ("saddle_phi", "saddle_energy", "loop", "turning_offset"):
        np.testing.assert_allclose(getattr(known, field), saddles[field], rtol=1e-13, atol=1e-15)
    for state in ((0.5, 0.5), (1.2, 3.0)):
        orbit, wanted = known.orbit(*state), pk.orbits(system, *state)
        shared = [field for field in orbit._fields if field in wanted]
        assert {"period", "action", "phi_min", "phi_max"} <= set(shared)
        for field in shared:
            np.testing.assert_allclose(getattr(orbit, field), wanted[field], rtol=1e-13)


def test_each_rung_with_orbits_is_drawn():
    where = TABLE.standings_of("orbits") & TABLE.standings_of("separatrices")
    assert len(where) == 4
    for one in where:
        assert any(system.standing.is_within(one) for system in DRAWN.values())


@pytest.mark.parametrize("system", [ROTOR, ROTOR.amended(-0.8)])
def test_the_rotor_is_drawn_on_its_levels(system):
    p = system.law.momentum[1]
    amended = ROTOR.amended(p)
    ax = pk.plot.phase_portrait(system, orbits=[(0.3, 0.5), (1.2, 12.0)])
    curves = [line for line in ax.lines if line.get_marker() == "None"]
    assert len(curves) >= 10
    for line in curves:
        x, v = (np.asarray(a, float) for a in line.get_data())
        seen = np.isfinite(x)
        x, v = x[seen], v[seen]
        h = 0.5 * amended.effective_inertia(x) * v**2 + amended.potential(x)
        assert np.ptp(h) < 1e-12 * np.max(np.abs(h))
        inner = np.abs(v) > 1e-3 * np.max(np.abs(v))
        speed = amended.phase_velocity(x[inner], float(h[0]))
        np.testing.assert_allclose(np.abs(v[inner]), speed, rtol=1e-6)
    ds = amended.equilibria()
    for kind, label in ((1, "center"), (2, "saddle")):
        (marks,) = [line for line in ax.lines if line.get_label() == label]
        wanted = ds.steady_phi.values[ds.steady_kind.values == kind]
        assert wanted.size == 2
        assert np.isin(wanted, marks.get_xdata()).all()
    assert ax.get_xlabel().endswith("kg m$^{2}$ s$^{-1}$")
    assert f"{abs(p):.4g}" in ax.get_xlabel()


def test_the_rotor_stands_for_the_momentum_of_its_disk_at_rest():
    assert ROTOR.law == ROTOR.amended(ROTOR.angular_momentum(0.0, 0.0)).law


def test_period_and_action_at_a_momentum():
    amended = ROTOR.amended(0.5)
    orbit = curves_of(amended).answers.orbit(0.3, 0.5)
    period, omega1 = float(orbit.period), amended.omega1(0.3, 0.5)
    motion = ROTOR.simulate(0.3, 0.5, [0.0, period, 2.0 * period], omega1=omega1)
    np.testing.assert_allclose(motion.motion_phi, 0.3, atol=1e-8)
    np.testing.assert_allclose(motion.motion_dphi, 0.5, atol=1e-7)
    h = float(orbit.orbit_energy)

    def area(theta):
        half, middle = 0.5 * (orbit.phi_max - orbit.phi_min), 0.5 * (orbit.phi_max + orbit.phi_min)
        x = middle + half * np.sin(theta)
        kinetic = max(h - amended.potential(x), 0.0)
        return np.sqrt(2.0 * kinetic * amended.effective_inertia(x)) * half * np.cos(theta)

    action = quad(area, -0.5 * np.pi, 0.5 * np.pi, epsabs=1e-13)[0] / np.pi
    assert float(orbit.action) == pytest.approx(action, rel=1e-9)


@pytest.mark.slow
def test_the_well_of_the_rotor_is_in_joule():
    well, portrait = pk.plot.potential_well(ROTOR.amended(0.9), angles="deg")
    assert well.get_ylabel() == "$V_{p}$ (J)"
    assert portrait.get_xlim() == well.get_xlim() == (-180.0, 180.0)
    (curve,) = [line for line in well.lines if len(line.get_xdata()) > 500]
    x = np.deg2rad(curve.get_xdata())
    np.testing.assert_allclose(curve.get_ydata(), ROTOR.amended(0.9).potential(x), rtol=1e-13)
    ax = pk.plot.phase_portrait(ROTOR, color_by="action")
    assert ax.figure.axes[1].get_ylabel() == "action (J s)"


@pytest.mark.parametrize("draw", [pk.plot.phase_portrait, pk.plot.potential_well])
def test_what_the_rotor_cannot_show_is_refused(draw):
    # A particle on a support without inertia: at phi = 0 nothing resists a turn of both.
    point = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.0, r=0.0, omega1=1.0, m=2.0)
    with pytest.raises(pk.ParameterError, match="^system: got one at p = .*wants an inertia > 0"):
        draw(pk.FreeGyroRotor(point, 0.0))
    with pytest.raises(pk.ParameterError, match="^energies: got .* in J"):
        draw(ROTOR, energies="many")
    with pytest.raises(pk.ParameterError, match="^system: got .*wants"):
        draw(pk.FreeGyroRotor)
    assert not plt.get_fignums()


def test_a_law_without_answers_is_refused():
    with pytest.raises(pk.ParameterError, match="^system: got a system, wants one of one degree"):
        answers(Law(), {})


def orbit_lines(ax):
    return [line for line in ax.lines if line.get_zorder() == 4]


def test_an_orbit_over_a_hill_is_not_mirrored():
    over, back = (0.0, 0.5), (-1.0, 0.1)
    (line,) = orbit_lines(pk.plot.phase_portrait(HILL, orbits=over))
    assert np.min(line.get_ydata()) > 0.0
    lines = orbit_lines(pk.plot.phase_portrait(HILL, orbits=back))
    assert min(np.min(line.get_ydata()) for line in lines) < 0.0


def test_an_orbit_at_rest_on_a_saddle_is_no_loop():
    well = Potential("x^4/4 - x^2/2", "x")
    assert not orbit_lines(pk.plot.phase_portrait(well, orbits=(0.0, 0.0)))


def test_lines_that_are_black_are_seen_in_dark_styles():
    with plt.style.context("dark_background"):
        well, portrait = pk.plot.potential_well(pk.Coefficients(1.1, 2.3, 0.6))
        (curve,) = [line for line in well.lines if len(line.get_xdata()) > 500]
        (winding,) = [x for x in portrait.lines if x.get_label() == style.WINDING["label"]]
        assert to_rgba(curve.get_color()) == to_rgba(winding.get_color()) == to_rgba("white")


def test_a_narrow_picture_keeps_its_axes_wide():
    figure, ax = plt.subplots(figsize=(3.4, 3.4), layout="constrained")
    pk.plot.phase_portrait(pk.Coefficients(3.7, 1.3, 0.4), orbits=(0.3, 0.5), ax=ax)
    figure.canvas.draw()
    legend = ax.get_legend().get_window_extent()
    assert figure.bbox.x0 <= legend.x0
    assert legend.x1 <= figure.bbox.x1
    assert ax.get_window_extent().width > 0.6 * figure.bbox.width
