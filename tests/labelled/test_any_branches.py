"""Critical values and branches of any potential, against closed forms."""

import numpy as np
import pytest

import phasekit as pk
from phasekit.systems.system import MODELS

WELL = pk.Potential("x^4/4 - m*x^2/2 + h*x", "x", {"m": 1.0, "h": 0.0})
KIND = pk.MergerKind


class SpringHoop(pk.System):
    """Bead on a rotating hoop, held by a spring from above."""

    spin = pk.parameter("s-1", "angular velocity of the hoop", low=0.0, high=8.0)
    k = pk.parameter("s-2", "stiffness over mass", positive=True, default=10.0)
    free = pk.parameter("1", "natural length over radius", default=0.5)

    coordinate = pk.angle("theta")
    potential = "-9.81*cos(theta) - spin^2*sin(theta)^2/2 + k*(sqrt(5/4 - cos(theta)) - free)^2/2"


del MODELS["SpringHoop"]  # other tests count the systems


def kinds(ds):
    return [KIND(code).name for code in ds.critical_fold_kind.values.ravel() if code]


def special(ds):
    rows = (ds.special_kind.values, ds.special_value.values, ds.special_phi.values)
    return [(str(k), float(at), float(x)) for k, at, x in zip(*rows, strict=True) if k != "end"]


def test_a_hoop_with_a_spring():
    """The bead leaves the bottom where spin^2 = g + k (1/2 - free); the domain is the span."""
    free = np.array([0.2, 0.5, 0.7])
    found = pk.critical(SpringHoop(spin=1.0, free=free), "spin")
    wanted = np.sqrt(9.81 + 10.0 * (0.5 - free))[:, None]
    assert found.critical_fold.dims == ("free", "fold")
    assert (abs(found.critical_fold - wanted) <= found.critical_fold_error).all()
    assert found.critical_fold_error.max() < 1e-13
    assert kinds(found) == ["PITCHFORK"] * 3
    assert found.complete.all()
    assert found.critical_fold.attrs["units"] == "s-1"
    ds = pk.branches(SpringHoop(spin=1.0), "spin", (0.0, 8.0))
    assert ds.complete
    assert ds.sizes["branch"] == 3
    assert special(ds) == [("pitchfork", pytest.approx(9.81**0.5, rel=1e-14), 0.0)]
    np.testing.assert_array_equal(ds.theta, ds.phi)


def test_the_cusp():
    """Folds of m x - x^3 = h at m = 3 (h/2)^(2/3)."""
    h = np.array([-0.3, 0.1, 1.0])
    found = pk.critical(WELL.replace(h=h), "m", (-1.0, 2.0))
    np.testing.assert_allclose(
        found.critical_fold[:, 0], 3 * (np.abs(h) / 2) ** (2 / 3), rtol=1e-14
    )
    np.testing.assert_allclose(found.critical_fold_phi[:, 0], np.cbrt(h / 2), rtol=1e-14)
    assert kinds(found) == ["FOLD"] * 3
    hysteresis = pk.critical(WELL, "h", (-1.0, 1.0))
    np.testing.assert_allclose(hysteresis.critical_fold, [-2 / 27**0.5, 2 / 27**0.5], rtol=1e-14)
    ds = pk.branches(WELL, "h", (-1.0, 1.0))  # one branch that turns back twice
    assert ds.sizes["branch"] == 1
    assert ds.kind.values.min() > 0
    with pytest.warns(RuntimeWarning, match="there may be others"):
        through = pk.branches(WELL.replace(m=0.0), "h", (-1.0, 1.0))
    assert not through.complete
    assert through.attrs["completeness"].startswith("not complete")
    assert special(through) == [
        ("cusp", pytest.approx(0.0, abs=1e-12), pytest.approx(0.0, abs=1e-9))
    ]


