"""Bearing forces over angle and time, and their polygon, against Newton and Euler for particles."""

import numpy as np
import pytest
from witnesses import disk_forces

import phasekit as pk

BODY = {"e": 0.05, "a": 0.012, "r": 0.2, "omega1": 31.4, "m": 2.0, "g": 9.81, "half_span": 0.2}
DISK = pk.GyroRotorDisk(beta=1.4, **BODY)
PARTICLES = disk_forces.Disk(beta=1.4, **BODY)
TIMES = np.linspace(0.0, 2.0, 401)
MOTION = pk.flow(DISK, 0.5, 3.0, TIMES)
SWING, TURN = (0.5, 3.0), (0.0, -60.0)


def reactions(phi, dphi, *, weight=True, disk_axes=False):
    """Forces on the disk, (..., 2, 3), along the carrier's axes or along (u2, v2, n2)."""
    ddphi = PARTICLES.free(phi, dphi)
    force = PARTICLES.bearings(disk_forces.Motion(phi, dphi, ddphi), weight)
    if not disk_axes:
        return force
    s, c = np.sin(phi)[..., None], np.cos(phi)[..., None]
    n2, v01, n1 = np.moveaxis(force, -1, 0)
    return np.stack([c * v01 + s * n1, -s * v01 + c * n1, n2], axis=-1)


def speed(phi, start):
    """|phi'| on the orbit through a start."""
    A, B, C = DISK.coefficients()

    def potential(x):
        return -B * np.cos(x) + 0.5 * A * np.cos(x) ** 2 - C * np.sin(x)

    h = 0.5 * start[1] ** 2 + potential(start[0])
    return np.sqrt(np.maximum(2.0 * (h - potential(phi)), 0.0))


def curves(ax):
    """The lines without the triangles that tell directions."""
    return [line for line in ax.lines if line.get_linestyle() != "None"]


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_returns_the_given_axes(ax):
    assert pk.plot.bearing_forces(DISK, orbit=SWING, ax=ax) is ax
    assert ax.get_xlabel() == r"$\varphi$ (rad)"
    assert ax.get_ylabel() == "force of the bearing on the rotor (N)"
    assert legend_texts(ax)[:2] == ["$|F_{A2}|$", "$|F_{B2}|$"]
    assert len(legend_texts(ax)) == 4  # and both directions
    assert ax.get_ylim()[0] == 0.0
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y1 < ax.get_window_extent().y0
    assert pk.plot.bearing_forces(DISK, orbit=SWING, legend=False).get_legend() is None


