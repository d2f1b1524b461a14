"""The disk's coefficients, derived from the Lagrangian and compared with numbers.

The derivation starts from four point masses m/4 at r/sqrt(2) from the center on two perpendicular
diameters, which have the mass, the center and the inertia of the thin disk, and from the two
rotations; it does not use any formula of the papers.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpf
from witnesses import oracle

from phasekit.mechanics.disk import disk_coefficients, disk_inertia, disk_mixing

PRECISION = mpf("1e-15")
NAMES = ("beta", "e", "a", "r", "omega1", "g")


@pytest.fixture(scope="module")
def derived():
    """Return A, B, C and kappa by the Lagrangian, as functions of the parameters in mpmath."""
    beta, e, a, r, g, m = sp.symbols("beta e a r g m", real=True)
    phi1, omega1, domega1 = sp.symbols("phi1 omega1 domega1", real=True)
    phi, dphi, ddphi = sp.symbols("phi dphi ddphi", real=True)

    def rate(f):
        """Time derivative of what depends on the two angles and their velocities."""
        along = {phi1: omega1, omega1: domega1, phi: dphi, dphi: ddphi}
        return sum(
            (f.diff(x) * y for x, y in along.items()), sp.zeros(*getattr(f, "shape", (1, 1)))
        )

    # Frame at rest: n2 along the first axis at phi1 = 0, [n1, n2] along the second, n1 up.
    turn1 = sp.rot_ccw_axis3(phi1)
    turn2 = sp.rot_ccw_axis1(phi)
    # At phi = 0 the center hangs straight down; the second diameter is perpendicular to both.
    first = sp.Matrix([sp.cos(beta), 0, -sp.sin(beta)])
    second = sp.Matrix([0, 1, 0])
    arm = sp.Matrix([0, a, 0])
    lagrangian = sp.Integer(0)
    for diameter in (first, second):
        for reach in (r / sp.sqrt(2), -r / sp.sqrt(2)):
            position = turn1 * (arm + turn2 * (e * first + reach * diameter))
            velocity = rate(position)
            lagrangian += m / 4 * (velocity.dot(velocity) / 2 - g * position[2])

    # phi1(t) is prescribed: one equation, that of phi.
    motion = rate(sp.Matrix([lagrangian.diff(dphi)]))[0] - lagrangian.diff(phi)

    # As a polynomial in sines and cosines, even powers of a sine replaced.
    symbols = {}
    for angle in (beta, phi1, phi):
        symbols[sp.sin(angle)], symbols[sp.cos(angle)] = sp.symbols(f"s_{angle} c_{angle}")
    motion = sp.expand(sp.expand(motion).subs(symbols))
    for angle in (phi1, phi):
        sin, cos = symbols[sp.sin(angle)], symbols[sp.cos(angle)]
        motion = sp.expand(sp.rem(motion, sin**2 + cos**2 - 1, sin))
    sin, cos = symbols[sp.sin(phi)], symbols[sp.cos(phi)]
    unknowns = (ddphi, dphi, domega1, symbols[sp.sin(phi1)], symbols[sp.cos(phi1)], sin, cos)
    terms = sp.Poly(motion, *unknowns).as_dict()
    inertia = terms.pop((1, 0, 0, 0, 0, 0, 0))
    B, A, C, mixing = (
        sign * terms.pop(power) / inertia
        for sign, power in (
            (1, (0, 0, 0, 0, 0, 1, 0)),
            (-1, (0, 0, 0, 0, 0, 1, 1)),
            (-1, (0, 0, 0, 0, 0, 0, 1)),
            (1, (0, 0, 1, 0, 0, 0, 1)),
        )
    )
    assert terms == {}  # nothing else is in the equation of motion
    back = {symbol: function for function, symbol in symbols.items()}
    found = [x.subs(back).subs(m, 1) for x in (A, B, C, mixing)]
    return sp.lambdify((beta, e, a, r, omega1, g), found, "mpmath")


def disks() -> np.ndarray:
    """Return random disks, then special ones; columns as NAMES."""
    rng = np.random.default_rng(8)
    n = 60
    random = np.column_stack(
        [
            rng.uniform(0, np.pi, n),
            10 ** rng.uniform(-3, 0, n),
            rng.normal(size=n),
            10 ** rng.uniform(-3, 0, n),
            rng.choice([-1, 1], n) * 10 ** rng.uniform(-2, 3, n),
            rng.choice([9.80665, 1.6, -9.80665], n),
        ]
    )
    usual = {"beta": 0.7, "e": 0.03, "a": 0.05, "r": 0.21, "omega1": 12.5, "g": 9.81}
    changes = [
        {"e": 0.0},
        {"r": 0.0},
        {"e": 0.0, "beta": np.pi / 2},  # no force at all but for cos(pi/2) of the double
        {"beta": 0.0},
        {"beta": np.pi / 2},
        {"beta": np.nextafter(np.pi, 0)},
        {"beta": 2.4},
        {"a": -0.05},
        {"a": 0.0},
        {"g": 0.0},
        {"g": -9.81},
        {"omega1": 0.0},
        {"omega1": -12.5},
        {"omega1": 1e-9},
        {"beta": 1e-200},
        {"e": 1e-180, "beta": 1e-9},
        {"e": 1e6, "a": 1e-6},
    ]
    # eps sin^2 beta = 1, where lambda and psi are infinite: 2 e sin(beta) = r cos(beta)
    for beta in (0.1, 0.5, 1.0, 1.4, 1.55):
        e = 0.21 * np.cos(beta) / (2 * np.sin(beta))
        changes += [{"beta": beta, "e": e}, {"beta": beta, "e": np.nextafter(e, 1)}]
        changes += [{"beta": beta * (1 + 1e-9), "e": e}, {"beta": np.pi - beta, "e": e}]
    special = [[{**usual, **change}[name] for name in NAMES] for change in changes]
    return np.vstack([random, special])


def close(got, want, scale) -> bool:
    return abs(mpf(float(got)) - want) <= PRECISION * abs(scale)


@pytest.mark.slow
def test_coefficients_are_those_of_the_lagrangian(derived):
    for disk in disks():
        beta, e, a, r, omega1, g = (float(x) for x in disk)
        with mp.workdps(60):
            A, B, C, mixing = derived(*(mpf(x) for x in (beta, e, a, r, omega1, g)))
        got = disk_coefficients(beta, e, a, r, omega1, g)
        # A to 1e-15 of omega1^2 (it cancels), the others to 1e-15 of themselves
        assert close(got[0], A, mpf(omega1) ** 2), (disk, float(got[0]), float(A))
        assert close(got[1], B, B), (disk, float(got[1]), float(B))
        assert close(got[2], C, C), (disk, float(got[2]), float(C))
        kappa = disk_mixing(r, e, beta)
        assert close(kappa, mixing, mixing), (disk, float(kappa), float(mixing))


@pytest.mark.slow
def test_the_four_masses_of_the_tests_agree_with_the_lagrangian(derived):
    """The oracle's way is another one: energies at four angles."""
    for disk in disks()[::5]:
        with mp.workdps(60):
            want = derived(*(mpf(float(x)) for x in disk))
            built = oracle.disk(*(float(x) for x in disk))
            for x, y in zip(want, (built.A, built.B, built.C, built.mixing), strict=True):
                assert abs(x - y) <= mpf("1e-40") * (abs(x) + mpf(float(disk[4])) ** 2 + 1), disk


