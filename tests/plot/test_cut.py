"""The circle may be cut open anywhere: what is drawn is the same, nothing is lost at the cut."""

import functools
import importlib
import inspect

import matplotlib.pyplot as plt
import numpy as np
import pytest

import phasekit as pk
from phasekit.plot.parts import style
from phasekit.plot.parts.circle import Circle

TURN = 2.0 * np.pi
CUTS = (None, 0.0, 0.5 * np.pi, -0.5 * np.pi, 2.9)
EIGHT = pk.Coefficients(1.0, 0.4, 0.1)
DISK = pk.GyroRotorDisk(beta=1.4, e=0.05, a=0.012, r=0.2, omega1=31.4, m=2.0, half_span=0.2, g=9.81)
#: An upper saddle at 179.9 degrees, from where it lies on the frame.
NEAR = pk.Coefficients(0.3, 1.0, -1.3 * np.sin(0.1 * pk.deg))
ANGLED = {
    "phase_portrait",
    "potential_well",
    "bifurcation_diagram",
    "branch",
    "branch_surface",
    "bearing_forces",
    "damped_portrait",
    "poincare_section",
}


@functools.cache
def diagram():
    """All branches of the disk over its angle."""
    return pk.diagram(DISK, "beta", span=(0.05, 1.5))


def same_place(angles, others, atol=1e-9):
    """Whether each of the angles is one of the others, turns apart."""
    gaps = np.abs(np.exp(1j * np.subtract.outer(angles, others)) - 1.0)
    return bool((gaps.min(axis=1) < atol).all())


def curves(ax):
    """Lines with both coordinates finite somewhere, and no markers."""
    return [line for line in ax.lines if line.get_linestyle() != "None"]


def crossings(ax, at):
    """Angles at which the curves of a diagram stand at one value of its parameter."""
    found = []
    for line in curves(ax):
        x, y = line.get_data()
        with np.errstate(invalid="ignore"):
            hit = np.flatnonzero((x[:-1] - at) * (x[1:] - at) < 0.0)
        share = (at - x[hit]) / (x[hit + 1] - x[hit])
        found += (y[hit] + share * (y[hit + 1] - y[hit])).tolist()
    low, high = ax.get_ylim()
    return np.array([y for y in sorted(found) if low < y <= high])


def test_every_picture_of_an_angle_can_be_cut():
    takes = {
        name
        for name in pk.plot.__all__
        if "cut" in inspect.signature(getattr(pk.plot, name)).parameters
    }
    assert takes >= ANGLED


def test_an_equilibrium_at_the_frame_is_seen():
    assert float(pk.equilibria(NEAR).phi.sel(equilibrium="upper_saddle")) > 179.5 * pk.deg
    ax = pk.plot.phase_portrait(NEAR, angles="deg", cut=0.0)
    assert ax.get_xlim() == pytest.approx((0.0, 360.0))
    (saddle,) = [line for line in ax.lines if line.get_label() == "saddle"]
    (place,) = saddle.get_xdata()
    assert 170.0 < place < 190.0
    (uncut,) = [line for line in pk.plot.phase_portrait(NEAR).lines if line.get_label() == "saddle"]
    assert np.ptp(uncut.get_xdata()) == pytest.approx(TURN)


@pytest.mark.slow
@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("draw", [pk.plot.phase_portrait, pk.plot.potential_well])
def test_a_portrait_shows_the_same_levels_and_points(draw, cut):
    orbits = [(0.3, 0.0), (2.0, 2.0)]
    drawn = [draw(EIGHT, orbits=orbits, cut=place) for place in (None, cut)]
    usual, ax = (one[1] if isinstance(one, tuple) else one for one in drawn)
    low, high = ax.get_xlim()
    assert high - low == pytest.approx(TURN)
    assert low == pytest.approx(-np.pi if cut is None else Circle.cut_at(cut, 1.0).low)
    points = [line for line in ax.lines if line.get_marker() != "None"]
    assert len(points) == 4
    for line, other in zip(
        points, [x for x in usual.lines if x.get_marker() != "None"], strict=True
    ):
        assert same_place(line.get_xdata(), other.get_xdata())
        assert same_place(other.get_xdata(), line.get_xdata())
        assert (line.get_xdata() >= low - 0.1).all()
        assert (line.get_xdata() <= high + 0.1).all()
    A, B, C = EIGHT.coefficients()
    energies = {}
    for axes in (usual, ax):
        energies[axes] = set()
        for line in curves(axes):
            phi, speed = (values[np.isfinite(line.get_xdata())] for values in line.get_data())
            level = 0.5 * speed**2 - B * np.cos(phi) + 0.5 * A * np.cos(phi) ** 2 - C * np.sin(phi)
            assert np.ptp(level) < 1e-9
            energies[axes].add(round(float(np.median(level)), 6))
            if str(line.get_linestyle()) == str(style.ROTATION["linestyle"]):
                assert (phi.min(), phi.max()) == pytest.approx((low, high))
    assert len(energies[ax]) > 8
    assert energies[ax] == energies[usual]


