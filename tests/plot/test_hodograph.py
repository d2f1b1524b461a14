"""Hodographs: the curves are accelerations and squares of speeds, and lengths are intensities."""

import numpy as np
import pytest

import phasekit as pk

SYSTEM = pk.Coefficients(3.7, 1.3, 0.4)
DISK = pk.GyroRotorDisk(beta=1.4, e=0.05, a=0.012, r=0.2, omega1=31.4)
TIMES = np.linspace(0.0, 12.0, 2401)


def potential(phi, A=3.7, B=1.3, C=0.4):
    return -B * np.cos(phi) + 0.5 * A * np.cos(phi) ** 2 - C * np.sin(phi)


def force(phi, A=3.7, B=1.3, C=0.4):
    return A * np.sin(phi) * np.cos(phi) + C * np.cos(phi) - B * np.sin(phi)


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def labelled(ax, label):
    return [line.get_data() for line in ax.lines if line.get_label() == label]


def test_returns_the_given_axes(ax):
    assert pk.plot.hodograph(SYSTEM, ax=ax) is ax
    assert ax.get_aspect() == 1.0
    assert ax.get_xlabel() == r"$\ddot\varphi$, tangential (s$^{-2}$)"
    assert legend_texts(ax) == ["winding separatrix", "figure-eight", "equilibria"]
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y1 < ax.get_window_extent().y0


@pytest.mark.parametrize("start", [(1.8, 0.2), (-0.4, 5.0), (-0.4, -5.0), (3.0, 0.0)])
def test_an_orbit_satisfies_the_equation_of_motion(start):
    """On the curve phi'^2 = 2 (h - V) and phi'' = -V' at one phi; swings end on v = 0."""
    ax = pk.plot.hodograph(SYSTEM, orbits=start)
    u, v = ax.lines[0].get_data()
    h = 0.5 * start[1] ** 2 + potential(start[0])
    phi = np.linspace(-np.pi, np.pi, 40001)
    allowed = h - potential(phi) >= 0.0
    want = np.array([force(phi), 2.0 * (h - potential(phi))])[:, allowed]
    for point in np.array([u, v]).T[::17]:
        assert np.min(np.hypot(*(want.T - point).T)) < 2e-3
    assert (v >= 0.0).all()
    turning = allowed.all()
    assert (v.min() == 0.0) is not turning
    if turning:
        np.testing.assert_allclose(v.max(), want[1].max(), rtol=1e-3)
    np.testing.assert_allclose(
        [line[-1] for line in ax.lines[1].get_data()], [force(start[0]), start[1] ** 2]
    )


def test_levels_are_one_curve_at_different_heights():
    low, high = (
        pk.plot.hodograph(SYSTEM, energies=energy).lines[0].get_data() for energy in (7.0, 9.0)
    )
    np.testing.assert_allclose(high[0], low[0], atol=1e-13)
    np.testing.assert_allclose(high[1] - low[1], 4.0, rtol=1e-12)


def test_separatrices_pass_through_the_equilibria():
    ax = pk.plot.hodograph(SYSTEM)
    for label in ("winding separatrix", "figure-eight"):
        for u, v in labelled(ax, label):
            assert min(np.hypot(u, v)) < 1e-9
    assert np.ravel(labelled(ax, "equilibria")).tolist() == [0.0, 0.0]


def test_motions_draw_what_their_accelerations_are():
    motions = pk.flow(SYSTEM, [1.8, 0.2], [0.0, 4.0], TIMES)
    ax = pk.plot.hodograph(motions)
    assert len(ax.lines) == 2
    for line, phi, dphi in zip(ax.lines, motions.motion_phi, motions.motion_dphi, strict=True):
        u, v = line.get_data()
        np.testing.assert_allclose(u[1:-1], np.gradient(dphi, TIMES)[1:-1], atol=2e-3)
        np.testing.assert_allclose(v[1:-1], np.gradient(phi, TIMES)[1:-1] ** 2, atol=2e-3)
    assert legend_texts(ax)[0].startswith(r"$\varphi_0$ = 1.8")
    assert pk.plot.hodograph(motions.isel(point=0)).get_legend() is None


def test_a_family_over_a_parameter_is_named_by_it():
    motions = pk.flow(pk.Reduced(0.4, [0.0, 0.1, 0.2]), 0.5, 0.1, TIMES)
    assert legend_texts(pk.plot.hodograph(motions)) == [
        r"$\psi$ = 0",
        r"$\psi$ = 0.1",
        r"$\psi$ = 0.2",
    ]


def test_the_rotators_of_a_motion_are_taken_as_they_are():
    motion = pk.flow(DISK, 0.5, 3.0, np.linspace(0.0, 2.0, 201))
    drawn = [pk.plot.hodograph(ds).lines[0] for ds in (motion, pk.rotators(DISK, motion))]
    np.testing.assert_allclose(drawn[0].get_data(), drawn[1].get_data(), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["R01", "R011", "R012", "R1", "R2", "R12", "R12c"])