@pytest.mark.parametrize("case", oracle.cases("coefficients"), ids=lambda case: case["id"])
def test_recorded_values(case):
    values = {name: float(case["in"][name]) for name in NAMES}
    A, B, C = disk_coefficients(**values)
    out = {name: mpf(text) for name, text in case["out"].items() if isinstance(text, str)}
    assert close(A, out["A"], mpf(values["omega1"]) ** 2)
    assert close(B, out["B"], out["B"])
    assert close(C, out["C"], out["C"])
    mixing = disk_mixing(values["r"], values["e"], values["beta"])
    assert close(mixing, out["mix"], out["mix"])
    Jn = disk_inertia(float(case["in"]["m"]), values["r"], values["e"], values["beta"])[2]
    assert close(Jn, out["Jn2"], out["Jn2"])
    if out.get("lam", 0):
        # A may have lost digits to omega1^2, so lambda and psi are compared through it
        assert abs(B / mpf(float(A)) / out["lam"] - 1) <= mpf("1e-14") + 2 * PRECISION * abs(
            mpf(values["omega1"]) ** 2 / out["A"]
        )


def test_inertia_at_the_pole_on_the_shaft():
    """About O2, with u2 tangential, v2 radial inward and n2 along the shaft."""
    for disk in disks():
        beta, e, _, r, _, _ = (float(x) for x in disk)
        m = 2.5
        want = oracle.disk(beta, e, 0, r, 0, 0, m)
        got = disk_inertia(m, r, e, beta)
        for x, y in zip(got, (want.Ju, want.Jv, want.Jn, want.Jvn), strict=True):
            assert close(x, y, y), (disk, float(x), float(y))
    # the center's own moments: a quarter of m r^2 about diameters, half of it about the normal
    assert np.allclose(disk_inertia(2.0, 0.3, 0.0, np.pi / 2), [0.045, 0.045, 0.09, 0], atol=1e-17)
    assert np.allclose(disk_inertia(2.0, 0.3, 0.0, 0.0), [0.045, 0.09, 0.045, 0], atol=1e-17)
    # product of inertia positive for 0 < beta < pi/2
    assert disk_inertia(2.0, 0.3, 0.1, 0.5)[3] > 0
    assert disk_inertia(2.0, 0.3, 0.1, 2.5)[3] < 0


