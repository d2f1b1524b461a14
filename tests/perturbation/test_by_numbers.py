"""Melnikov's function by sums over the separatrix, with derivatives by differences.

Of the formulas only the motion on the separatrix is used; parameters are changed in the system.
"""

import numpy as np
import pytest

import phasekit as pk
from phasekit.perturbation.melnikov import assembled

H = pk.Harmonic
DISKS = [
    pk.GyroRotorDisk(beta=1.2, e=0.05, a=0.004, r=0.1, omega1=24.0),
    pk.GyroRotorDisk(beta=0.5, e=0.02, a=-0.03, r=0.1, omega1=-15.0),
]
EIGHTS = [(1.0, 0.35, 0.12), (-1.0, 0.2, 0.3), (1.0, -0.35, -0.12), (0.0, 0.35, 0.12),
          (1.0, 0.0, 0.4), (1.0, 0.5, 0.0)]  # fmt: skip
QUARTIC = pk.Potential("-b*x**2/2 + x**4/4", "x", {"b": 1.3})


def changed(function, system, name):
    """Derivative of what a function gives by a parameter, of fourth order."""
    value = getattr(system, name)
    step = 1e-3 * max(abs(value), 0.1)
    at = [function(system.replace(**{name: value + k * step})) for k in (-2, -1, 1, 2)]
    return (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step)


def euler(system, phi):
    """Torque of omega1' on a disk, from dynamics: -kappa cos phi."""
    s, c, r, e = np.sin(system.beta), np.cos(system.beta), system.r, system.e
    kappa = (r * r + 4 * e * e) * s * c / (4 * e * e * s * s + r * r * (1 + s * s))
    return -kappa * np.cos(phi)


def by_sums(base, p, saddle, side, t0):
    """Mean, and the oscillation at times t0; None where the loop is absent."""
    k = pk.separatrices(base).saddle_exponent.sel(saddle=saddle).item()
    points = 301 if isinstance(base, pk.Potential) else 4001
    t = np.linspace(-45.0 / k, 45.0 / k, points)
    motion = pk.separatrix_motion(base, t, saddle=saddle, side=side)
    x, v = motion.motion_phi.values, motion.motion_dphi.values
    if not np.isfinite(x).all():
        return None
    dt = t[1] - t[0]
    mean = dt * np.sum((p.torque - p.damping * v - p.quadratic * abs(v) * v) * v)
    for name, rate in p.drift.items():
        slope = changed(lambda one: pk.potential(one, x).potential.values, base, name)
        # less what the saddle's energy changes by, of which the gap is counted
        mean += dt * rate * np.sum(slope - 0.5 * (slope[0] + slope[-1]))
        if name == "omega1":
            mean += dt * rate * np.sum(euler(base, x) * v)
    swing = np.zeros(t0.size)
    for h in p.forcing:
        wave = np.cos(h.frequency * (t + t0[:, None]) + h.phase)
        swing += h.amplitude * dt * wave @ v
    for name, h in p.modulation.items():
        push = -changed(lambda one: pk.gradient(one, x).potential_gradient.values, base, name)
        angle = h.frequency * (t + t0[:, None]) + h.phase
        swing += h.amplitude * dt * np.cos(angle) @ (push * v)
        if name == "omega1":
            swing -= h.amplitude * h.frequency * dt * np.sin(angle) @ (euler(base, x) * v)
    return mean, swing


def compare(p):
    """Number of loops compared."""
    ds, base, count = pk.melnikov(p), p.system, 0
    t0 = np.linspace(0.0, 7.0, 11)
    for saddle in ds.saddle.values:
        if not np.isfinite(pk.separatrices(base).saddle_phi.sel(saddle=saddle)):
            continue
        for side in ("left", "right"):
            found = by_sums(base, p, saddle if isinstance(saddle, str) else int(saddle), side, t0)
            if found is None:
                continue
            mean, swing = found
            at = ds.sel(saddle=saddle, side=side)
            assert at.melnikov_mean.item() == pytest.approx(mean, rel=1e-7, abs=1e-10)
            drive = [*p.forcing, *p.modulation.values()]
            nu, size = drive[0].frequency, at.melnikov_amplitude.item()
            phase = at.melnikov_phase.item() if size else 0.0
            want = size * np.cos(nu * t0 + phase)
            assert want == pytest.approx(swing, rel=1e-6, abs=1e-8 * max(abs(swing)) + 1e-13)
            if p.damping == p.quadratic == 0.0 and not p.drift and p.torque == 0.0:
                assert at.turnstile_area.item() == pytest.approx(2 * size / nu, rel=1e-9)
            elif size:
                own = at.chaos_threshold.item() * size / abs(drive[0].amplitude)
                assert own == pytest.approx(abs(mean), rel=1e-6)
            count += 1
    return count


@pytest.mark.parametrize("disk", DISKS)
@pytest.mark.parametrize(
    ("modulation", "drift"),
    [({"omega1": H(-1e-3, 9.0, 0.7)}, {"omega1": -0.02}), ({"beta": H(1e-3, 5.0)}, {"e": 0.01})],
)
def test_disks(disk, modulation, drift):
    p = pk.Perturbed(disk, damping=0.1, quadratic=-0.02, modulation=modulation, drift=drift)
    assert compare(p) == 4