@pytest.mark.slow
@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("kind", ["atlas", "columns", "branches"])
def test_a_diagram_has_every_equilibrium_once(kind, cut):
    beta = np.linspace(0.05, 1.5, 301)
    what = {
        "atlas": lambda: pk.branches(DISK, "beta", (0.05, 1.5)),
        "columns": lambda: pk.equilibria(DISK.replace(beta=beta)),
        "branches": diagram,
    }[kind]()
    ax = pk.plot.bifurcation_diagram(what, cut=cut)
    assert ax.get_ylim()[1] - ax.get_ylim()[0] == pytest.approx(TURN)
    for at in (0.3111, 0.9333, 1.1777, 1.4222):
        known = pk.equilibria(DISK.replace(beta=at))
        phi = known.phi.values[np.isfinite(known.phi.values)]
        found = crossings(ax, at)
        assert found.size == int(known.n_equilibria)
        assert same_place(found, phi, atol=5e-3)


def test_points_on_the_cut_are_at_both_ends():
    # A pitchfork at pi.
    system = pk.equilibria(pk.Coefficients(-1.0, np.linspace(0.0, 2.0, 81), 0.0))
    atlas = pk.branches(pk.Coefficients(-1.0, 0.5, 0.0), "B", (0.1, 2.0))
    for what in (system, atlas):
        for cut, places in ((None, [-np.pi, np.pi]), (np.pi, [-np.pi, np.pi]), (0.0, [np.pi])):
            ax = pk.plot.bifurcation_diagram(what, cut=cut)
            (marks,) = [x for x in ax.lines if x.get_marker() == "^"]
            np.testing.assert_allclose(np.sort(marks.get_ydata()), places, atol=1e-9)
            plt.close("all")


@pytest.mark.slow
@pytest.mark.parametrize("cut", CUTS)
def test_bearing_forces_are_those_of_the_angle(cut):
    for start in ((0.5, 3.0), (0.0, -60.0)):
        ax = pk.plot.bearing_forces(DISK, orbit=start, components="u2", bearing="A2", cut=cut)
        phi, force = np.concatenate([np.array(line.get_data()) for line in curves(ax)], axis=1)
        phi, force = phi[np.isfinite(phi)], force[np.isfinite(phi)]
        assert phi.size > 300
        dphi = pk.phase_velocity(DISK, phi, float(pk.orbits(DISK, *start).orbit_energy))
        dphi = np.nan_to_num(dphi.phase_velocity.values)
        want = [
            pk.bearing_forces(DISK, phi, sign * dphi).force.sel(bearing="A2", disk_axis="u2")
            for sign in (1.0, -1.0)
        ]
        off = np.min([np.abs(force - one.values) for one in want], axis=0)
        assert off.max() < 1e-4 * np.abs(force).max()
        low, high = ax.get_xlim()
        if start[1] == -60.0:
            assert phi.min() <= low + 1e-9
            assert phi.max() >= high - 1e-9


def test_the_surface_begins_at_the_cut(monkeypatch):
    module = importlib.import_module("phasekit.plot.branch_surface")
    add, faces = module._add_faces, []
    monkeypatch.setattr(
        module, "_add_faces", lambda ax, *rest: (faces.append(rest[0]), add(ax, *rest))
    )
    plane = {"xlim": (0.0, 1.5), "ylim": (-0.6, 0.6), "cells": 6}
    ax = pk.plot.branch_surface(
        pk.Reduced(0.0, 0.0), "lam", "psi", angles="deg", cut=90.0, legend=False, **plane
    )
    assert ax.get_zlim() == pytest.approx((90.0, 450.0))
    lam, psi, phi = np.concatenate(faces)[..., :3].reshape(-1, 3).T
    assert phi.size > 100
    assert 0.5 * np.pi <= phi.min() < phi.max() <= 2.5 * np.pi
    residual = lam * np.sin(phi) - np.sin(phi) * np.cos(phi) - psi * np.cos(phi)
    assert np.median(np.abs(residual)) < 0.02


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: pk.plot.phase_portrait(EIGHT, cut="left"), "^cut: got 'left', wants a finite"),
        (lambda: pk.plot.phase_portrait(EIGHT, cut=np.nan), "^cut: got nan"),
        (lambda: pk.plot.potential_well(EIGHT, cut=[1.0]), r"^cut: got \[1.0\]"),
        (
            lambda: pk.plot.phase_portrait(pk.Potential("x**4 - x**2", "x"), cut=0.0),
            "^cut: got 0.0, wants None, for the coordinate is not on a circle",
        ),
        (
            lambda: pk.plot.bearing_forces(DISK, orbit=(0.5, 3.0), x="time", cut=0.0),
            "^cut: got 0.0, wants None, for the time",
        ),
        (
            lambda: pk.plot.bifurcation_diagram(
                pk.equilibria(EIGHT.replace(B=np.linspace(0.0, 2.0, 9))), y="energy", cut=0.0
            ),
            "^cut: got 0.0, wants None, for energy is not drawn on a circle",
        ),
        (lambda: pk.plot.branch(diagram(), y="beta", cut=1.0), "^cut: got 1.0, wants None"),
    ],
)
def test_a_cut_that_is_none_is_refused(draw, message):
    with pytest.raises(pk.ParameterError, match=message):
        draw()
