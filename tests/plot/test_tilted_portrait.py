"""Portraits under a constant torque: what is drawn are levels, followed from turn to turn."""

import numpy as np
import pytest

import phasekit as pk

TILTED = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), torque=0.05)


def on_curves(ax, label, phi, dphi):
    """Distance of states from the lines of a label, over one turn."""
    lines = [line for line in ax.get_lines() if line.get_label() == label]
    assert lines
    gone = []
    for x, v in zip(phi, dphi, strict=True):
        x = np.pi - np.mod(np.pi - x, 2 * np.pi)
        far = []
        for line in lines:
            a, b = (np.asarray(z, float) for z in line.get_data())
            t = np.clip(
                ((x - a[:-1]) * np.diff(a) + (v - b[:-1]) * np.diff(b))
                / np.maximum(np.diff(a) ** 2 + np.diff(b) ** 2, 1e-30), 0.0, 1.0,
            )  # fmt: skip
            far.append(np.min(np.hypot(x - a[:-1] - t * np.diff(a), v - b[:-1] - t * np.diff(b))))
        gone.append(min(far))
    return np.array(gone)


def test_separatrices_are_followed_round_the_cylinder():
    ax = pk.plot.phase_portrait(TILTED)
    assert ax.get_xlabel() == r"$\varphi$ (rad)"
    assert ax.get_xlim() == pytest.approx((-np.pi, np.pi))
    upper = pk.separatrices(TILTED).sel(saddle="upper")
    assert np.isinf(upper.turning_offset.sel(side="right"))
    k = upper.saddle_exponent.item()
    start = (upper.saddle_phi.item() + 1e-7, 1e-7 * k)
    motion = pk.flow(TILTED, *start, np.linspace(15.0, 38.0, 60))
    reach = ax.get_ylim()[1]
    seen = motion.motion_dphi.values < reach
    assert seen.sum() > 30
    assert np.ptp(motion.motion_phi.values[seen]) > 4 * np.pi  # several turns
    gone = on_curves(
        ax, "unbounded separatrix", motion.motion_phi.values[seen], motion.motion_dphi.values[seen]
    )
    assert gone.max() < 2e-3


@pytest.mark.parametrize("cut", [None, 1.0])
@pytest.mark.parametrize("turn", [0.0, 4 * np.pi])
def test_an_orbit_that_runs_is_drawn_turn_by_turn(cut, turn):
    ax = pk.plot.phase_portrait(TILTED, orbits=[(0.4 + turn, 1.4)], cut=cut)
    motion = pk.flow(TILTED, 0.4, 1.4, np.linspace(0.0, 12.0, 30))
    seen = motion.motion_dphi.values < ax.get_ylim()[1]
    assert seen.sum() > 15
    color = [line for line in ax.get_lines() if line.get_zorder() == 4]
    assert len(color) > 2
    low = -np.pi if cut is None else cut
    phi = low + np.mod(motion.motion_phi.values[seen] - low, 2 * np.pi)
    for line in color:
        x = np.asarray(line.get_xdata(), float)
        assert x.min() >= low - 1e-9
        assert x.max() <= low + 2 * np.pi + 1e-9
    levels = pk.energy(TILTED, phi, motion.motion_dphi.values[seen]).energy_integral.values
    drawn = np.concatenate(
        [pk.energy(TILTED, *map(np.asarray, line.get_data())).energy_integral.values[3:-3]
         for line in color]
    )  # fmt: skip
    assert max(np.abs(drawn - level).min() for level in levels) < 1e-9


def test_without_torque_it_is_the_portrait_of_the_system():
    ours = pk.plot.phase_portrait(TILTED.replace(torque=0.0))
    plain = pk.plot.phase_portrait(TILTED.system)
    assert len(ours.get_lines()) == len(plain.get_lines()) > 5
    for one, other in zip(ours.get_lines(), plain.get_lines(), strict=True):
        assert np.array_equal(one.get_xydata(), other.get_xydata(), equal_nan=True)


