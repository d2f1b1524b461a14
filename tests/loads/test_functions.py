"""Peak, mean and rms over separatrix loops and orbits against dense samples and other quadratures.

Forces come from particles (`disk_forces`), speeds from their energy in the turning frame in long
doubles, means from Gauss-Legendre panels that shrink towards the ends.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from mpmath import mp, mpf
from witnesses import oracle
from witnesses.disk_forces import NAMES, Disk, Motion
from witnesses.variants import some

from phasekit.errors import Loop, OrbitFamily, OrbitKind
from phasekit.loads import functions
from phasekit.mechanics.disk import disk_coefficients
from phasekit.numerics import launch
from phasekit.phase.exact.action_angle import orbits_with_angles
from phasekit.phase.exact.flow import flow
from phasekit.phase.exact.orbits import orbits
from phasekit.phase.exact.phase_space import equilibria, separatrices

PEAK, RMS, MEAN = 1e-9, 1e-8, 1e-8
MEAN_AT_KINKS = 1e-6  # where a force nearly vanishes on the way, its size has almost a kink
R022, R012 = 2, 3
BASE = {
    "beta": 0.7,
    "e": 0.05,
    "a": 0.024,
    "r": 0.2,
    "omega1": 31.4,
    "m": 2.0,
    "g": 9.81,
    "half_span": 0.2,
}


def abc(x: dict) -> tuple:
    return disk_coefficients(*(x[name] for name in ("beta", "e", "a", "r", "omega1", "g")))


def cold(x: dict) -> tuple:
    """Parameters of rotators."""
    return tuple(x[name] for name in ("beta", "e", "a", "r", "omega1", "g"))


def places(found) -> tuple:
    """Where the loops are, as the loads take it."""
    return found.saddle_phi, found.saddle_exponent, found.turning_offset, found.loop


def at_fold(x: dict, distance: float) -> dict:
    """The disk with the arm of the fold, longer by a part."""
    A, B, C = (float(value) for value in abc({**x, "a": 1.0}))
    arm = (abs(A) ** (2 / 3) - abs(B) ** (2 / 3)) ** 1.5 / abs(C)
    return {**x, "a": arm * (1 + distance)}


def random_disks(n: int, **scale: float) -> list[dict]:
    rng = np.random.default_rng(n + 77)
    columns = {
        "beta": rng.uniform(0, np.pi, n),
        "e": 10 ** rng.uniform(-2, -0.3, n),
        "a": rng.choice([-1, 1], n) * 10 ** rng.uniform(-3, 0, n),
        "r": 10 ** rng.uniform(-1.5, -0.3, n),
        "omega1": rng.choice([-1, 1], n) * 10 ** rng.uniform(-0.5, 1.7, n),
        "m": 10 ** rng.uniform(-1, 1, n),
        "g": rng.choice([9.81, 9.81, 0, -9.81, 1.6], n),
        "half_span": 10 ** rng.uniform(-1.5, 0, n),
    }
    for name, factor in scale.items():
        columns[name] = columns[name] * factor
    return [
        dict(zip(columns, map(float, row), strict=True))
        for row in zip(*columns.values(), strict=True)
    ]


def of(*values: float) -> dict:
    return dict(zip(NAMES, values, strict=True))


FAST = {**BASE, "omega1": 60.0, "beta": 1.2, "e": 0.1}  # A > 0
SLOW_TILTED = {**BASE, "beta": 0.2}  # A < 0
DISKS: dict[str, dict] = {
    "lobes": BASE,
    "lobes, A > 0": FAST,
    "a < 0": {**BASE, "a": -0.024},
    "obtuse": {**BASE, "beta": np.pi - 0.7},
    "winding alone": {**BASE, "omega1": 3.0},
    "no rotation of the support": {**BASE, "omega1": 0.0},
    "heteroclinic, A < 0": {**SLOW_TILTED, "a": 0.0},
    "heteroclinic, A > 0": {**FAST, "g": 0.0},
    "nearly heteroclinic, 1e-6": {**SLOW_TILTED, "a": 1e-6},
    "nearly heteroclinic, 1e-12": {**SLOW_TILTED, "a": -1e-12},
    "nearly heteroclinic, A > 0": {**FAST, "g": 1e-9},
    "figure-eight of a hoop": {**FAST, "a": 0.0},
    "weightless": {**BASE, "g": 0.0},
    "upside down": {**BASE, "g": -9.81},
    "inside the fold": at_fold(SLOW_TILTED, -1e-3),
    "next to the fold": at_fold(SLOW_TILTED, -1e-8),
    "outside the fold": at_fold(SLOW_TILTED, 1e-3),
    "just outside the fold": at_fold(SLOW_TILTED, 1e-8),
    "next to the fold, A > 0": at_fold(FAST, -1e-6),
    "near A = 0": {**BASE, "beta": float(np.arctan2(0.2, 0.1)) * (1 + 1e-9)},
    "at A = 0": {**BASE, "beta": float(np.arctan2(0.2, 0.1))},
    "almost in its plane": {**BASE, "beta": 1e-6},
    "no eccentricity": {**BASE, "e": 0.0},
    "particle": {**BASE, "r": 0.0, "beta": 1.1},
    "short shaft": {**BASE, "half_span": 1e-3},
    # two peaks side by side
    "two peaks": of(2.7176, 0.012654, -0.015587, 0.08427, -5.8216, 1.8496, 9.81, 0.00076212),
    "two more": of(0.85677, 0.031701, -0.48178, 0.28994, -1.3781, 0.27942, 1.6, 0.051917),
    "two in a lobe": of(0.0330094, 0.0254910, 0.00124992, 0.232514, -0.875254, 1.34016, 9.81, 0.71),
    "flat peak": of(
        2.741144, 0.01559378, -4.57972e-07, 0.0685964, 3.984541, 2.332863, 1.6, 0.5439938
    ),
    **{f"random {i}": x for i, x in enumerate(random_disks(8))},
    **{f"random, short shaft {i}": x for i, x in enumerate(random_disks(4, half_span=1e-3))},
}
COLUMNS = {name: np.array([x[name] for x in DISKS.values()]) for name in NAMES}


@cache
def computed() -> tuple:
    """Separatrices, loads of forces and of rotators, for all disks at once."""
    found = separatrices(*abc(COLUMNS))
    where = places(found)
    forces = functions.separatrix_forces(*COLUMNS.values(), *where)
    return found, forces, functions.separatrix_rotators(*cold(COLUMNS), *where)


# --- loops: an independent way -----------------------------------------------------------------


@dataclass(frozen=True)
class Curve:
    """A loop of a saddle: states by offset from it, with the energy of the particles."""

    disk: Disk
    saddle: float
    delta: float
    passed: tuple[float, ...]  # offsets of saddles on the way
    back: bool

    def height(self, phi):
        """Energy in the frame that turns with the support, with the opposite sign."""
        return self.disk.replace(g=-np.asarray(self.disk.g)).energy(phi, 0.0)

    def square(self, x):
        inertia = 2.0 * self.disk.replace(omega1=0.0, g=0.0).energy(0.0, 1.0)
        saddle = np.longdouble(self.saddle)
        return (2.0 * (self.height(saddle + x) - self.height(saddle)) / inertia).astype(float)

    @property
    def rounding(self) -> float:
        """Part of the speeds that long doubles do not tell."""
        inertia = 2.0 * self.disk.replace(omega1=0.0, g=0.0).energy(0.0, 1.0)
        size = self.disk.energy(self.saddle, 0.0) / inertia
        return float(1e-18 * abs(size) / self.square(self.crowded(100)).max())

    def states(self, x):
        """Angles, velocities on the way out and, with `back`, on the way back."""
        speed = np.sqrt(np.maximum(self.square(x), 0.0)) * np.sign(self.delta)
        return self.saddle + x, [speed, -speed] if self.back else [speed]

    def values(self, x, rotators: bool):
        """Two measures for each direction, (directions, n, 2)."""
        measure = self.disk.intensities if rotators else self.disk.sizes
        phi, speeds = self.states(x)
        return np.stack([measure(phi, speed) for speed in speeds])

    @property
    def pieces(self) -> np.ndarray:
        ends = np.array([0.0, *sorted(self.passed, key=abs), self.delta])
        return np.stack([ends[:-1], ends[1:]], axis=-1)

    def crowded(self, n: int):
        """Offsets that crowd at the ends of each piece."""
        part = np.sin(np.linspace(0.0, np.pi / 2, n)) ** 2
        return np.concatenate([p + (q - p) * part for p, q in self.pieces])

    def peaks(self, rotators: bool):
        """The greatest of each measure: samples, then zooms into all that come near it."""
        x = self.crowded(500)
        values = self.values(x, rotators)
        # next to its ends, but not there, the energy does not tell the speed
        speed = self.square(x)
        ends = np.isin(x, self.pieces)
        values[:, (speed > 0) & (speed < 1e-11 * speed.max()) & ~ends] = 0.0
        best = values.max(axis=(0, 1))
        for b, k in np.ndindex(values.shape[0], 2):
            y = values[b, :, k]
            top = (y >= np.append(0.0, y[:-1])) & (y >= np.append(y[1:], 0.0))
            at = np.flatnonzero(top & (y > 0.99 * best[k]))[:20]
            low, high = x[np.maximum(at - 1, 0)], x[np.minimum(at + 1, x.size - 1)]
            for _ in range(3):
                grid = low + (high - low) * np.linspace(0, 1, 33)[:, None]
                inside = self.square(grid) >= 1e-11 * speed.max()
                zoomed = np.where(inside, self.values(grid, rotators)[b, :, :, k], 0.0)
                best[k] = max(best[k], zoomed.max(initial=0.0))
                row = zoomed.argmax(axis=0)
                column = np.arange(at.size)
                low = grid[np.maximum(row - 1, 0), column]
                high = grid[np.minimum(row + 1, 32), column]
        return best

    def means(self, rotators: bool, panels: int = 24):
        """Mean and mean square over the angle, and the least value on the way."""
        node, weight = np.polynomial.legendre.leggauss(16)
        halves = 0.5 ** np.arange(26)
        edges = np.unique(
            np.concatenate([[0.0], halves / 2, 1 - halves / 2, np.linspace(0, 1, panels + 1)])
        )
        wide = np.diff(edges)[:, None] / 2
        part = (edges[:-1, None] + wide * (1 + node)).ravel()
        share = (wide * weight).ravel()
        # x = (sine)^2 makes the speed smooth at both ends
        bent, slope = np.sin(part * np.pi / 2) ** 2, np.pi / 2 * np.sin(part * np.pi)
        sums, least = np.zeros((2, 2)), np.full(2, np.inf)
        for p, q in self.pieces:
            values = self.values(p + (q - p) * bent, rotators).swapaxes(1, 2)
            share_here = share * slope * abs((q - p) / self.delta)
            sums[0] += (values @ share_here).mean(axis=0)
            sums[1] += (values**2 @ share_here).mean(axis=0)
            least = np.minimum(least, values.min(axis=(0, 2)))
        if panels == 24 and (least < 0.3 * sums[0]).any():  # almost a kink
            return self.means(rotators, 250)
        return sums[0], sums[1], least


def curve(x: dict, found, cell, j: int, side: int) -> Curve:
    saddle = float(found.saddle_phi[*cell, j])
    winding = found.loop[*cell, j] == Loop.WINDING
    delta = 2 * np.pi * (2 * side - 1) if winding else float(found.turning_offset[*cell, j, side])
    other = float(found.saddle_phi[*cell, 1 - j])
    passed = ()
    if winding and np.isfinite(other):
        passed = (np.sign(delta) * ((other - saddle) * np.sign(delta) % (2 * np.pi)),)
    return Curve(Disk(**x), saddle, delta, passed, back=not winding)


def check(loop: Curve, got, rotators: bool, context) -> None:
    """All five fields of one loop."""
    peak, mean, rms, phi, dphi = (np.asarray(field) for field in got)
    scale = float(np.sum(np.abs(abc({n: getattr(loop.disk, n) for n in NAMES}))))
    want = loop.peaks(rotators)
    # phi'' is a difference of the coefficients' terms
    floor = 8e-16 * scale * rotators
    # speeds in small lobes are differences of energies
    digits = PEAK + loop.rounding * rotators
    np.testing.assert_allclose(peak, want, rtol=digits, atol=floor, err_msg=f"peak {context}")
    # the place of the peak: on the way, on the separatrix, with the peak's value
    measure = loop.disk.intensities if rotators else loop.disk.sizes
    there = measure(phi, dphi)[[0, 1], [0, 1]]
    np.testing.assert_allclose(there, peak, rtol=PEAK, atol=floor, err_msg=f"place {context}")
    assert ((-np.pi < phi) & (phi <= np.pi)).all(), context
    x = (phi - loop.saddle) * np.sign(loop.delta)
    x = np.where(x < -1e-9, x + 2 * np.pi, x)
    assert (x <= abs(loop.delta) + 1e-9).all(), context
    assert (np.abs(dphi**2 - loop.square(np.sign(loop.delta) * x)) <= 2e-13 * scale).all(), context
    if not loop.back:
        assert (dphi * np.sign(loop.delta) >= 0).all(), context
    first, second, least = loop.means(rotators)
    np.testing.assert_allclose(
        rms, np.sqrt(second), rtol=RMS + digits, atol=floor, err_msg=f"rms {context}"
    )
    kink = least < 0.05 * first
    for k in range(2):
        near = MEAN_AT_KINKS if kink[k] else MEAN
        if least[k] < 1e-6 * first[k]:  # quite a kink: phi'' of a small lobe changes its sign
            near = 5 * MEAN_AT_KINKS
        assert abs(mean[k] - first[k]) <= (near + digits) * first[k] + floor, (
            "mean",
            context,
            k,
            mean[k],
            first[k],
            least[k],
        )
    assert (peak >= rms).all() or np.allclose(peak, rms)
    assert (rms >= mean * (1 - 1e-12)).all()


@pytest.mark.parametrize(
    ("name", "rotators"),
    [*((name, False) for name in some(DISKS, 2)), *((name, True) for name in some(DISKS, 3))],
)
def test_loops(name, rotators):
    found, forces, intensities = computed()
    i = list(DISKS).index(name)
    some = 0
    for j, side in np.ndindex(2, 2):
        got = forces if not rotators else intensities
        own = [field[i, j, side] for field in got]
        if found.loop[i, j] == Loop.ABSENT:
            assert all(np.isnan(field).all() for field in own)
            continue
        some += 1
        if rotators:
            own = [field[[R022, R012]] for field in own]
            if np.isnan(own[0]).any():  # no mass center off the shaft
                assert DISKS[name]["e"] == 0
                continue
            if DISKS[name]["omega1"] == 0.0:
                assert (own[0][1], own[1][1], own[2][1]) == (0.0, 0.0, 0.0)
                continue
        check(curve(DISKS[name], found, (i,), j, side), own, rotators, (name, j, side))
    assert some > 0


def mean_by_kinks(f, least: float, most: float) -> float:
    """Mean of f over panels that crowd at its minima, where it all but has kinks."""
    x = np.linspace(least, most, 801)
    y = f(x)
    low = np.flatnonzero((y[1:-1] < y[:-2]) & (y[1:-1] < y[2:])) + 1
    ends = [least]
    for first, last in ((x[i - 1], x[i + 1]) for i in low):
        for _ in range(10):
            grid = np.linspace(first, last, 33)
            at = np.clip(f(grid).argmin(), 1, 31)
            first, last = grid[at - 1], grid[at + 1]
        ends.append(0.5 * (first + last))
    node, weight = np.polynomial.legendre.leggauss(16)
    halves = 0.5 ** np.arange(1, 40)
    edges = np.unique(np.concatenate([[0.0], halves, 1 - halves, [1.0], np.linspace(0, 1, 17)]))
    wide = np.diff(edges)[:, None] / 2
    part, share = (edges[:-1, None] + wide * (1 + node)).ravel(), (wide * weight).ravel()
    total = 0.0
    for first, last in itertools.pairwise([*ends, most]):
        total += (last - first) * (share @ f(first + (last - first) * part))
    return total / (most - least)


# Of disks of `random_disks(24)`: loops where a force falls to a fiftieth of its mean, and less.
KINKS = [(12, 0, 1), (4, 1, 1)]


@pytest.mark.parametrize(("number", "j", "side"), KINKS)
def test_means_where_a_force_almost_vanishes(number, j, side):
    x = random_disks(24)[number]
    found = separatrices(*abc(x))
    got = functions.separatrix_forces(*x.values(), *places(found))
    loop = curve(x, found, (), j, side)
    some = 0
    for k in range(2):
        want, ways = 0.0, 0
        for p, q in loop.pieces:
            for way in range(2 if loop.back else 1):

                def f(t, p=p, q=q, way=way, k=k):
                    value = loop.values(p + (q - p) * np.sin(t) ** 2, False)[way, :, k]
                    return value * np.sin(2 * t)

                want += mean_by_kinks(f, 0.0, np.pi / 2) * np.pi / 2 * abs((q - p) / loop.delta)
                ways += 1
        want /= ways / len(loop.pieces)
        least = loop.values(loop.crowded(2000), False)[:, :, k].min()
        some += least < 0.05 * want
        assert abs(got.mean[j, side, k] - want) <= 1e-11 * want
    assert some > 0


def test_means_over_an_orbit_where_a_force_almost_vanishes():
    """Over time, between the kinks."""
    some = 0
    for number, phi0, dphi0 in ((12, 0.3, 0.0), (4, 1.0, 0.4), (12, 2.0, 0.7)):
        x = random_disks(24)[number]
        disk = Disk(**x)
        period = float(orbits(*abc(x), phi0, dphi0).period)
        got = functions.orbit_forces(*x.values(), phi0, dphi0)
        for k in range(2):

            def f(t, k=k, x=x, disk=disk, phi0=phi0, dphi0=dphi0):
                return disk.sizes(*flow(*abc(x), phi0, dphi0, t))[:, k]

            want = mean_by_kinks(f, 0.0, period)
            some += f(np.linspace(0, period, 4000)).min() < 0.05 * want
            assert abs(got.mean[k] - want) <= 1e-8 * want, (number, k)
    assert some > 0


def test_the_cases_are_of_all_kinds():
    found, _, _ = computed()
    assert {int(code) for code in np.unique(found.loop)} == set(Loop) - {Loop.LOBE, Loop.UNBOUNDED}
    both = (found.loop[:, 0] == Loop.LOBES) & (found.loop[:, 1] == Loop.WINDING)
    alone = (found.loop[:, 0] == Loop.ABSENT) & (found.loop[:, 1] == Loop.WINDING)
    assert both.sum() > 10
    assert alone.sum() > 10
    assert (np.abs(found.turning_offset[both, 0]).min(axis=1) < 1e-3).any()  # a small lobe


def test_means_of_the_coupling_rotator_are_areas():
    """The mean of |phi'| is an area, known in closed form, down to tiny lobes next to a fold."""
    distance = 10.0 ** -np.arange(1, 14)
    base = {k: np.full(distance.size, v) for k, v in SLOW_TILTED.items()}
    base["a"] = np.array([at_fold(SLOW_TILTED, -d)["a"] for d in distance])
    found = separatrices(*abc(base))
    got = functions.separatrix_rotators(*cold(base), *places(found))
    mean = got.mean[..., R012] / (2 * abs(SLOW_TILTED["omega1"]))
    lobes = found.lobe_area[:, 0] / (2 * np.abs(found.turning_offset[:, 0]))
    assert (found.loop[:, 0] == Loop.LOBES).all()
    np.testing.assert_allclose(mean[:, 0], lobes, rtol=1e-8)
    wound = found.winding_area[:, 1] / (2 * np.pi)
    np.testing.assert_allclose(mean[:, 1], np.stack([wound, wound], axis=-1), rtol=1e-11)


