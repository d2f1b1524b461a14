"""Critical values against root finding on the fold condition of the disk's own Lagrangian."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mpf
from witnesses import oracle

from phasekit.bifurcation.exact.critical import critical_disk, critical_reduced
from phasekit.errors import ParameterError
from phasekit.mechanics.disk import disk_coefficients
from phasekit.phase.exact.phase_space import equilibria

NAMES = ("beta", "e", "a", "r", "omega1", "g")
SLOTS = ("minus", "plus", "sign_change")


def disks(n: int, seed: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(seed)
    columns = {
        "beta": rng.uniform(0.02, np.pi / 2 - 0.02, n),
        "e": 10 ** rng.uniform(-2.5, -0.3, n),
        "a": rng.choice([-1, 1], n) * 10 ** rng.uniform(-3, -0.5, n),
        "r": 10 ** rng.uniform(-2, 0, n),
        "omega1": rng.choice([-1, 1], n) * 10 ** rng.uniform(0, 2, n),
        "g": rng.choice([9.81, -1.6, 0.0], n),
    }
    return [{name: float(columns[name][i]) for name in NAMES} for i in range(n)]


def check(got, want, tolerance, *context):
    assert (want is None) == bool(np.isnan(got)), (*context, got, want)
    if want is not None:
        off = abs(mpf(float(got)) - want)
        assert off <= tolerance, (*context, float(got), float(want), float(off), float(tolerance))


@pytest.mark.parametrize("case", oracle.cases("fold_beta"), ids=lambda case: case["id"])
def test_recorded_values(case):
    values = {name: float(text) for name, text in case["in"].items()}
    got = critical_disk("beta", beta=0.3, **values)
    for value, name in zip(got, ("beta_minus", "beta_plus", "beta_star"), strict=True):
        text = case["out"][name]
        check(value, None if text is None else mpf(text), mpf("1e-14"), name)


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["beta", "e", "a", "omega1"])
def test_random_disks(parameter):
    """Relative 1e-14 times the sensitivity to relative changes of the other parameters."""
    found = {slot: 0 for slot in SLOTS}
    for disk in disks(24, seed=NAMES.index(parameter)):
        if parameter == "a" and disk["g"] == 0:
            disk["g"] = 3.0
        given = {name: x for name, x in disk.items() if name != parameter}
        got = critical_disk(parameter, **disk)
        want = oracle.critical_disk(parameter, **given)
        if parameter in ("a", "omega1"):
            assert want["sign_change"] is None
        for slot, value in zip(SLOTS, got, strict=True):
            solution = want[slot]
            found[slot] += solution is not None
            tolerance = mpf(0)
            if solution is not None:
                tolerance = mpf("1e-14") * solution
                if abs(mpf(float(value)) - solution) > tolerance:  # costly, so only where needed
                    sensitivity = oracle.sensitivity(
                        lambda slot=slot, **x: oracle.critical_disk(parameter, **x)[slot], **given
                    )
                    tolerance *= min(sensitivity, mpf(10) ** 4)
            check(value, solution, tolerance, parameter, slot, disk)
    assert found["minus"] >= 3
    assert found["plus"] >= 3


@pytest.mark.parametrize("parameter", ["beta", "e", "a", "omega1"])
def test_count_changes_at_the_fold_and_sign_at_the_sign_change(parameter):
    """Across each value, at 1e-9 of it, the number of equilibria or the sign of A changes."""
    seen = 0
    for disk in disks(40, seed=100):
        for slot, value in zip(SLOTS, critical_disk(parameter, **disk), strict=True):
            if not value > 0 or (parameter == "beta" and value > 1.57):
                continue
            sides = [{**disk, parameter: float(value) * (1 + x)} for x in (-1e-9, 1e-9)]
            below, above = (disk_coefficients(**side) for side in sides)
            if slot == "sign_change":
                assert below[0] * above[0] < 0, disk
            else:
                assert np.sign(below[0]) == (-1 if slot == "minus" else 1), (slot, disk)
                counts = {int(equilibria(*x).n_equilibria) for x in (below, above)}
                assert counts == {2, 4}, (slot, disk)
            seen += 1
    assert seen > 10


def test_the_parameters_own_value_is_not_used():
    disk = disks(1, seed=4)[0]
    for parameter in ("beta", "e", "omega1", "a"):
        first = critical_disk(parameter, **disk)
        other = critical_disk(parameter, **{**disk, parameter: disk[parameter] * 1.5})
        assert np.array_equal(first, other, equal_nan=True), parameter


def test_no_fold_on_the_positive_side_where_the_axes_are_far():
    """beta_plus exists only for L <= e; at L = e it is pi/2."""
    given = {"beta": 0.3, "e": 0.1, "r": 0.3, "omega1": 7.0, "g": 0.0}
    assert np.isnan(critical_disk("beta", a=0.1001, **given)[1])
    assert abs(critical_disk("beta", a=0.1, **given)[1] - np.pi / 2) < 1e-15
    beta = float(critical_disk("beta", a=0.0999, **given)[1])
    sine, cosine = np.sin(beta), np.cos(beta)
    assert beta < np.pi / 2 - 0.01
    # 4 e s L = 4 e^2 s^2 - r^2 c^2 with L = a
    assert abs(0.4 * sine * 0.0999 - (0.04 * sine**2 - 0.09 * cosine**2)) < 1e-16
    for a in (0.1001, 0.1, 0.0999):
        minus, _, star = critical_disk("beta", a=a, **given)
        assert 0 < minus < star < np.pi / 2


def test_folds_meet_at_the_sign_change_without_gravity_and_distance():
    """With B = C = 0 the fold is A = 0."""
    given = {"r": 0.3, "omega1": 7.0, "g": 0.0, "a": 0.0}
    star = np.arctan(0.3 / 0.2)
    assert np.allclose(critical_disk("beta", beta=0.3, e=0.1, **given), star, rtol=1e-15)
    star = 0.3 * np.cos(0.4) / (2 * np.sin(0.4))
    assert np.allclose(critical_disk("e", beta=0.4, e=0.1, **given), star, rtol=1e-15)


def test_only_the_slot_of_the_sign_of_A_is_filled():
    rng = np.random.default_rng(3)
    filled = [0, 0]
    for disk in disks(60, seed=12):
        side = int(disk_coefficients(**disk)[0] > 0)
        for parameter in ("a", "omega1"):
            got = critical_disk(parameter, **disk)
            assert np.isnan(got[1 - side])
            assert np.isnan(got[2])
            filled[side] += not np.isnan(got[side])
        A, B, C = rng.normal(size=3)
        for parameter in ("lam", "psi"):
            got = critical_reduced(parameter, A, B, C)
            assert np.isnan(got[int(A < 0)])
            assert np.isnan(got[2])
    assert min(filled) > 3


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["lam", "psi"])
def test_reduced(parameter):
    rng = np.random.default_rng(9)
    found = 0
    for _ in range(40):
        A, B, C = (float(x) for x in rng.normal(size=3) * [2, 1, 1])
        got = critical_reduced(parameter, A, B, C)
        want = oracle.critical_reduced(parameter, A, B, C)
        for slot, value in zip(SLOTS, got, strict=True):
            solution = want[slot]
            # (1 - x^(2/3))^(3/2) at the double next to x = 1 is 1/x^(1/3) (1 - x^(2/3))^(-1) times
            # as sensitive
            other = abs((C if parameter == "lam" else B) / A)
            loss = 1 + (other ** (2 / 3) / (1 - other ** (2 / 3)) if other < 1 else 0)
            tolerance = mpf("1e-14") * mpf(loss) * (solution or 0)
            check(value, solution, tolerance, parameter, slot, A, B, C)
            found += solution is not None
    assert found > 10


def test_reduced_special_points():
    assert abs(critical_reduced("lam", 2.0, 0.3, 0.0)[1] - 1) < 1e-14
    assert abs(critical_reduced("psi", -2.0, 0.0, 0.3)[0] - 1) < 1e-14
    assert np.isnan(critical_reduced("lam", 2.0, 0.3, 2.1)).all()
    assert np.isnan(critical_reduced("lam", 0.0, 0.3, 0.1)).all()
    # 64/125: the exact fold (125, 27, 64)
    assert abs(critical_reduced("lam", 125.0, 1.0, 64.0)[1] - 27 / 125) < 2e-15
    assert abs(critical_reduced("psi", -125.0, -27.0, 0.0)[0] - 64 / 125) < 5e-15


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("parameter", ["beta", "e", "a", "omega1"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_invalid_cells_leave_the_others_untouched(parameter, bad):
    disk = {"beta": 0.3, "e": 0.1, "a": 0.02, "r": 0.2, "omega1": 8.0, "g": 9.81}
    alone = critical_disk(parameter, **disk)
    for name in NAMES:
        if name == parameter:
            continue
        both = critical_disk(parameter, **{**disk, name: np.array([disk[name], bad])})
        for got, want in zip(both, alone, strict=True):
            # NumPy's loops over arrays and its scalars may differ in the last bit.
            assert np.allclose(got[0], want, rtol=4e-16, atol=0, equal_nan=True), name
            # beta_star does not depend on a, omega1 and g; whatever is there must be a number
            assert np.isnan(got[1]) or np.isfinite(got[1]), name
        assert np.isnan(both[0][1]), name


def test_arguments_broadcast():
    got = critical_disk(
        "beta", beta=0.1, e=[[0.1], [0.2]], a=[0.0, 0.1, 0.2], r=0.2, omega1=9.0, g=9.81
    )
    assert [x.shape for x in got] == [(2, 3)] * 3
    want = critical_disk("beta", beta=0.1, e=0.2, a=0.1, r=0.2, omega1=9.0, g=9.81)
    assert np.array_equal([x[1, 1] for x in got], want, equal_nan=True)
    assert [x.shape for x in critical_reduced("lam", 2.0, [0.1, 0.2], 0.3)] == [(2,)] * 3


@pytest.mark.parametrize("scale", [1e-200, 1e-100, 1e200])
def test_reduced_values_do_not_depend_on_the_scale(scale):
    """(1 - 0.5^(2/3))^(3/2), by hand."""
    _, plus, _ = critical_reduced("lam", scale, 0.0, 0.5 * scale)
    assert abs(plus - (1.0 - 0.5 ** (2 / 3)) ** 1.5) < 1e-15


def test_unknown_parameters_are_refused():
    with pytest.raises(ParameterError, match="parameter: got 'speed'"):
        critical_disk("speed", beta=0.3, e=0.1, a=0.02, r=0.2, omega1=8.0)
    with pytest.raises(ParameterError, match="parameter: got 'phi'"):
        critical_reduced("phi", 1.0, 0.5, 0.5)