def test_periods_and_what_has_no_rest():
    ax = pk.plot.phase_portrait(TILTED, color_by="period")
    low, high = ax.figure.axes[-1].get_ylim()  # of the color bar
    assert 0.0 < low < high < np.inf
    free = pk.plot.phase_portrait(TILTED.replace(torque=2.0), orbits=[(0.0, 0.5)])
    assert len(free.get_lines()) > 2
    assert not [line for line in free.get_lines() if line.get_label() == "saddle"]


CIRCLE = pk.Potential("-0.35*cos(phi) + cos(phi)^2/2 - 0.12*sin(phi)", "phi", period=2 * np.pi)
SHORT = pk.Potential("cos(2*pi*s)/3", "s", period=1.0)


@pytest.mark.parametrize("torque", [0.05, 0.0])
def test_the_same_potential_as_a_formula_looks_the_same(torque):
    orbits = [(0.4 + 4 * np.pi, 1.4)]
    exact = pk.plot.phase_portrait(TILTED.replace(torque=torque), orbits=orbits, cut=1.0)
    numerical = pk.plot.phase_portrait(
        pk.Perturbed(CIRCLE, torque=torque), orbits=orbits, cut=1.0
    )  # fmt: skip
    assert len(numerical.get_lines()) == len(exact.get_lines()) > 5
    for one, other in zip(numerical.get_lines(), exact.get_lines(), strict=True):
        assert one.get_label() == other.get_label() or one.get_label().startswith("_")
        np.testing.assert_allclose(one.get_xydata(), other.get_xydata(), atol=1e-6)
    assert numerical.get_xlabel() == exact.get_xlabel()


def test_on_a_line_a_torque_is_another_potential():
    tilted = pk.Perturbed(pk.Potential("x^4/4 - x^2/2", "x"), torque=0.1)
    plain = pk.Potential("x^4/4 - x^2/2 - x/10", "x")
    for draw in (pk.plot.phase_portrait, lambda s, orbits: pk.plot.potential_well(s)[0]):
        one, other = (draw(system, orbits=(0.4, 1.4)) for system in (tilted, plain))
        assert len(one.get_lines()) == len(other.get_lines()) > 3
        for a, b in zip(one.get_lines(), other.get_lines(), strict=True):
            np.testing.assert_allclose(a.get_xydata(), b.get_xydata(), atol=1e-7)
    with pytest.raises(pk.ParameterError, match="^cut: .*the coordinate is not on a circle"):
        pk.plot.phase_portrait(tilted, cut=0.1)


def test_a_circle_of_any_length_is_cut_where_it_is_asked_for():
    tilted = pk.Perturbed(SHORT, torque=0.3)
    ax = pk.plot.phase_portrait(tilted, orbits=[(3.4, 1.4)], cut=0.2)
    assert ax.get_xlim() == pytest.approx((0.2, 1.2))
    motion = pk.flow(tilted, 3.4, 1.4, np.linspace(0.0, 1.5, 20))
    seen = np.abs(motion.motion_dphi.values) < ax.get_ylim()[1]
    assert seen.sum() > 5
    drawn = [line for line in ax.get_lines() if line.get_zorder() == 4]
    levels = [pk.energy(tilted, *map(np.asarray, line.get_data())).energy_integral.values[3:-3]
              for line in drawn]  # fmt: skip
    assert len(levels) > 2
    s = 0.2 + np.mod(motion.motion_phi.values[seen] - 0.2, 1.0)
    wanted = pk.energy(tilted, s, motion.motion_dphi.values[seen]).energy_integral.values
    assert np.ptp(wanted) > 0.5  # two turns and a bit, each 0.3 higher
    means = np.array([level.mean() for level in levels])
    assert max(np.ptp(level) for level in levels) < 1e-9
    assert max(np.abs(means - energy).min() for energy in wanted) < 1e-8


def test_what_has_no_picture_says_why():
    disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
    rotor = pk.Perturbed(pk.FreeGyroRotor(disk, 0.02), torque=0.05)
    with pytest.raises(pk.ParameterError, match="wants one without a torque, perturbed.system"):
        pk.plot.phase_portrait(rotor)
    free = pk.Potential("exp(x) - x", "x")
    with pytest.raises(pk.ParameterError, match="^interval: got None"):
        pk.plot.phase_portrait(pk.Perturbed(free, torque=0.3))