def test_tiny_lobes_carry_the_forces_of_their_saddle():
    x = at_fold(SLOW_TILTED, -1e-12)
    found = separatrices(*abc(x))
    got = functions.separatrix_forces(*x.values(), *places(found))
    side = int(np.argmin(np.abs(found.turning_offset[0])))
    assert abs(found.turning_offset[0, side]) < 1e-4
    rest = Disk(**x).bearings(Motion(found.saddle_phi[0], 0.0, 0.0))
    for field in (got.peak, got.mean, got.rms):
        np.testing.assert_allclose(field[0, side], np.linalg.norm(rest, axis=-1), rtol=1e-3)


def test_other_rotators_follow_from_those_two():
    _, _, got = computed()
    for field in (got.peak, got.mean, got.rms):
        for one, other in ((5, R022), (6, R012), (7, R012)):  # R2, R12, R12c
            both = np.isfinite(field[..., one]) & np.isfinite(field[..., other])
            np.testing.assert_array_equal(field[..., one][both], field[..., other][both])
        present = np.isfinite(field[..., 7])
        constant = np.broadcast_to((COLUMNS["omega1"] ** 2)[:, None, None], present.shape)
        for one in (0, 1, 4):  # R01, R011, R1
            here = present & np.isfinite(field[..., one])
            np.testing.assert_array_equal(field[..., one][here], constant[here])
    assert np.isnan(got.peak_phi[..., [0, 1, 4]]).all()
    no_arm = COLUMNS["a"] == 0
    assert np.isnan(got.peak[no_arm][..., 0]).all()


