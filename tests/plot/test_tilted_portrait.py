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