@pytest.mark.parametrize(
    ("formula", "wanted", "branches"),
    [
        ("x^3/3 - m*x^2/2", [("transcritical", 0.0, 0.0)], 2),
        (
            "x^6/6 - x^4/2 + m*x^2/2",  # m = 2 x^2 - x^4
            [("pitchfork", 0.0, 0.0), ("fold", 1.0, -1.0), ("fold", 1.0, 1.0)],
            2,
        ),
        ("m*x^2/2 - x", [], 2),  # 1/m goes to infinity and comes back
        (
            "m*x^4/4 + x^3/3 - x",  # m = (1 - x^2)/x^3
            [("fold", -2 / 27**0.5, 3**0.5), ("fold", 2 / 27**0.5, -(3**0.5))],
            2,
        ),
    ],
)  # fmt: skip
def test_polynomials(formula, wanted, branches):
    ds = pk.branches(pk.Potential(formula, "x", {"m": 1.0}), "m", (-1.5, 1.6))
    assert ds.complete
    assert ds.sizes["branch"] == branches
    found = special(ds)
    assert [point[0] for point in found] == [point[0] for point in wanted]
    for one, other in zip(found, wanted, strict=True):
        assert one[1:] == pytest.approx(other[1:], rel=1e-14, abs=1e-15)


def test_branches_leave_an_interval_at_its_ends():
    narrow = pk.Potential("x^4/4 - m*x^2/2", "x", {"m": 1.0}, interval=(-0.8, 1.1))
    ds = pk.branches(narrow, "m", (-1.0, 2.0))
    rows = (ds.special_kind.values, ds.special_value.values, ds.special_phi.values)
    ends = [(at, x) for kind, at, x in zip(*rows, strict=True) if kind == "end"]
    assert (pytest.approx(0.64), -0.8) in ends
    assert (pytest.approx(1.21), 1.1) in ends
    assert kinds(pk.critical(narrow, "m", (-1.0, 2.0))) == ["PITCHFORK"]


def test_critical_torques_are_where_branches_end():
    """Under a torque: of the disk, whose extremes of the force are known exactly."""
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4)
    tilted = pk.Perturbed(disk, damping=0.1, torque=10.0)
    found = pk.critical(tilted, "torque", (-500.0, 500.0))
    ends = found.critical_fold.values[[0, -1]]
    np.testing.assert_allclose(ends, pk.critical_torque(disk).critical_torque, rtol=1e-13)
    ds = pk.branches(tilted, "torque", (-500.0, 500.0))
    assert ds.complete
    assert ds.closed.all()


def curves(ds, kind):
    """Vertices of the curves of a kind, both parameters and phi."""
    rows = ds.isel(curve=(ds.curve_kind == kind).values)
    names = (ds.attrs["x"], ds.attrs["y"], "phi")
    return [np.array([row[n].values[np.isfinite(row[ds.attrs["x"]])] for n in names])
            for row in (rows.isel(curve=i) for i in range(rows.sizes["curve"]))]  # fmt: skip