def test_sides_of_symmetric_disks_are_alike():
    """Without an arm phi -> -phi with omega1 -> -omega1 swaps the sides of the loops."""
    x = {**FAST, "a": 0.0}
    found = separatrices(*abc(x))
    where = places(found)
    one = functions.separatrix_rotators(*cold(x), *where)
    np.testing.assert_allclose(one.peak[0, 0, R022], one.peak[0, 1, R022], rtol=1e-12)
    np.testing.assert_allclose(one.mean[0, 0, R022], one.mean[0, 1, R022], rtol=1e-8)
    turned = functions.separatrix_forces(*{**x, "omega1": -x["omega1"]}.values(), *where)
    there = functions.separatrix_forces(*x.values(), *where)
    # a lobe is run through in both directions, so that its peak knows no time
    np.testing.assert_allclose(turned.peak[0], there.peak[0], rtol=1e-12)


def test_invalid_cells_and_shapes():
    beta = np.array([0.7, -1.0, np.nan])[:, None]
    half_span = np.array([0.2, 0.0])
    x = {**BASE, "beta": beta}
    found = separatrices(*abc(x))
    where = places(found)
    got = functions.separatrix_forces(*{**x, "half_span": half_span}.values(), *where)
    alone = functions.separatrix_forces(*BASE.values(), *(field[0, 0] for field in where))
    for field, one in zip(got, alone, strict=True):
        assert field.shape == (3, 2, 2, 2, 2)
        np.testing.assert_array_equal(field[0, 0], one)
        assert np.isnan(field[1:]).all()
        assert np.isnan(field[:, 1]).all()
    rotators = functions.separatrix_rotators(*cold(x), *where)
    assert rotators.peak.shape == (3, 1, 2, 2, 8)
    assert np.isnan(rotators.peak[1:]).all()
    at_rest = functions.orbit_forces(*{**x, "half_span": half_span}.values(), 0.3, 1.0)
    assert at_rest.peak.shape == (3, 2, 2)
    assert np.isnan(at_rest.peak[1:]).all()
    assert np.isfinite(at_rest.peak[0, 0]).all()


