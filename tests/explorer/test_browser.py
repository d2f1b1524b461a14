"""The page in a browser: its numbers against the library's, its controls, its silence."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from explorer.browser import Browser, installed

import phasekit as pk

BROWSER = installed()
COUNT = int(os.environ.get("PHASEKIT_EXPLORED", "6"))

pytestmark = pytest.mark.skipif(
    BROWSER is None,
    reason="no chromium on this machine (apt-get install chromium): the page of the explorer is "
    "not tried in a browser",
)


@pytest.fixture(scope="module")
def browser():
    found = Browser(BROWSER)
    yield found
    found.close()


@pytest.fixture(scope="module")
def shown(browser, tmp_path_factory):
    """Open the page of a system; what it says and asks for is held against silence at the end."""
    folder = tmp_path_factory.mktemp("pages")

    def show(system, link="", **options) -> Browser:
        path = pk.explore(system).save(folder / f"{abs(hash(repr(system)))}.html")
        browser.open(f"{path.as_uri()}{link}", **options)
        return browser

    return show


@pytest.fixture(autouse=True)
def _silent(browser):
    yield
    assert browser.complaints() == []
    asked = browser.requests()
    assert asked
    assert all(url.startswith(("file:", "blob:", "data:", "about:")) for url in asked), asked


DISK = pk.GyroRotorDisk(
    beta=40 * pk.deg, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm, m=2.0, half_span=0.15
)

# In the page: what is known of a system at parameters p, and of orbits through states.
KNOWN = """
(cases) => cases.map(([p, states, times]) => {
  const one = phasekit.make(p, 0);
  return {
    points: one.points.map(({x, kind, label, energy, curvature}) => [x, kind, label ?? "", energy, curvature]),
    loops: one.separatrices().map(({saddle, left, right}) => [saddle.x, left.kind, left.area, left.offset, right.kind, right.area, right.offset]),
    orbits: states.map(([x, v]) => { const o = one.orbit(x, v); return [o.kind, o.family, o.period, o.action, o.low, o.high, o.energy]; }),
    flow: states.map(([x, v]) => one.flow(x, v, times)),
  };
})
"""


def known(browser, cases):
    return browser.run(f"({KNOWN})({json.dumps(cases)})")


def number(value) -> float:
    return float(value)  # "NaN" and "Infinity" come as text


#: Systems of each kind, with parameters of any sign where the kind allows it.
RANDOM = {
    "GyroRotorDisk": lambda u, n: pk.GyroRotorDisk(
        beta=u(0.02, 3.12), e=u(0, 0.2), a=u(-0.2, 0.2), r=u(0.01, 0.3), omega1=u(-40, 40),
        m=1.5, half_span=0.2,
    ),
    "Coefficients": lambda u, n: pk.Coefficients(n(), n(), n()),
    "Reduced": lambda u, n: pk.Reduced(u(-0.7, 0.7), u(-0.7, 0.7), n()),
    "ParticleOnCircle": lambda u, n: pk.ParticleOnCircle(
        radius=u(0.1, 1), omega=u(-9, 9), tilt=u(-1.5, 1.5), offset=n(), normal_offset=n()
    ),
    "Pendulum": lambda u, n: pk.Pendulum(length=u(0.1, 3), g=n()),
    "StonerWohlfarth": lambda u, n: pk.StonerWohlfarth(K=n(), h_x=n(), h_y=n()),
}  # fmt: skip


def close(got, wants, scale=1.0, tolerance=1e-9):
    got, wants = number(got), float(wants)
    if math.isnan(wants) or math.isinf(wants):
        assert str(got) == str(wants), (got, wants)
    else:
        assert abs(got - wants) <= tolerance * max(abs(wants), scale), (got, wants)


KINDS = {1: "center", 2: "saddle", 3: "degenerate"}
ORBITS = {0: "equilibrium", 1: "libration", 2: "rotation", 3: "asymptotic", 4: "unbounded"}
LOOPS = {1: "lobe", 2: "winding", 3: "heteroclinic", 4: "lobe", 5: "unbounded"}


@pytest.mark.parametrize("kind", RANDOM)
def test_numbers_of_random_systems_are_those_of_the_library(shown, kind):
    rng = np.random.default_rng(3)
    systems = [RANDOM[kind](rng.uniform, rng.normal) for _ in range(COUNT)]
    times = [0.0, 0.3, 2.0, -1.1]
    cases, wants = [], []
    for system in systems:
        A, B, C = system.coefficients()
        speed = math.sqrt(abs(A) + abs(B) + abs(C))
        states = np.column_stack([rng.uniform(-math.pi, math.pi, 6), rng.normal(size=6) * speed])
        states[0, 1] = 0.0
        moments = [t / speed for t in times]
        p = [getattr(system, parameter.name) for parameter in system.declared]
        cases.append([p, states.tolist(), moments])
        wants.append((system, states, moments, speed))
    page = shown(systems[0])
    for found, (system, states, moments, speed) in zip(known(page, cases), wants, strict=True):
        same_equilibria(found["points"], system, speed)
        same_loops(found["loops"], system, speed)
        same_orbits(found["orbits"], system, states)
        same_motions(found["flow"], system, states, moments, speed)


def same_equilibria(points, system, speed):
    ds = pk.equilibria(system)
    assert len(points) == ds.n_equilibria.item() > 0
    for x, kind, label, energy, curvature in points:
        wants = ds.sel(equilibrium=label)
        assert KINDS[wants.kind.item()] == kind
        close(math.remainder(number(x) - wants.phi.item(), 2 * math.pi), 0.0)
        close(energy, wants.energy.item(), speed**2)
        close(curvature, wants.curvature.item(), speed**2)


def same_loops(loops, system, speed):
    ds = pk.separatrices(system)
    there = ds.loop.values > 0
    assert len(loops) == there.sum() > 0
    for x, *sides in loops:
        distance = np.abs(np.remainder(ds.saddle_phi.values - x + math.pi, 2 * math.pi) - math.pi)
        wants = ds.isel(saddle=int(np.nanargmin(distance)))
        for side, (kind, area, offset) in zip(
            ("left", "right"), (sides[:3], sides[3:]), strict=True
        ):
            assert LOOPS[wants.loop.item()] == kind
            lobe = wants.sel(side=side)
            winding = kind == "winding"
            close(area, wants.winding_area.item() if winding else lobe.lobe_area.item(), speed)
            if not winding:
                close(offset, lobe.turning_offset.item())


def same_orbits(orbits, system, states):
    ds = pk.orbits(system, *states.T)
    angles = pk.action_angle(system, *states.T)
    assert len(orbits) == len(states) > 0
    for i, (kind, family, period, action, low, high, energy) in enumerate(orbits):
        wants = ds.isel(point=i)
        assert ORBITS[wants.orbit_kind.item()] == kind
        assert pk.OrbitFamily(angles.orbit_family[i].item()).name.lower() == family
        close(period, wants.period.item(), 0.0)
        close(action, wants.action.item(), 0.0)
        close(low, wants.phi_min.item())
        close(high, wants.phi_max.item())
        close(energy, wants.orbit_energy.item())


def same_motions(flow, system, states, times, speed):
    for (phi0, dphi0), found in zip(states, flow, strict=True):
        wants = pk.flow(system, phi0, dphi0, np.array(times))
        assert len(found) == len(times)
        for (phi, dphi), i in zip(found, range(len(times)), strict=True):
            close(phi, wants.motion_phi[i].item())
            close(dphi, wants.motion_dphi[i].item(), speed)


def test_pictures_follow_the_theme_and_the_width(shown, tmp_path):
    for width in (1400, 400):
        for dark in (False, True):
            page = shown(DISK, "#orbits=0.5_3", width=width, dark=dark)
            assert page.run("document.documentElement.scrollWidth") <= width
            path = Path(tmp_path) / "page.png"
            page.screenshot(path)
            assert path.stat().st_size > 30_000
