"""The page in a browser: its numbers are those of the library."""

from __future__ import annotations

import json
import math
import os

import mpmath
import numpy as np
import pytest

import phasekit as pk
from phasekit.explorer import javascript

COUNT = int(os.environ.get("PHASEKIT_EXPLORED", "6"))

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("silent")]

DISK = pk.GyroRotorDisk(
    beta=40 * pk.deg, e=0.05, a=0.024, r=0.2, omega1=300 * pk.rpm, m=2.0, half_span=0.15
)

# In the page: what is known of a system at parameters p, and of orbits through states.
KNOWN = """
(cases) => cases.map(([p, states, times]) => {
  const one = phasekit.make(p, 0);
  const point = ({x, kind, label, energy, curvature}) => [x, kind, label ?? "", energy, curvature];
  const sides = ({left, right}) => [left, right].flatMap((s) => [s.kind, s.area, s.offset]);
  const orbit = (o) => [o.kind, o.family, o.period, o.action, o.low, o.high, o.energy];
  return {
    points: one.points.map(point),
    loops: one.separatrices().map((loop) => [loop.saddle.x, ...sides(loop)]),
    orbits: states.map(([x, v]) => orbit(one.orbit(x, v))),
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
    if not math.isfinite(wants):
        assert math.isnan(got) == math.isnan(wants)
        assert math.isnan(wants) or got == wants
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


def test_saddles_of_one_energy_and_vanishing_coefficients(shown):
    found = [(-1.0, 0.3, 0.0), (1.0, 0.0, 0.4), (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    found += [(0.0, 1.0, 2.0), (3.0, 0.5, 0.0), (-3.0, 0.0, -0.5), (1.0, -2.0, 0.0)]
    systems = [pk.Coefficients(*values) for values in found]
    page = shown(systems[0])
    answers = known(page, [[list(system), [], []] for system in systems])
    assert len(answers) == len(systems)
    for answer, system in zip(answers, systems, strict=True):
        same_equilibria(answer["points"], system, 1.0)
        same_loops(answer["loops"], system, 1.0)
    kinds = [loop[1] for loop in answers[0]["loops"]]
    assert kinds == ["heteroclinic", "heteroclinic"]


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


POTENTIALS = {
    "double well": pk.Potential("x^4/4 - mu*x^2/2 + c*x", "x", {"mu": 1.3, "c": 0.1}),
    "one well": pk.Potential("cosh(x) + a*x", "x", {"a": 0.4}, interval=(-4, 4)),
    "two saddles": pk.Potential("x^2/2 - x^4/4", "x"),
    "escape": pk.Potential("x^2/2 - k*x^3/3", "x", {"k": 0.7}),
    "circle": pk.Potential("-cos(q) + b*cos(2*q) + 0.2*sin(3*q)", "q", {"b": 0.6}, period="2*pi"),
    "short circle": pk.Potential("cos(2*pi*q/3)*h", "q", {"h": 2.0}, period=3.0),
    "morse": pk.Potential("(1 - exp(-x))^2", "x", interval=(-2, 12)),
    "branches": pk.Potential(
        "Piecewise((x^2, x < 0.5), (x - 0.25 + (x - 0.5)^4, True))", "x", interval=(-2, 2)
    ),
    "special": pk.Potential("erf(x)^2 + loggamma(x + 6)/9", "x", interval=(-4, 4)),
}


# Of functions without known bounds the library says that it proved nothing.
@pytest.mark.filterwarnings("ignore:equilibria of:RuntimeWarning")
@pytest.mark.parametrize("name", POTENTIALS)
def test_numbers_of_potentials_are_those_of_the_library(shown, name):
    system = POTENTIALS[name]
    ds = pk.equilibria(system)
    rng = np.random.default_rng(5)
    low, high = ds.phi.min().item() - 0.3, ds.phi.max().item() + 0.3
    states = np.column_stack([rng.uniform(low, high, 8), 0.6 * rng.normal(size=8)])
    page = shown(system, f"#orbits={states[0, 0]}_{states[0, 1]}")
    (found,) = known(page, [[list(system.parameters.values()), states.tolist(), []]])
    wants = [(x, KINDS[kind]) for x, kind in zip(ds.phi.values, ds.kind.values, strict=True)]
    got = sorted((one[0], one[1]) for one in found["points"])
    assert len(got) == len(wants) > 0
    for (x, kind), (phi, other) in zip(got, sorted(wants), strict=True):
        assert kind == other
        close(x, phi)
    same_loops_of_a_potential(found["loops"], system)
    orbits = pk.orbits(system, *states.T)
    assert len(found["orbits"]) == 8
    for i, (kind, _, period, action, least, greatest, energy) in enumerate(found["orbits"]):
        one = orbits.isel(point=i)
        assert ORBITS[one.orbit_kind.item()] == kind
        close(period, one.period.item(), 0.0)
        close(action, one.action.item(), 0.0)
        if kind == "libration":
            close(least, one.phi_min.item())
            close(greatest, one.phi_max.item())
        close(energy, one.orbit_energy.item())


def same_loops_of_a_potential(loops, system):
    ds = pk.separatrices(system)
    there = np.flatnonzero(ds.loop.values > 0) if "saddle" in ds.dims else []
    assert len(loops) == len(there)
    for i, (x, *sides) in zip(there, loops, strict=True):
        close(x, ds.saddle_phi[i].item())
        for side, (kind, area, _) in zip(("left", "right"), (sides[:3], sides[3:]), strict=True):
            lobe = ds.lobe_area[i].sel(side=side).item()
            close(area, ds.winding_area[i].item() if kind == "winding" else lobe)


SPECIAL = {
    **{name: np.linspace(-3.0, 3.0, 13) for name in ("erf", "erfc", "erfi", "Si")},
    **{name: np.linspace(-12.0, 5.0, 18) for name in ("airyai", "airyaiprime")},
    **{name: np.linspace(-12.0, 5.0, 18) for name in ("airybi", "airybiprime")},
    **{name: np.linspace(-3.0, 3.0, 13) for name in ("fresnels", "fresnelc")},
    **{name: np.linspace(0.2, 9.0, 12) for name in ("Ci", "loggamma")},
    "Ei": np.array([-3.0, -0.2, 0.4, 5.0]),
    "gamma": np.array([-2.5, -0.3, 0.1, 1.0, 4.5, 20.0]),
    "erfinv": np.array([-0.999, -0.6, -0.2, 0.0, 0.1, 0.7, 0.9999999]),
    "LambertW": np.array([-0.35, -0.1, 0.0, 0.5, 3.0, 1e4]),
    "elliptic_k": np.array([-3.0, 0.0, 0.5, 0.99]),
    "elliptic_e": np.array([-3.0, 0.0, 0.5, 0.99]),
    "besselj": np.linspace(-20.0, 20.0, 9),
    "besseli": np.linspace(-9.0, 9.0, 9),
    "bessely": np.array([0.05, 0.7, 3.0, 15.0]),
    "besselk": np.array([0.05, 0.7, 3.0, 15.0]),
    "polygamma": np.array([-1.5, 0.1, 1.0, 4.5, 30.0]),
}


def test_special_functions_are_those_of_mpmath(shown):
    page = shown(DISK)
    assert set(SPECIAL) == set(javascript.SPECIAL)
    names = {"LambertW": "lambertw", "Si": "si", "Ci": "ci", "Ei": "ei"}
    names |= {"elliptic_k": "ellipk", "elliptic_e": "ellipe", "polygamma": "psi"}
    for name, points in SPECIAL.items():
        orders = (0, 1, 3) if name in javascript.ORDERED else (None,)
        for order in orders:
            first = () if order is None else (order,)
            arguments = [[*first, float(x)] for x in points]
            found = page.run(f"{json.dumps(arguments)}.map((a) => phasekit.special.{name}(...a))")
            assert len(found) == len(points) > 3
            for (*_, x), value in zip(arguments, found, strict=True):
                if name.startswith("airy"):
                    derivative = int(name.endswith("prime"))
                    wants = getattr(mpmath, name[:6])(x, derivative=derivative)
                else:
                    wants = getattr(mpmath, names.get(name, name))(*first, x)
                assert float(value) == pytest.approx(float(wants.real), rel=2e-9, abs=1e-11), (
                    name,
                    order,
                    x,
                )