def test_compiled_and_interpreted_agree_to_the_last_bit(monkeypatch):
    names = ["lobes", "heteroclinic, A < 0"]
    x = {n: np.array([*(DISKS[name][n] for name in names), DISKS["lobes"][n]]) for n in NAMES}
    x["omega1"][-1] = np.nan
    found = separatrices(*abc(x))
    where = places(found)
    both = []
    for most in (10**9, 0):
        monkeypatch.setattr(launch, "INTERPRETED_AT_MOST", most)
        monkeypatch.setattr(launch, "_interpreted", {})
        both.append(
            (
                *functions.separatrix_forces(*x.values(), *where),
                *functions.separatrix_rotators(*cold(x), *where),
                *functions.orbit_forces(*x.values(), 0.3, 2.0),
            )
        )
    for one, other in zip(*both, strict=True):
        np.testing.assert_array_equal(one, other)


# --- equilibria --------------------------------------------------------------------------------


def test_forces_at_equilibria():
    points = equilibria(*abc(COLUMNS))
    force, kinetic, weight, magnitude, axial, couple = functions.equilibrium_forces(
        *COLUMNS.values(), points.phi
    )
    assert force.shape == (len(DISKS), 4, 2, 3)
    disks = Disk(**{name: value[:, None] for name, value in COLUMNS.items()})
    at = np.nan_to_num(points.phi)
    rest = Motion(at, 0.0, 0.0)
    s, c = np.sin(at), np.cos(at)
    zero = 0 * s
    axes = np.stack(
        [np.stack(row, -1) for row in ([zero, c, s], [zero, -s, c], [zero + 1, zero, zero])], -2
    )
    present = np.isfinite(points.phi)
    for got, want in ((force, disks.bearings(rest)), (kinetic, disks.bearings(rest, weight=False))):
        own = np.einsum("niab,nijb->nija", axes, want)
        size = np.abs(want).max(axis=(-2, -1), keepdims=True) + 1e-300
        assert (np.abs(got - own) <= 1e-12 * size)[present].all()
    for field in (force, kinetic, weight, magnitude, axial, couple):
        assert np.isnan(field[~present]).all()
        assert np.isfinite(field[present]).all()
    rotator, intensity = functions.equilibrium_rotators(*cold(COLUMNS), points.phi)
    assert rotator.shape == (len(DISKS), 4, 8, 3)
    assert np.isnan(intensity[~present]).all()
    assert (np.nan_to_num(intensity[..., [R022, R012]]) == 0).all()