def test_a_swing_has_both_directions():
    lines = curves(pk.plot.bearing_forces(DISK, orbit=SWING))
    assert len(lines) == 4  # two bearings, forth and back
    for number, line in enumerate(lines):
        phi, size = line.get_data()
        sign = 1.0 if number % 2 == 0 else -1.0
        want = np.linalg.norm(reactions(phi, sign * speed(phi, SWING)), axis=-1)
        np.testing.assert_allclose(size, want[:, number // 2], rtol=1e-6)
    assert lines[0].get_xdata().min() > -np.pi


def test_a_turn_has_its_own_direction():
    ax = pk.plot.bearing_forces(DISK, orbit=TURN, bearing="A2", angles="deg")
    lines = curves(ax)
    assert len(lines) == 4  # magnitude and components
    phi = np.radians(lines[0].get_xdata())
    assert np.ptp(phi) == pytest.approx(2.0 * np.pi)
    force = reactions(phi, -speed(phi, TURN), disk_axes=True)[:, 0]
    np.testing.assert_allclose(lines[0].get_ydata(), np.linalg.norm(force, axis=-1), rtol=1e-9)
    for line, want in zip(lines[1:], force.T, strict=True):
        np.testing.assert_allclose(line.get_ydata(), want, atol=1e-9 * np.abs(force).max())
    assert {line.get_marker() for line in ax.lines} == {"None", "<"}
    assert legend_texts(ax)[1] == "$F_{A2,u_2}$"


def test_over_time_a_disk_shows_one_period():
    ax = pk.plot.bearing_forces(DISK, orbit=SWING, x="time")
    assert ax.get_xlim()[1] == pytest.approx(float(pk.orbits(DISK, *SWING).period))
    for line in ax.lines:
        size = line.get_ydata()
        assert size[0] == pytest.approx(size[-1], rel=1e-9)
    assert ax.get_xlabel() == "$t$ (s)"


@pytest.mark.parametrize("part", ["force", "force_kinetic", "force_weight"])
def test_a_motion_over_time_in_the_carrier_frame(part):
    phi, dphi = MOTION.motion_phi.values, MOTION.motion_dphi.values
    whole = reactions(phi, dphi)
    kinetic = reactions(phi, dphi, weight=False)
    want = {"force": whole, "force_kinetic": kinetic, "force_weight": whole - kinetic}[part]
    ax = pk.plot.bearing_forces(MOTION, x="time", bearing="B2", frame="carrier", part=part)
    drawn = [line.get_ydata() for line in ax.lines]
    assert len(drawn) == 3  # no force along the shaft at B2
    bound = 1e-9 * np.abs(whole).max()
    np.testing.assert_allclose(drawn[0], np.linalg.norm(want[:, 1], axis=-1), atol=bound)
    np.testing.assert_allclose(drawn[1:], want[:, 1, 1:].T, atol=bound)


def test_a_motion_over_the_angle_is_on_the_circle():
    turning = pk.flow(DISK, 0.3, 60.0, np.linspace(0.0, 0.5, 501))
    ax = pk.plot.bearing_forces(turning, components="magnitude")
    phi = turning.motion_phi.values
    assert np.ptp(phi) > 4.0 * np.pi
    want = np.linalg.norm(reactions(phi, turning.motion_dphi.values), axis=-1)
    for line, size in zip(curves(ax), want.T, strict=True):
        x, y = line.get_data()
        near = np.isfinite(x)
        wrapped = np.angle(np.exp(1j * phi))
        for k in np.flatnonzero(near)[::25]:
            gap = np.abs(np.angle(np.exp(1j * (wrapped - x[k]))))
            assert np.min(np.abs(size[gap < 1e-9] - y[k])) < 1e-6
        assert np.abs(x[near]).max() < np.pi + np.ptp(phi) / 100
    assert ax.get_xlim() == pytest.approx((-np.pi, np.pi))


def test_forces_of_a_motion_are_taken_as_they_are():
    loads = pk.bearing_forces(DISK, MOTION)
    for x in ("phi", "time"):
        drawn = [pk.plot.bearing_forces(ds, x=x) for ds in (MOTION, loads)]
        for one, other in zip(*(ax.lines for ax in drawn), strict=True):
            np.testing.assert_array_equal(one.get_data(), other.get_data())


def test_a_motor_turns_the_disk():
    loads = pk.bearing_forces(DISK, MOTION, ddphi=0.0)
    line = pk.plot.bearing_forces(loads, bearing="A2", components="u2", x="time").lines[0]
    phi, dphi = MOTION.motion_phi.values, MOTION.motion_dphi.values
    force = PARTICLES.bearings(disk_forces.Motion(phi, dphi, np.zeros(phi.shape)))[:, 0]
    np.testing.assert_allclose(
        line.get_ydata(), force[:, 1] * np.cos(phi) + force[:, 2] * np.sin(phi), atol=1e-9
    )


def test_rest_is_a_point():
    phi = float(pk.equilibria(DISK).phi.sel(equilibrium="lower_center"))
    ax = pk.plot.bearing_forces(DISK, orbit=(phi, 0.0))
    assert [line.get_marker() for line in ax.lines] == ["o", "o"]
    sizes = np.linalg.norm(reactions(np.array(phi), np.array(0.0)), axis=-1)
    np.testing.assert_allclose([line.get_ydata()[0] for line in ax.lines], sizes, rtol=1e-9)
    still = pk.flow(DISK, 0.0, 0.0, [0.0, 1.0]).assign(
        motion_phi=("time", [phi, phi]), motion_dphi=("time", [0.0, 0.0])
    )
    assert len(pk.plot.bearing_forces(still).lines) == 2


def test_lines_differ_by_more_than_color():
    for options in ({}, {"bearing": "A2"}, {"components": ["u2", "v2"]}):
        ax = pk.plot.bearing_forces(MOTION, x="time", **options)
        looks = {(line.get_color(), str(line._dash_pattern)) for line in ax.lines}
        assert len(looks) == len(ax.lines)


@pytest.mark.slow
@pytest.mark.parametrize("components", ["magnitude", ["u2", "v2"], "n2"])
@pytest.mark.parametrize("x", ["phi", "time"])
def test_lines_do_not_touch_the_frame(x, components):
    # A fast turn: what changes is small beside what stays.
    light = DISK.replace(e=1e-5, a=1.0)
    ax = pk.plot.bearing_forces(light, orbit=(0.0, 5.0), x=x, components=components)
    heights = np.concatenate([line.get_ydata() for line in ax.lines])
    low, high = ax.get_ylim()
    assert heights.size > 100
    assert high - np.nanmax(heights) > 0.03 * (high - low)
    if components == "magnitude":
        assert low == 0.0
    else:
        assert np.nanmin(heights) - low > 0.03 * (high - low)


@pytest.mark.parametrize(
    ("disk", "options", "message"),
    [
        (None, {"orbit": SWING}, "^system"),
        (DISK, {}, "^orbit: got None, wants initial conditions"),
        (DISK, {"orbit": [SWING, TURN]}, "^orbit: got .*wants one pair"),
        (DISK, {"orbit": SWING, "x": "t"}, "^x: got 't', wants one of phi, time"),
        (DISK, {"orbit": SWING, "bearing": "C2"}, "^bearing: got 'C2'"),
        (DISK, {"orbit": SWING, "part": "kinetic"}, "^part: got 'kinetic'"),
        (DISK, {"orbit": SWING, "frame": "fixed"}, "^frame: got 'fixed'"),
        (DISK, {"orbit": SWING, "components": ["u2", "w2"]}, "^component 'w2' is unknown"),
        (DISK, {"orbit": SWING, "components": []}, "^components: got"),
        (DISK, {"orbit": SWING, "components": "u2", "frame": "carrier"}, "^component 'u2'"),
        (DISK, {"orbit": SWING, "angles": 360}, "^angles: got 360"),
        (DISK, {"orbit": SWING, "ax": 1}, "^ax: got 1"),
        (DISK.replace(m=None), {"orbit": SWING}, "m"),
        (pk.Reduced(0.1, 0.2), {"orbit": SWING}, "^disk: got .*GyroRotorDisk"),
        (MOTION, {"orbit": SWING}, "^orbit: got .*wants None beside a motion"),
        (pk.equilibria(DISK), {}, "^disk: got a Dataset with .*one motion"),
        (pk.flow(DISK, [0.1, 0.2], 0.0, TIMES), {}, "^disk: got a Dataset with .*one motion"),
        (MOTION.drop_attrs(deep=False), {}, r"^disk: .*pk.bearing_forces\(disk, motion\)"),
    ],
)
def test_wrong_arguments_are_named(disk, options, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.bearing_forces(disk, **options)


def test_an_orbit_to_a_saddle_has_no_period():
    saddle = float(pk.equilibria(DISK).phi.sel(equilibrium="upper_saddle"))
    with pytest.raises(pk.ParameterError, match="^x: got 'time' for the orbit through"):
        pk.plot.bearing_forces(DISK, orbit=(saddle, 0.0), x="time")


# --- polygon -------------------------------------------------------------------------------------


def arrows(ax):
    """Starts and ends of the sides, the resultant last."""
    return [np.array(patch._posA_posB) for patch in ax.patches]


@pytest.mark.slow
@pytest.mark.parametrize("bearing", ["A2", "B2"])
@pytest.mark.parametrize("state", [(0.5, 8.0), (-2.0, 40.0), (3.0, 0.0)])
def test_the_polygon_closes_on_the_force(bearing, state):
    ax = pk.plot.force_polygon(DISK, *state, bearing=bearing)
    sides = arrows(ax)
    phi, dphi = (np.array(x) for x in state)
    at = 0 if bearing == "A2" else 1
    force = reactions(phi, dphi, disk_axes=True)[at, :2]
    np.testing.assert_allclose(sides[-1], [np.zeros(2), force], atol=1e-9)
    np.testing.assert_allclose(sides[-2][1], force, atol=1e-9)  # the weight ends there
    for one, following in zip(sides[:-2], sides[1:-1], strict=True):
        np.testing.assert_array_equal(one[1], following[0])
    kinetic = reactions(phi, dphi, weight=False, disk_axes=True)[at, :2]
    np.testing.assert_allclose(sides[4][0], kinetic, atol=1e-9)
    assert legend_texts(ax)[-1].endswith(f"{np.hypot(*force):.4g} N")
    assert ax.get_aspect() == 1.0


def test_the_sides_have_the_directions_of_the_papers():
    """w1 up, w3 against v01, and the rotator along the part that is left without support speed."""
    phi, dphi = 0.5, 8.0
    sides = [np.diff(side, axis=0)[0] for side in arrows(pk.plot.force_polygon(DISK, phi, dphi))]
    up, outward = np.array([np.sin(phi), np.cos(phi)]), np.array([np.cos(phi), -np.sin(phi)])
    for side, axis in ((sides[0], up), (sides[2], outward), (sides[4], up)):
        assert abs(side[0] * axis[1] - side[1] * axis[0]) < 1e-12 * np.hypot(*side)
    ddphi = PARTICLES.free(phi, dphi)
    still = PARTICLES.replace(omega1=0.0).bearings(disk_forces.Motion(phi, dphi, ddphi), False)[0]
    rotator = [still[1] * np.cos(phi) + still[2] * np.sin(phi), -still[1] * np.sin(phi)]
    rotator[1] += still[2] * np.cos(phi)
    np.testing.assert_allclose(sides[3], rotator, rtol=1e-9)


def test_a_polygon_at_rest():
    phi = float(pk.equilibria(DISK).phi.sel(equilibrium="lower_center"))
    ax = pk.plot.force_polygon(DISK, phi, 0.0, legend=False)
    assert np.isfinite(arrows(ax)).all()
    assert ax.get_legend() is None
    ax.figure.canvas.draw()


@pytest.mark.parametrize(
    ("disk", "state", "options", "message"),
    [
        (None, (0.0, 0.0), {}, "^disk|^system"),
        (pk.Reduced(0.1, 0.2), (0.0, 0.0), {}, "^disk: got"),
        (DISK, (0.0, 0.0), {"bearing": "A"}, "^bearing: got 'A'"),
        (DISK, ([0.0, 1.0], 0.0), {}, "^disk, phi, dphi: got"),
        (DISK.replace(beta=[0.1, 0.2]), (0.0, 0.0), {}, "^disk, phi, dphi: got"),
        (DISK, (0.0, 0.0), {"ax": 1}, "^ax: got 1"),
        (DISK, (np.inf, 0.0), {}, "^phi: got inf"),
    ],
)
def test_wrong_arguments_of_a_polygon(disk, state, options, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.force_polygon(disk, *state, **options)


@pytest.mark.slow
def test_the_accessor_draws_cells_and_motions():
    cell = pk.sweep(DISK, beta=[1.3, 1.4], a=[0.01, 0.012]).isel(beta=1, a=1)
    drawn = (
        cell.phasekit.plot.bearing_forces(orbit=SWING),
        pk.plot.bearing_forces(DISK, orbit=SWING),
    )
    for one, other in zip(*(ax.lines for ax in drawn), strict=True):
        np.testing.assert_array_equal(one.get_data(), other.get_data())
    assert MOTION.phasekit.plot.bearing_forces(x="time").lines[0].get_xdata().size == TIMES.size
    polygon = cell.phasekit.plot.force_polygon(0.5, 8.0, bearing="B2")
    want = pk.plot.force_polygon(DISK, 0.5, 8.0, bearing="B2")
    np.testing.assert_array_equal(arrows(polygon), arrows(want))