def test_the_length_of_a_rotator_is_its_intensity(name):
    """Its own plane holds all of a rotator; lengths as in [HedrihVeljovic2011] (4.2), (6.7)."""
    motion = pk.flow(DISK, 0.5, 40.0, np.linspace(0.0, 0.4, 101))
    acceleration = force(motion.motion_phi.values, *DISK.coefficients())
    speed = motion.motion_dphi.values
    size = {
        "R2": np.hypot(acceleration, speed**2),
        **dict.fromkeys(("R01", "R011", "R1"), np.full(101, 31.4**2)),
    }.get(name, 2.0 * 31.4 * np.abs(speed))
    ax = pk.plot.hodograph(motion, name)
    np.testing.assert_allclose(np.hypot(*ax.lines[0].get_data()), size, rtol=1e-9)
    orbit = pk.plot.hodograph(DISK, name, orbits=(0.5, 40.0))
    lengths = np.hypot(*orbit.lines[0].get_data())
    assert size.min() * (1 - 1e-2) < lengths.min()
    assert lengths.max() < size.max() * (1 + 1e-2)
    assert orbit.get_xlabel().startswith(f"{name} along")


def test_R2_is_R022_turned_by_a_quarter_and_with_the_disk():
    motion = pk.flow(DISK, 0.5, 3.0, np.linspace(0.0, 2.0, 201))
    phi = motion.motion_phi.values
    u, v = pk.plot.hodograph(motion).lines[0].get_data()
    across, up = pk.plot.hodograph(motion, "R2").lines[0].get_data()
    # R2 = phi'' v2 - phi'^2 u2, v2 = -sin v01 + cos n1, u2 = cos v01 + sin n1
    np.testing.assert_allclose(across, -u * np.sin(phi) - v * np.cos(phi), atol=1e-9)
    np.testing.assert_allclose(up, u * np.cos(phi) - v * np.sin(phi), atol=1e-9)


def test_a_plane_of_choice():
    ax = pk.plot.hodograph(DISK, "R022", orbits=(0.5, 3.0), plane=["n1", "v01"])
    u, v = pk.plot.hodograph(DISK, orbits=(0.5, 3.0)).lines[0].get_data()
    length = np.hypot(*ax.lines[0].get_data())
    np.testing.assert_allclose(length.max(), np.hypot(u, v).max(), rtol=1e-9)
    assert ax.get_ylabel() == "R022 along $v_{01}$ (s$^{-2}$)"


def test_both_directions_of_a_level_are_drawn_where_they_differ():
    top = float(pk.separatrices(DISK).saddle_energy.max())
    assert len(pk.plot.hodograph(DISK, energies=2.0 * top).lines) == 2  # the origin is one
    assert len(pk.plot.hodograph(DISK, "R012", energies=2.0 * top).lines) == 2


@pytest.mark.parametrize(
    ("system", "options", "message"),
    [
        (lambda: None, {}, "^system"),
        (lambda: SYSTEM, {"rotator": "R3"}, "^rotator 'R3' is unknown"),
        (lambda: SYSTEM, {"rotator": "R2"}, "^system: got .*wants a GyroRotorDisk"),
        (lambda: SYSTEM, {"orbits": (1.0, 2.0, 3.0)}, "^orbits: got"),
        (lambda: SYSTEM, {"energies": "low"}, "^energies: got 'low'"),
        (lambda: SYSTEM, {"angles": 360}, "^angles: got 360"),
        (lambda: SYSTEM, {"ax": 3}, "^ax: got 3"),
        (lambda: DISK, {"plane": "u01"}, "^plane: got 'u01', wants a pair of"),
        (lambda: DISK, {"plane": ("u01", "u01")}, "^plane: got "),
        (lambda: DISK, {"plane": ("u2", "v2")}, "^plane: got "),
        (lambda: DISK.replace(beta=[0.1, 0.2]), {}, "^system: got array parameters"),
        (lambda: pk.equilibria(DISK), {}, "^system: got a Dataset without motions"),
        (
            lambda: pk.flow(DISK, 0.5, 3.0, TIMES),
            {"orbits": (0.0, 1.0)},
            "^orbits: got one beside motions",
        ),
        (
            lambda: pk.flow(DISK, 0.5, 3.0, TIMES).drop_attrs(deep=False),
            {},
            r"^system: got a motion that does not tell its system .*pk.rotators\(disk, motion\)",
        ),
        (
            lambda: pk.flow(SYSTEM, 0.5, 3.0, TIMES),
            {"rotator": "R1"},
            "^system: got .*GyroRotorDisk",
        ),
    ],
)
def test_wrong_arguments_are_named(system, options, message):
    given = system()
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.hodograph(given, **options)


def test_the_accessor_draws_cells_and_motions():
    ds = pk.sweep(DISK, beta=[1.3, 1.4], a=[0.01, 0.012])
    cell = ds.isel(beta=1, a=1)
    np.testing.assert_array_equal(
        cell.phasekit.plot.hodograph("R1", orbits=(0.5, 3.0)).lines[0].get_data(),
        pk.plot.hodograph(DISK, "R1", orbits=(0.5, 3.0)).lines[0].get_data(),
    )
    motion = pk.flow(DISK, 0.5, 3.0, np.linspace(0.0, 2.0, 201))
    assert motion.phasekit.plot.hodograph().lines[0].get_xdata().size == 201