# --- orbits ------------------------------------------------------------------------------------


def potential(x: dict):
    """V in mpmath, from the coefficients of the oracle's four masses."""
    built = oracle.disk(*(mpf(float(v)) for v in cold(x)))

    def V(phi):
        c, s = mp.cos(phi), mp.sin(phi)
        return -built.B * c + built.A * c * c / 2 - built.C * s

    def slope(phi):
        c, s = mp.cos(phi), mp.sin(phi)
        return built.B * s - built.A * s * c - built.C * c

    return V, slope


@cache
def round_trip(name: str) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Angles on one way, velocities there and back, times: quadrature over the angle in mpmath."""
    x, phi0, dphi0 = ORBITS[name]
    V, slope = potential(x)
    energy = mpf(dphi0) ** 2 / 2 + V(mpf(phi0))
    rest = [mp.findroot(slope, mpf(float(p))) for p in equilibria(*abc(x)).phi if np.isfinite(p)]
    orbit = orbits(*abc(x), phi0, dphi0)
    back = bool(orbit.orbit_kind == OrbitKind.LIBRATION)
    if back:
        guess = [mpf(float(orbit.phi_min)), mpf(float(orbit.phi_max))]
        ends = [mp.findroot(lambda p: V(p) - energy, p, tol=1e-90) for p in guess]
    else:
        ends = [rest[0], rest[0] + 2 * mp.pi]
    passed = sorted({p + 2 * mp.pi * n for p in rest for n in (-2, -1, 0, 1, 2)})
    edges = [ends[0], *(p for p in passed if ends[0] < p < ends[1]), ends[1]]
    node, weight = np.polynomial.legendre.leggauss(12)
    # next to an end the offset is a square, and panels shrink: saddles may be as near as 1e-7
    grade = np.array([0.0, *0.5 ** np.arange(24.0, -1.0, -1.0)])
    wide = np.diff(grade)[:, None] / 2
    part, share = (grade[:-1, None] + wide * (1 + node)).ravel(), (wide * weight).ravel()
    rows = []
    for p, q in zip(edges[:-1], edges[1:], strict=True):
        for end, half in ((p, (q - p) / 2), (q, (p - q) / 2)):
            for t, w in zip(part, share, strict=True):
                at = end + half * mpf(float(t)) ** 2
                v = mp.sqrt(2 * (energy - V(at)))
                rows.append((float(at), float(v), float(abs(half) * 2 * t * w / v)))
    phi, dphi, time = np.array(rows).T
    return phi, [dphi, -dphi] if back else [np.sign(dphi0) * dphi], time


def over_orbit(name: str, rotators: bool):
    """Period, mean and mean square over time."""
    phi, ways, time = round_trip(name)
    disk = Disk(**ORBITS[name][0])
    measure = disk.intensities if rotators else disk.sizes
    values = np.stack([measure(phi, v) for v in ways])
    total = time.sum()
    first, second = (time @ (values**n).mean(axis=0) / total for n in (1, 2))
    return total * len(ways), first, second


def next_to_saddle(x: dict, gap: float) -> tuple[float, float]:
    """A state on the orbit of the lower saddle's energy plus a gap, at the bottom of a well."""
    found, points = separatrices(*abc(x)), equilibria(*abc(x))
    A, B, C = (float(value) for value in abc(x))
    phi = float(points.phi[0])
    top = float(found.saddle_energy[0])
    energy = -B * np.cos(phi) + A / 2 * np.cos(phi) ** 2 - C * np.sin(phi)
    return phi, float(np.sqrt(2 * (top + gap * abs(top) - energy)))