def test_the_cusp_in_the_plane():
    """4 m^3 = 27 h^2; both wells are as deep where h = 0."""
    ds = pk.bifurcation_set(WELL, "m", "h", xlim=(-1.0, 2.0), ylim=(-1.0, 1.0))
    assert ds.complete
    ((m, h, x),) = curves(ds, "fold")
    np.testing.assert_allclose(4 * m**3, 27 * h**2, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(x, np.cbrt(h / 2), rtol=1e-9, atol=1e-6)
    ((m, h, _),) = curves(ds, "equal_centers")
    assert abs(h).max() < 1e-12
    assert sorted(m[[0, -1]]) == [pytest.approx(0.0, abs=1e-12), 2.0]
    assert [str(like) for like in ds.cusp_like.values] == ["center"]
    np.testing.assert_allclose([ds.cusp_m, ds.cusp_h, ds.cusp_phi], 0.0, atol=1e-12)
    assert sorted(ds.region_count.values) == [1, 3]


def test_a_curve_that_no_net_of_lines_meets():
    """x^2 + m^2 + h^2 = r^2: equilibria on a sphere, which fold on a small circle."""
    sphere = pk.Potential(
        "x^3/3 + (m^2 + (h - 0.3)^2 - r^2)*x", "x", {"m": 0.0, "h": 0.0, "r": 0.003}
    )
    ds = pk.bifurcation_set(sphere, "m", "h", xlim=(-1.0, 1.0), ylim=(-1.0, 1.0))
    assert ds.complete
    ((m, h, x),) = curves(ds, "fold")
    np.testing.assert_allclose(np.hypot(m, h - 0.3), 0.003, rtol=1e-9)
    assert abs(x).max() < 1e-9
    assert ds.closed.all()


def test_symmetric_planes():
    """Of x (x^4 + b x^2 + m): folds b^2 = 4 m, pitchforks m = 0, equal depths 16 m = 3 b^2."""
    even = pk.Potential("x^6/6 + b*x^4/4 + m*x^2/2", "x", {"m": 0.0, "b": 0.0})
    with pytest.warns(RuntimeWarning, match="folds within .* of an equilibrium that rests are not"):
        ds = pk.bifurcation_set(even, "m", "b", xlim=(-1.0, 2.0), ylim=(-2.0, 1.0))
    assert not ds.complete
    ((m, b, _),) = curves(ds, "fold")
    np.testing.assert_allclose(b**2, 4 * m, rtol=1e-9, atol=1e-12)
    ((m, _, x),) = curves(ds, "pitchfork")
    assert (abs(m).max(), abs(x).max()) == (0.0, 0.0)
    ((m, b, _),) = curves(ds, "equal_centers")
    np.testing.assert_allclose(16 * m, 3 * b**2, rtol=1e-9, atol=1e-9)
    assert sorted(ds.region_count.values) == [1, 3, 5]
    hoop = pk.bifurcation_set(
        SpringHoop(spin=1.0), "spin", "free", xlim=(0.0, 8.0), ylim=(0.0, 0.9)
    )
    assert hoop.complete
    ((spin, free, _),) = curves(hoop, "pitchfork")
    np.testing.assert_allclose(spin**2, 9.81 + 10.0 * (0.5 - free), rtol=1e-12)
    assert sorted(hoop.region_count.values) == [2, 4]


def test_a_plane_with_a_torque():
    """The force of (A, B, C) less the torque, and its slope, vanish on folds."""
    base = pk.Coefficients(1.0, 0.3, 0.2)
    box = {"xlim": (-1.5, 1.5), "ylim": (-1.5, 1.5)}
    ds = pk.bifurcation_set(pk.Perturbed(base, torque=0.1), "B", "torque", **box)
    assert ds.complete
    assert ds.sizes["cusp"] == 2
    assert sorted(set(ds.region_count.values.tolist())) == [0, 2, 4]
    folds = curves(ds, "fold")
    assert len(folds) == 2
    for B, torque, phi in folds:
        force = (B - np.cos(phi)) * np.sin(phi) - 0.2 * np.cos(phi)
        np.testing.assert_allclose(force, torque, atol=1e-12)
        np.testing.assert_allclose(
            B * np.cos(phi) - np.cos(2 * phi) + 0.2 * np.sin(phi), 0.0, atol=1e-12
        )
    for i in range(ds.sizes["region"]):
        at = pk.Perturbed(base.replace(B=ds.region_B[i].item()), torque=ds.region_torque[i].item())
        assert pk.equilibria(at).n_equilibria == ds.region_count[i]


def test_equilibria_leave_an_interval_on_curves():
    narrow = pk.Potential("x^4/4 - m*x^2/2 + h*x", "x", {"m": 1.0, "h": 0.0}, interval=(-1.2, 1.0))
    ds = pk.bifurcation_set(narrow, "m", "h", xlim=(-1.0, 2.0), ylim=(-1.0, 1.0))
    assert ds.complete
    exits = curves(ds, "window_exit")
    assert sorted(x[0] for _, _, x in exits) == [-1.2, 1.0]
    for m, h, x in exits:
        np.testing.assert_allclose(x**3 - m * x + h, 0.0, atol=1e-14)


@pytest.mark.slow
def test_a_function_without_bounds_is_sampled():
    rough = pk.Potential("m*besselj(0.5, x) + x", "x", {"m": 1.0}, interval=(1.0, 4.0))
    with pytest.warns(RuntimeWarning, match="no bounds of besselj are known"):
        found = pk.critical(rough, "m", (1.9, 2.3))
    assert not found.complete
    assert kinds(found) == ["FOLD"]
    # The second derivative of sin(x)/sqrt(x) vanishes where tan x = 4 x/(3 - 4 x^2).
    x = found.critical_fold_phi.item()
    assert np.tan(x) == pytest.approx(4 * x / (3 - 4 * x * x), rel=1e-5)


def test_what_cannot_be_found_is_refused():
    with pytest.raises(pk.ParameterError, match="^span: got None, wants"):
        pk.critical(SpringHoop(spin=1.0), "free")
    with pytest.raises(pk.ParameterError, match="'torque' is unknown; valid are: spin, k, free"):
        pk.branches(SpringHoop(spin=1.0), "torque", (0.0, 1.0))
