"""Results of first order say where they do not hold: NaN, with a code for the reason."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve
from witnesses import manifolds
from witnesses.variants import some

import phasekit as pk

EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
PENDULUM = pk.Pendulum(length=1.0, g=1.0)
WELL = pk.Potential("x**4/4 - x**2/2", "x")
CIRCLE = pk.Potential("-cos(x)", "x", period="2*pi")
TILTABLE = pk.Potential("cos(x)^2/2 - 7/20*cos(x) - 3/25*sin(x)", "x", period="2*pi")  # EIGHT
DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.01, r=0.1, omega1=15.0, m=2.0)
FREE = pk.FreeGyroRotor(DISK, carrier_inertia=0.02)
FORCED = pk.Harmonic(0.1, 1.0)


def code(ds, name):
    return {pk.Validity(int(value)).name for value in np.unique(ds[name])}


@pytest.mark.parametrize(
    "system", [EIGHT, TILTABLE, WELL, FREE], ids=["eight", "any", "line", "free"]
)
@pytest.mark.parametrize(
    ("terms", "reason"),
    [
        ({"damping": [1e3, 1e12]}, "NOT_WEAK"),
        ({"damping": 0.01, "forcing": FORCED}, "FORCED"),
        ({"damping": 0.01, "forcing": [pk.Harmonic(0.0, 1.0), FORCED]}, "FORCED"),
        ({"damping": 0.01, "kT": 0.1}, "NOISY"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_capture_beyond_its_theory_has_no_odds(system, terms, reason):
    ds = pk.capture(pk.Perturbed(system, **terms))
    assert np.isnan(ds.capture_probability).all()
    assert np.isnan(ds.capture_flux).all()
    assert np.isnan(ds.capture_error).all()
    assert code(ds, "capture_validity") == {reason}


@pytest.mark.parametrize("system", [EIGHT, TILTABLE])
def test_capture_from_rotation_ends_where_the_equilibria_do(system):
    critical = float(pk.critical_torque(EIGHT).critical_torque.sel(direction="plus"))
    torque = critical * np.array([0.01, 1.001, 5.0])
    ds = pk.capture(pk.Perturbed(system, damping=0.05, torque=torque), start="rotation")
    names = [pk.Validity(int(value)).name for value in ds.capture_validity]
    assert names == ["HOLDS", "NO_EQUILIBRIUM", "NO_EQUILIBRIUM"]
    known = np.isfinite(ds.capture_probability).all("region").values.tolist()
    assert known == [True, False, False]


def test_cells_that_hold_are_left_alone_by_those_that_do_not():
    ds = pk.capture(pk.Perturbed(EIGHT, damping=[0.003, 1e3, 0.01]))
    alone = pk.capture(pk.Perturbed(EIGHT, damping=0.01))
    np.testing.assert_array_equal(ds.capture_probability[2], alone.capture_probability)
    assert np.isnan(ds.capture_probability[1]).all()
    assert np.all(np.diff(ds.capture_error[[0, 2]]) > 0.0)
    assert pk.capture(pk.Perturbed(EIGHT, damping=1e-12)).capture_error < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.02, 0.08, 0.2])
def test_the_error_of_the_odds_covers_simulated_shares(damping):
    damped = pk.Perturbed(EIGHT, damping=damping)
    odds = pk.capture(damped)
    loops = pk.separatrices(EIGHT)
    low, high = loops.saddle_energy.values
    rng = np.random.default_rng(3)
    phi, dphi = rng.uniform(-np.pi, np.pi, 20_000), rng.uniform(-2.0, 2.0, 20_000)
    height = (pk.energy(EIGHT, phi, dphi).energy_integral.values - low) / (high - low)
    kept = np.flatnonzero((height > 0.2) & (height < 0.6))[:1500]
    assert len(kept) == 1500
    ends = pk.flow(damped, phi[kept], dphi[kept], 20.0 / damping).motion_phi.values
    share = np.mean(ends > loops.saddle_phi.sel(saddle="lower").item())
    noise = 3.0 * np.sqrt(share * (1.0 - share) / len(kept))
    off = abs(share - odds.capture_probability.sel(region="right").item())
    assert off <= odds.capture_error.item() + noise


@pytest.mark.parametrize("length", [1e-3, 1.0, 1e4])
def test_the_retrapping_torque_ends_at_the_critical_one(length):
    pendulum = pk.Pendulum(length=length, g=1.0)
    k = 1.0 / np.sqrt(length)
    ds = pk.retrapping_torque(pk.Perturbed(pendulum, damping=np.array([0.1, 0.7, 0.8, 10.0]) * k))
    torque, critical = ds.retrapping_torque.values, 1.0 / length
    np.testing.assert_allclose(
        torque[:2, 1] / critical, np.array([0.1, 0.7]) * 4.0 / np.pi, rtol=1e-12
    )
    assert np.isnan(torque[2:]).all()
    assert code(ds.isel(damping=slice(2, None)), "retrapping_validity") == {"NO_EQUILIBRIUM"}


@pytest.mark.parametrize("system", [PENDULUM, CIRCLE, EIGHT], ids=["pendulum", "circle", "eight"])
def test_thresholds_need_equilibria_and_weak_damping(system):
    driven = pk.Perturbed(system, damping=[0.1, 100.0], forcing=FORCED)
    ds = pk.melnikov(driven)
    there = np.isfinite(ds.melnikov_mean)
    assert there.isel(damping=0).any()
    assert np.isfinite(ds.chaos_threshold.isel(damping=0)).any()
    assert np.isnan(ds.chaos_threshold.isel(damping=1)).all()
    assert np.isnan(ds.turnstile_area.isel(damping=1)).all()
    assert code(ds.isel(damping=1), "threshold_validity") <= {"NOT_WEAK", "ABSENT"}
    tilted = pk.melnikov(pk.Perturbed(system, damping=0.1, torque=5.0, forcing=FORCED))
    assert np.isnan(tilted.chaos_threshold).all()
    assert "NO_EQUILIBRIUM" in code(tilted, "threshold_validity")


def sech(x):
    return 2.0 * np.exp(-np.abs(x)) / (1.0 + np.exp(-2.0 * np.abs(x)))


LINE = pk.Potential("x**2/2 - x**4/4", "x", interval=(-1.5, 1.5))
HIGH = np.concatenate(
    [np.linspace(0.5, 40.0, 80), [60.0, 62.8, 87.3, 100.0, 174.5, 200.0, 1e3, 1e6]]
)


@pytest.mark.parametrize(
    ("system", "closed"),
    [
        (WELL, lambda nu: np.sqrt(2.0) * np.pi * nu * sech(0.5 * np.pi * nu)),
        (CIRCLE, lambda nu: 2.0 * np.pi * sech(0.5 * np.pi * nu)),
        (LINE, lambda nu: np.sqrt(2.0) * np.pi * nu * np.exp(-np.pi * nu / np.sqrt(2.0))
            * 2.0 / (1.0 - np.exp(-np.sqrt(2.0) * np.pi * nu))),
    ],
    ids=["homoclinic", "rotation", "heteroclinic"],
)  # fmt: skip
def test_high_frequencies_have_their_response_or_none(system, closed):
    driven = pk.Perturbed(system, damping=0.1, forcing=pk.Harmonic(1.0, HIGH))
    ds = pk.melnikov(driven)
    found = ds.melnikov_amplitude.max("saddle").isel(side=0).values
    known = np.isfinite(found)
    assert known[:16].all()
    np.testing.assert_allclose(found[known], closed(HIGH)[known], rtol=2e-6)
    assert not known[HIGH > 30.0].any()
    threshold = ds.chaos_threshold.max("saddle").isel(side=0).values
    assert not np.isfinite(threshold[~known]).any()


def test_high_frequencies_of_a_free_rotor_have_their_response_or_none():
    k = (
        float(np.nanmax(pk.equilibria(FREE).exponent))
        if "exponent" in pk.equilibria(FREE)
        else 10.0
    )
    nu = k * np.linspace(1.0, 120.0, 60)
    free = pk.Perturbed(FREE, damping=0.3, forcing=pk.Harmonic(1.5, nu))
    amplitude = pk.melnikov(free).melnikov_amplitude
    size = float(amplitude.isel(forcing_frequency=0).max())
    later = amplitude.isel(forcing_frequency=slice(30, None)).values
    assert np.isfinite(amplitude.isel(forcing_frequency=0)).any()
    assert np.nanmax(np.nan_to_num(later)) < 1e-6 * size


def wells_of(A, B, C, torque):
    """Number of equilibria under a torque, by the roots of a quartic in tan(phi/2)."""
    quartic = [C - torque, 2.0 * (B + A), -2.0 * torque, 2.0 * (B - A), -C - torque]
    roots = np.roots(quartic)
    return int((np.abs(roots.imag) < 1e-7 * np.abs(roots)).sum())


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(
    ("A", "B", "C"), some([(2.0, -0.9, 0.2), (1.0, 0.35, 0.12), (1.1, 0.1, -0.3)], 3)
)
def test_a_torque_that_empties_a_well_leaves_it_no_odds_and_no_threshold(exact, A, B, C):
    system = pk.Coefficients(A, B, C)
    if not exact:
        text = "A/2*cos(x)^2 - B*cos(x) - C*sin(x)"
        system = pk.Potential(text, "x", {"A": A, "B": B, "C": C}, period="2*pi")
    torque = np.linspace(-1.9, 1.9, 24)
    number = np.array([wells_of(A, B, C, one) for one in torque])
    assert {0, 2, 4} == set(number.tolist())
    pushed = pk.Perturbed(system, damping=0.01, torque=torque, forcing=FORCED)
    ds = pk.melnikov(pushed)
    loop = ds.loop if "loop" in ds else pk.separatrices(system).loop
    lobes = loop.values == pk.Loop.LOBES
    assert lobes.sum() == 1
    codes = ds.threshold_validity.values[..., 0]
    gone = codes == pk.Validity.NO_EQUILIBRIUM
    np.testing.assert_array_equal(gone[:, lobes][:, 0], number < 4)
    np.testing.assert_array_equal(gone[:, ~lobes][:, 0], number == 0)
    assert np.isnan(ds.chaos_threshold.values[gone]).all()
    for start in ("lobes", "rotation"):
        options = {} if start == "lobes" else {"start": start}
        odds = pk.capture(pushed.replace(forcing_amplitude=0.0), **options)
        names = odds.capture_validity.values == pk.Validity.NO_EQUILIBRIUM
        np.testing.assert_array_equal(names, number < 4)
        assert np.isnan(odds.capture_probability.values[names]).all()


def test_a_free_rotor_has_no_odds_beyond_its_critical_torque():
    torque = np.array([0.0, 1.0, 300.0, 1e6])
    steady = pk.equilibria(pk.Perturbed(FREE, torque=torque)).n_equilibria.values
    assert steady[0] == 4
    assert steady[-1] == 0
    ds = pk.capture(pk.Perturbed(FREE, damping=0.02, torque=torque))
    names = ds.capture_validity.values == pk.Validity.NO_EQUILIBRIUM
    np.testing.assert_array_equal(names, steady < 4)
    driven = pk.Perturbed(FREE, damping=0.02, torque=torque, forcing=FORCED)
    threshold = pk.melnikov(driven).chaos_threshold.isel(torque=-1)
    assert np.isnan(threshold).all()


@pytest.mark.parametrize("system", [EIGHT, TILTABLE])
@pytest.mark.parametrize(
    ("terms", "reason"),
    [({"forcing": FORCED}, "FORCED"), ({"kT": 0.01}, "NOISY")],
    ids=["forced", "noisy"],
)
def test_a_drive_and_noise_decide_about_retrapping(system, terms, reason):
    ds = pk.retrapping_torque(pk.Perturbed(system, damping=0.01, **terms))
    assert np.isnan(ds.retrapping_torque).all()
    assert code(ds, "retrapping_validity") == {reason}


@pytest.mark.slow
@pytest.mark.parametrize("system", [EIGHT, PENDULUM], ids=["eight", "pendulum"])
@pytest.mark.parametrize(
    ("damping", "share"), [(0.02, -0.02), (0.02, 0.1), (0.1, 0.3), (0.2, 0.5), (0.2, 0.9)]
)
def test_the_error_of_odds_under_a_torque_covers_simulated_shares(system, damping, share):
    critical = float(pk.critical_torque(system).critical_torque.sel(direction="plus"))
    pushed = pk.Perturbed(system, damping=damping, torque=share * critical)
    odds = pk.capture(pushed, start="rotation")
    if system is EIGHT and share > 0.2:
        assert code(odds, "capture_validity") == {"NO_EQUILIBRIUM"}
        return
    assert code(odds, "capture_validity") == {"HOLDS"}
    rng = np.random.default_rng(7)
    phi = rng.uniform(0.0, 2.0 * np.pi, 1500)
    dphi = -np.sign(share) * rng.uniform(4.0, 7.0, phi.size)
    last = 40.0 / damping + 50.0
    ends = pk.flow(pushed, phi, dphi, last, rtol=1e-8)
    angle, still = ends.motion_phi.values, np.abs(ends.motion_dphi.values) < 0.05
    angle = np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
    border = float(pk.separatrices(system).saddle_phi.sel(saddle="lower")) if system is EIGHT else 9
    left, right = np.mean(still & (angle < border)), np.mean(still & (angle >= border))
    found = odds.capture_probability.values
    if system is PENDULUM:
        found = np.array([found[0] + found[1], 0.0, found[2]])
    off = np.abs(found - [left, right, 1.0 - left - right]).max()
    assert off <= odds.capture_error.item() + 3.0 * np.sqrt(0.25 / phi.size)


#: Force, its slope and saddle under a torque, and the ends of manifolds.
LAWS = {
    "circle": (CIRCLE, lambda x: -np.sin(x), lambda x: -np.cos(x)),
    "well": (WELL, lambda x: x - x**3, lambda x: 1.0 - 3.0 * x * x),
    "cubic": (
        pk.Potential("x^3/3 - x^2/2", "x", interval=(-3, 3)),
        lambda x: x - x * x,
        lambda x: 1.0 - 2.0 * x,
    ),
    "eight": (
        EIGHT,
        lambda x: (np.cos(x) - 0.35) * np.sin(x) + 0.12 * np.cos(x),
        lambda x: np.cos(2.0 * x) - 0.35 * np.cos(x) - 0.12 * np.sin(x),
    ),
}


def threshold_of(name, damping, nu, torque=0.0):
    """The threshold to the right, its error and code, and whether manifolds meet at a drive."""
    system, pull, slope = LAWS[name]
    at = {"damping": damping, "torque": torque, "forcing": pk.Harmonic(1.0, nu)}
    ds = pk.melnikov(pk.Perturbed(system, **at)).isel(side=1)
    row = int(np.flatnonzero(np.isfinite(ds.melnikov_mean.values))[0])
    start = float(pk.separatrices(system).saddle_phi.values.reshape(-1)[row])
    saddle = float(fsolve(lambda x: pull(x) + torque, start)[0])
    turn = 2.0 * np.pi if name == "circle" else 0.0
    ends = ((saddle, 1, 1), (saddle + turn, -1, -1 if turn else 1))
    one = ds.isel(saddle=row)
    found = (one.chaos_threshold, one.chaos_threshold_error, one.threshold_validity)
    return (*(x.item() for x in found), lambda drive: manifolds.meet(
        lambda x: pull(x) + torque, slope, ends, damping, drive, nu))  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "nu", "damping", "torque"),
    [
        ("circle", 1.0, 0.3, 0.0), ("circle", 2.0, 0.15, 0.0), ("circle", 0.4, 0.5, 0.0),
        ("well", 2.0, 0.3, 0.0), ("well", 1.5, 0.5, 0.0), ("well", 1.0, 0.3, -0.07),
        ("cubic", 0.7, 0.3, 0.0), ("cubic", 2.0, 0.15, 0.0), ("eight", 1.0, 0.15, 0.0),
        ("circle", 1.0, 0.1, 0.3),
    ],
)  # fmt: skip
def test_manifolds_meet_where_thresholds_hold_within_their_errors(name, nu, damping, torque):
    threshold, error, code, meet = threshold_of(name, damping, nu, torque)
    assert code == pk.Validity.HOLDS
    off = error + 0.01 * threshold
    assert not meet(threshold - off)
    assert meet(threshold + off)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "nu", "damping", "torque"),
    [
        ("circle", 2.0, 0.4, 0.0),
        ("eight", 2.0, 0.05, 0.0),  # next to a quiet frequency
        ("eight", 1.7, 0.04, 0.057),  # the torque tilts the loop, which then responds less
    ],
)
def test_strong_drives_move_thresholds_by_more_than_a_quarter(name, nu, damping, torque):
    threshold, _, code, meet = threshold_of(name, damping, nu, torque)
    assert code == pk.Validity.STRONG_DRIVE
    assert not meet(1.3 * threshold)


def test_no_threshold_holds_at_drives_to_which_no_loop_responds():
    driven = pk.Perturbed(
        pk.Pendulum(length=1.0, g=1.0), damping=0.1, forcing=pk.Harmonic(1.0, [20.0, 500.0])
    )
    ds = pk.melnikov(driven).sel(side="right", saddle="upper")
    assert np.isinf(ds.chaos_threshold.values).tolist() == [False, True]
    assert (ds.threshold_validity == pk.Validity.STRONG_DRIVE).all()


@pytest.mark.parametrize(("k", "size"), [(1e-4, 1e5), (1e3, 1e-6)])
def test_the_strength_of_a_drive_has_no_scale(k, size):
    def shares(k, size):
        own = {"k": k, "size": size}
        well = pk.Potential("k^2*(x^4/size^2/4 - x^2/2)", "x", own)
        damping = k * np.array([0.02, 0.2, 1.6])
        driven = pk.Perturbed(well, damping=damping, forcing=pk.Harmonic(1.0, 1.5 * k))
        ds = pk.melnikov(driven).isel(side=1, saddle=0)
        return (ds.chaos_threshold_error / ds.chaos_threshold).values, ds.threshold_validity.values

    (found, codes), (want, meant) = shares(k, size), shares(1.0, 1.0)
    np.testing.assert_allclose(found, want, rtol=1e-6)
    assert codes.tolist() == meant.tolist() == [1, 1, 7]
    assert want[0] < 1e-3


@pytest.mark.parametrize("system", [CIRCLE, WELL, PENDULUM, EIGHT])
@pytest.mark.parametrize("share", [0.9, 0.99])
def test_next_to_the_critical_torque_no_threshold_holds(system, share):
    """There W^u and W^s of the tilted saddle part by another energy than at first order."""
    critical = 2.0 / np.sqrt(27.0)
    if system is not WELL:
        critical = float(pk.critical_torque(system).critical_torque.sel(direction="plus"))
    torque = share * critical * np.array([-1.0, 1.0])
    ds = pk.melnikov(pk.Perturbed(system, damping=0.02, torque=torque, forcing=FORCED))
    assert np.isnan(ds.chaos_threshold).all()
    assert code(ds, "threshold_validity") <= {"TILTED", "NO_EQUILIBRIUM", "ABSENT"}