ORBITS = {
    "small": (BASE, float(equilibria(*abc(BASE)).phi[0]) + 0.01, 0.0),
    "in the lower well": (BASE, float(equilibria(*abc(BASE)).phi[0]) + 0.3, 0.0),
    "in the upper well": (BASE, float(equilibria(*abc(BASE)).phi[2]) + 0.2, 1.0),
    "round both wells": (BASE, *next_to_saddle(BASE, 0.1)),
    "forward": (BASE, 0.4, 70.0),
    "backward": (BASE, 0.4, -70.0),
    "inside, 1e-8": (BASE, *next_to_saddle(BASE, -1e-8)),
    "outside, 1e-8": (BASE, *next_to_saddle(BASE, 1e-8)),
    "outside, 1e-14": (BASE, *next_to_saddle(BASE, 1e-14)),
    "pendulum": ({**BASE, "omega1": 0.0}, 2.0, 0.0),
    "two peaks": (
        of(2.1021260, 0.0777102, -0.0122832, 0.4455762, 1.1517087, 0.2229097, 9.81, 0.1155663),
        -2.192335,
        0.6314106,
    ),
    "two peaks, almost in its plane": (
        of(8.80906e-07, 0.2201742, -0.00112908, 0.3036525, 4.3006624, 0.6070856, 9.81, 0.3010251),
        1.7107037,
        -0.4616362,
    ),
}