def test_shaft_in_the_disks_plane():
    """The double nearest to pi stands for pi itself: no offset, so B = C = 0 and A = -omega1^2."""
    for beta in (0.0, np.pi):
        A, B, C = disk_coefficients(beta, 0.3, 0.1, 0.2, 5.0, 9.81)
        assert (A, B, C) == (-25.0, 0.0, 0.0)
        assert disk_mixing(0.2, 0.3, beta) == 0


def test_particle_and_centered_disk():
    """A particle on a circle (r = 0, beta = pi/2) and a disk without offset (e = 0)."""
    A, B, C = disk_coefficients(np.pi / 2, 0.4, 0.1, 0.0, 3.0, 9.81)
    assert np.allclose([A, B, C], [9.0, 9.81 / 0.4, 9.0 * 0.1 / 0.4], rtol=1e-15)
    A, B, C = disk_coefficients(0.7, 0.0, 0.1, 0.2, 3.0, 9.81)
    assert (B, C) == (0, 0)
    assert np.isclose(A, -9.0 * np.cos(0.7) ** 2 / (1 + np.sin(0.7) ** 2), rtol=1e-15)


def test_sign_of_a_and_of_gravity_are_kept():
    A, B, C = disk_coefficients(0.7, 0.1, 0.05, 0.2, 3.0, 9.81)
    assert B > 0
    assert C > 0
    other = disk_coefficients(0.7, 0.1, -0.05, 0.2, 3.0, -9.81)
    assert np.array_equal(other, [A, -B, -C])
    assert np.array_equal(disk_coefficients(0.7, 0.1, 0.05, 0.2, -3.0, 9.81), [A, B, C])


ILLEGAL = [
    {"beta": -1e-9},
    {"beta": 30.0},
    {"beta": np.nextafter(np.pi, 4)},
    {"e": -0.1},
    {"r": -0.1},
    {"r": 0.0, "e": 0.0},
    {"r": 0.0, "beta": 0.0},
    *({name: bad} for name in NAMES for bad in (np.nan, np.inf, -np.inf)),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("change", ILLEGAL, ids=str)
def test_what_is_not_a_body_is_nan(change):
    usual = {"beta": 0.7, "e": 0.03, "a": 0.05, "r": 0.21, "omega1": 12.5, "g": 9.81}
    assert np.all(np.isfinite(disk_coefficients(**usual)))
    both = {name: np.array([usual[name], {**usual, **change}[name]]) for name in NAMES}
    got = np.array(disk_coefficients(**both))
    assert np.array_equal(got[:, 0], disk_coefficients(**usual))
    assert np.isnan(got[:, 1]).all()


def test_arguments_broadcast():
    beta, a = np.linspace(0.1, 3, 4)[:, None], np.array([0.0, 0.1, -0.2])
    for got in disk_coefficients(beta, 0.03, a, 0.2, 5.0, 9.81):
        assert got.shape == (4, 3)
    want = disk_coefficients(float(beta[2, 0]), 0.03, -0.2, 0.2, 5.0, 9.81)
    got = disk_coefficients(beta, 0.03, a, 0.2, 5.0, 9.81)
    assert [x[2, 2] for x in got] == list(want)
    assert disk_mixing(0.2, 0.03, beta).shape == (4, 1)