@pytest.mark.parametrize("abc", EIGHTS)
@pytest.mark.parametrize("name", ["A", "C"])
def test_coefficients(abc, name):
    base = pk.Coefficients(*abc)
    p = pk.Perturbed(
        base, damping=0.1, torque=0.03, modulation={name: H(0.1, 1.3, 0.4)}, drift={name: -0.01}
    )
    assert compare(p) in (2, 4)
    assert compare(pk.Perturbed(base, forcing=H(-0.2, 2.2, 1.0))) in (2, 4)


def test_where_drift_parts_the_saddles_it_is_not_known():
    p = pk.Perturbed(pk.Coefficients(1.0, 0.0, 0.4), damping=0.1, drift={"B": 0.01})
    assert np.isnan(pk.melnikov(p).melnikov_mean).all()
    still = pk.melnikov(p.replace(drift_B=0.0)).melnikov_mean
    assert (still < 0.0).all()


@pytest.mark.parametrize("rate", [1e-3, -1e-3])
def test_capture_while_a_spin_drifts(rate):
    """Both wells widen or narrow alike; what rotates is led in only where they take phase."""
    spin = pk.SpinOrbit(mean_motion=1.0, asymmetry=0.3, strength=1.0)
    p = pk.Perturbed(spin, damping=1e-4, drift={"asymmetry": rate})
    step = 1e-5
    areas = [
        pk.separatrices(spin.replace(asymmetry=0.3 + s * step)).lobe_area.values for s in (1, -1)
    ]
    loss = 1e-4 * pk.separatrices(spin).lobe_area.values
    loss = 0.5 * (loss + rate * (areas[0] - areas[1]) / (2 * step))  # an arc there, one back
    assert -pk.melnikov(p).melnikov_mean.values == pytest.approx(loss, rel=1e-8)
    share = pk.capture(p).capture_probability.values
    assert share == pytest.approx([0.5, 0.5, 0.0] if rate > 0 else [0.0, 0.0, 1.0])


def test_any_potential():
    p = pk.Perturbed(QUARTIC, damping=0.1, modulation={"b": H(0.1, 1.2, 0.3)}, drift={"b": -0.1})
    assert compare(p) == 2
    assert compare(pk.Perturbed(QUARTIC, forcing=H(0.1, 0.7, 2.0))) == 2


def test_what_symmetry_cancels_costs_no_digits():
    """The drift of C takes nothing here; second harmonics are small beside the first."""
    A, B = -0.12671154648393168, 0.6318057260154758
    closed = pk.Coefficients(A, B, 0.0)
    values = {"A": A, "B": B, "C": 0.0}
    text = "-B*cos(x) + A*cos(x)^2/2 - C*sin(x)"
    numerical = pk.Potential(text, "x", values, period="2*pi")
    for nu in (0.3, 5.0):
        drive = {
            "forcing": [pk.Harmonic(0.1, nu, 0.3), pk.Harmonic(0.05, 2.0 * nu)],
            "drift": {"C": 0.01},
        }
        for torque in (0.0, -0.2):
            kept = {**drive, "damping": 0.02, "quadratic": 0.05, "torque": torque}
            want, found = (pk.melnikov(pk.Perturbed(one, **kept)) for one in (closed, numerical))
            for name in ("melnikov_mean", "melnikov_amplitude", "turnstile_area"):
                one, other = want[name].sel(saddle="upper").values, found[name].values[0]
                assert np.isfinite(one).all()
                assert other == pytest.approx(one, rel=1e-6)


def test_a_mean_that_is_not_known_has_no_amplitude_against_it():
    """With two frequencies the greatest response is another one against the other sense."""
    mean = np.array([np.nan, 1.0, -1.0])
    parts = [
        (np.ones(3), np.ones(3), np.full(3, nu), np.zeros(3)) for nu in (1.0, 2.0)
    ]  # cos t + cos 2 t
    shaped = [(Z[:, None, None], *rest) for Z, *rest in parts]
    found = assembled(mean[:, None, None], shaped, np.zeros(3, bool))
    assert found.melnikov_amplitude[:, 0, 0] == pytest.approx([np.nan, 1.125, 2.0], nan_ok=True)


@pytest.mark.parametrize("B", [0.5, 0.35])
def test_quadratic_damping_has_a_corner_where_lobes_turn(B):
    formula = pk.Potential(f"-{B}*cos(x) + cos(x)^2/2", "x", period="2*pi")
    want, found = (
        pk.melnikov(pk.Perturbed(one, quadratic=0.05)).melnikov_mean
        for one in (pk.Coefficients(1.0, B, 0.0), formula)
    )
    assert found.shape == (2, 2)
    for saddle, phi in (("lower", 0.0), ("upper", np.pi)):
        at = int(np.argmin(np.abs(pk.separatrices(formula).saddle_phi.values - phi)))
        assert found.values[at] == pytest.approx(want.sel(saddle=saddle).values, rel=1e-9)