def test_orbits_are_of_all_kinds():
    kinds = {
        name: orbits_with_angles(*abc(x), phi, v)[1].orbit_family
        for name, (x, phi, v) in ORBITS.items()
    }
    names = {name: OrbitFamily(int(family)).name.lower() for name, family in kinds.items()}
    assert names["forward"] == "forward"
    assert names["backward"] == "backward"
    assert names["in the lower well"] == names["small"] == "lower_well"
    assert names["in the upper well"] == "upper_well"
    assert names["inside, 1e-8"] == "lower_well"
    for name in ("round both wells", "outside, 1e-8", "outside, 1e-14"):
        assert names[name] == "outer"


@pytest.mark.parametrize("name", ORBITS)
def test_means_over_orbits(name):
    x, phi0, dphi0 = ORBITS[name]
    for rotators in (False, True):
        if rotators:
            got = functions.orbit_rotators(*cold(x), phi0, dphi0)
            got = functions.Loads(*(field[[R022, R012]] for field in got))
        else:
            got = functions.orbit_forces(*x.values(), phi0, dphi0)
        period, first, second = over_orbit(name, rotators)
        # next to a separatrix the energy, rounded, tells the period to few digits only
        known = float(orbits(*abc(x), phi0, dphi0).period)
        off = abs(known / period - 1)
        assert off < (1e-9 if "1e-" not in name else 0.05), (name, known, period)
        near = 1e-8 + 4 * off
        np.testing.assert_allclose(got.rms, np.sqrt(second), rtol=near, err_msg=name)
        np.testing.assert_allclose(got.mean, first, rtol=max(near, 1e-7), err_msg=name)


@pytest.mark.parametrize("rotators", [False, True], ids=["forces", "rotators"])
@pytest.mark.parametrize("name", ORBITS)
def test_peaks_over_orbits(name, rotators):
    """No state of a dense sample, nor of zooms into its peaks, exceeds them."""
    x, phi0, dphi0 = ORBITS[name]
    disk = Disk(**x)
    measure = disk.intensities if rotators else disk.sizes
    if rotators:
        full = functions.orbit_rotators(*cold(x), phi0, dphi0)
        got = functions.Loads(*(field[[R022, R012]] for field in full))
    else:
        got = functions.orbit_forces(*x.values(), phi0, dphi0)
    period = float(orbits(*abc(x), phi0, dphi0).period)
    t = np.linspace(0.0, period, 4001)
    values = measure(*flow(*abc(x), phi0, dphi0, t))
    best = values.max(axis=0)
    for k in np.flatnonzero(best > 0):
        y = values[:, k]
        top = (y >= np.append(0.0, y[:-1])) & (y >= np.append(y[1:], 0.0)) & (y > 0.99 * best[k])
        at = t[np.flatnonzero(top)[:20]]
        for width in (period / 4000, period / 4e4, period / 4e5, period / 4e6):
            fine = at[:, None] + width * np.linspace(-1, 1, 41)
            zoomed = measure(*flow(*abc(x), phi0, dphi0, fine))[..., k]
            best[k] = max(best[k], zoomed.max())
            at = np.take_along_axis(fine, zoomed.argmax(axis=1)[:, None], 1)[:, 0]
    np.testing.assert_allclose(got.peak, best, rtol=PEAK)
    there = measure(got.peak_phi, got.peak_dphi)[[0, 1], [0, 1]]
    np.testing.assert_allclose(there, got.peak, rtol=PEAK)
    V, _ = potential(x)
    energy = mpf(dphi0) ** 2 / 2 + V(mpf(phi0))
    scale = float(np.sum(np.abs(abc(x)))) + dphi0**2
    for phi, dphi in zip(got.peak_phi, got.peak_dphi, strict=True):
        assert -np.pi < phi <= np.pi
        assert abs(mpf(float(dphi)) ** 2 / 2 + V(mpf(float(phi))) - energy) <= 1e-13 * scale


def test_means_of_the_coupling_rotator_over_orbits():
    """The mean of |phi'| is the way over the period, its mean square the action over it."""
    rng = np.random.default_rng(12)
    n = 40
    A, B, C = (float(value) for value in abc(BASE))
    size = np.sqrt(abs(A) + abs(B) + abs(C))
    phi0, dphi0 = rng.uniform(-3, 3, n), size * rng.normal(size=n)
    orbit = orbits(A, B, C, phi0, dphi0)
    got = functions.orbit_rotators(*cold(BASE), phi0, dphi0)
    libration = orbit.orbit_kind == OrbitKind.LIBRATION
    assert 5 < libration.sum() < n - 5
    way = np.where(libration, 2 * (orbit.phi_max - orbit.phi_min), 2 * np.pi)
    spin = 2 * BASE["omega1"]
    np.testing.assert_allclose(got.mean[:, R012], spin * way / orbit.period, rtol=1e-7)
    want = spin * np.sqrt(2 * np.pi * orbit.action / orbit.period)
    np.testing.assert_allclose(got.rms[:, R012], want, rtol=1e-11)


def test_at_rest_in_an_equilibrium():
    """The support's rotation alone: peak, mean and rms are one."""
    x, resting = {**BASE, "a": 0.0}, np.array([0.0])
    assert (orbits(*abc(x), resting, 0.0).orbit_kind == OrbitKind.EQUILIBRIUM).all()
    got = functions.orbit_forces(*x.values(), resting, 0.0)
    want = Disk(**x).sizes(resting, 0.0)
    for field in (got.peak, got.mean, got.rms):
        np.testing.assert_allclose(field, want, rtol=1e-12)
    np.testing.assert_allclose(got.peak_phi, np.stack([resting, resting], -1), rtol=1e-15)
    assert (got.peak_dphi == 0).all()


def test_asymptotic_orbits_have_none():
    """A pendulum thrown just so that it reaches the top; g = e = 1 and a particle make B = 1."""
    x = of(np.pi / 2, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.2)
    assert orbits(*abc(x), 0.0, 2.0).orbit_kind == OrbitKind.ASYMPTOTIC
    got = functions.orbit_forces(*x.values(), [0.0, 0.0], [2.0, 1.9])
    for field in got:
        assert np.isnan(field[0]).all()
        assert np.isfinite(field[1]).all()
    for field in functions.orbit_rotators(*cold(x), 0.0, 2.0):
        assert np.isnan(field).all()


def test_states_that_are_not_finite_have_no_orbit():
    phi0 = np.array([0.3, np.nan, np.inf, 0.3, 0.3])
    dphi0 = np.array([1.0, 1.0, 1.0, np.nan, -np.inf])
    with np.errstate(all="ignore"):
        got = functions.orbit_forces(*BASE.values(), phi0, dphi0)
    for field in got:
        assert np.isfinite(field[0]).all()
        assert np.isnan(field[1:]).all()
