"""Bifurcation diagrams: kinds by line style, folds where the closed form has them, no jumps."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgba

import phasekit as pk
from phasekit.plot.parts import style

LAM = np.linspace(-0.2, 1.5, 61)
PSI = 0.1
FOLD = (1.0 - PSI ** (2.0 / 3.0)) ** 1.5  # the astroid lam^(2/3) + psi^(2/3) = 1
DISK = pk.GyroRotorDisk(beta=np.linspace(0.0, np.pi / 2, 121), e=0.05, a=0.012, r=0.2, omega1=31.4)


def curves(ax, label):
    color = to_rgba(style.BRANCHES[{"center": 1, "saddle": 2}[label]]["color"])
    found = [line for line in ax.lines if line.get_label() == label]
    assert all(to_rgba(line.get_color()) == color for line in found)
    return found


def marks(ax, name):
    found = [line.get_xydata() for line in ax.lines if line.get_label() == name]
    return np.concatenate(found) if found else np.empty((0, 2))


def longest_step(ax):
    steps = [np.abs(np.diff(line.get_ydata())) for line in ax.lines if line.get_label() in KINDS]
    return max(np.nanmax(step) for step in steps if np.isfinite(step).any())


KINDS = ("center", "saddle")


def test_returns_the_given_axes(ax):
    assert pk.plot.bifurcation_diagram(pk.equilibria(pk.Reduced(LAM, PSI)), ax=ax) is ax
    assert ax.get_xlim() == (LAM[0], LAM[-1])
    assert ax.get_ylim() == (-np.pi, np.pi)
    assert ax.get_xlabel().startswith(r"$\lambda$")
    assert ax.get_ylabel() == "$\\varphi$, angle of the equilibrium (rad)"


def test_centers_are_solid_and_saddles_dashed():
    ax = pk.plot.bifurcation_diagram(pk.equilibria(pk.Reduced(LAM, PSI)))
    assert {line.get_linestyle() for line in curves(ax, "center")} == {"-"}
    assert {line.get_linestyle() for line in curves(ax, "saddle")} == {"--"}
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["center", "saddle", "fold"]


def test_the_curves_pass_through_the_equilibria():
    ds = pk.equilibria(pk.Reduced(LAM, PSI))
    ax = pk.plot.bifurcation_diagram(ds)
    for kind, label in ((1, "center"), (2, "saddle")):
        drawn = np.concatenate([line.get_xydata() for line in curves(ax, label)])
        for i, x in enumerate(LAM):
            for phi in ds.phi.values[i][ds.kind.values[i] == kind]:
                assert (
                    np.min(np.hypot(drawn[:, 0] - x, drawn[:, 1] - phi)[~np.isnan(drawn[:, 1])])
                    < 1e-12
                )


def test_a_fold_lies_where_the_closed_form_has_it():
    ax = pk.plot.bifurcation_diagram(pk.equilibria(pk.Reduced(LAM, PSI)))
    ((x, phi),) = marks(ax, "fold")
    assert x == pytest.approx(FOLD, abs=2e-3)
    # tan^3 phi = -psi / lam at the fold
    assert phi == pytest.approx(-np.arctan(np.cbrt(PSI / FOLD)), abs=2e-2)
    ends = [line.get_xydata()[-1] for label in KINDS for line in curves(ax, label)]
    assert sum(np.allclose(end, (x, phi)) for end in ends) == 2


def test_the_interpolation_is_of_second_order():
    errors = []
    for n in (41, 81, 161):
        ds = pk.equilibria(pk.Reduced(np.linspace(0.3, 1.1, n), PSI))
        ((x, _),) = marks(pk.plot.bifurcation_diagram(ds), "fold")
        errors.append(abs(x - FOLD))
    assert errors[2] < 1e-4
    assert errors[2] < 0.2 * max(errors)


def test_an_exact_fold_on_a_column():
    # 5^2 = 3^2 + 4^2: A = 125, B = 27, C = 64 lies on the fold.
    ds = pk.equilibria(pk.Coefficients(125.0, np.array([17.0, 22.0, 27.0, 32.0]), 64.0))
    assert ds.n_equilibria.values.tolist() == [4, 4, 3, 2]
    ax = pk.plot.bifurcation_diagram(ds)
    np.testing.assert_allclose(marks(ax, "fold"), [(27.0, ds.phi[2, 1].item())])


def test_both_folds_of_a_disk():
    ax = pk.plot.bifurcation_diagram(pk.equilibria(DISK), angles="deg")
    expected = pk.critical(DISK.replace(beta=0.3), "beta").critical_fold.values / pk.deg
    np.testing.assert_allclose(np.sort(marks(ax, "fold")[:, 0]), np.sort(expected), atol=0.02)
    assert ax.get_xlabel().endswith("(°)")
    assert longest_step(ax) < 30.0


def test_a_pitchfork_where_three_meet():
    ax = pk.plot.bifurcation_diagram(pk.equilibria(pk.Reduced(LAM, 0.0)))
    ((x, phi),) = marks(ax, "pitchfork")
    assert x == pytest.approx(1.0, abs=2e-3)
    assert phi == 0.0
    assert not marks(ax, "fold").size


def test_a_subcritical_pitchfork():
    # A < 0: two saddles and a center meet at the top, which is the bottom, too.
    ax = pk.plot.bifurcation_diagram(pk.equilibria(pk.Coefficients(-1.0, LAM, 0.0)))
    x, phi = marks(ax, "pitchfork").T
    np.testing.assert_allclose(x, [1.0, 1.0], atol=2e-3)
    np.testing.assert_allclose(np.sort(phi), [-np.pi, np.pi])


@pytest.mark.parametrize(
    "system",
    [
        pk.Reduced(0.3, np.linspace(-1.2, 1.2, 81)),  # labels change wells at psi = 0
        pk.Reduced(np.linspace(-1.2, 1.2, 81), 0.3),
        pk.Coefficients(np.linspace(-3.0, 3.0, 201), 0.9, 0.4),
        DISK.replace(a=-0.012),
        pk.Coefficients(0.4, -1.0, np.linspace(-1.0, 1.0, 41)),
    ],
)
def test_curves_never_jump(system):
    ax = pk.plot.bifurcation_diagram(pk.equilibria(system))
    assert longest_step(ax) < 0.6


def test_a_curve_that_crosses_the_seam_is_on_both_edges():
    C = np.linspace(-1.0, 1.0, 41)
    ax = pk.plot.bifurcation_diagram(pk.equilibria(pk.Coefficients(0.0, 1.0, C)))
    (saddle,) = curves(ax, "saddle")
    y = saddle.get_ydata()
    assert np.isnan(y).any()
    assert y[0] < np.pi
    assert np.nanmax(y) > np.pi
    assert np.nanmin(y) < -np.pi


def test_symmetric_loss_of_all_equilibria_breaks_the_curves():
    # Without B and C, centers and saddles change places at A = 0.
    ds = pk.equilibria(pk.Coefficients(np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), 0.0, 0.0))
    ax = pk.plot.bifurcation_diagram(ds)
    assert longest_step(ax) < 1e-9


def test_invalid_columns_are_gaps():
    beta = np.linspace(0.2, 1.2, 21)
    beta[8] = np.nan
    good = pk.equilibria(DISK.replace(beta=np.linspace(0.2, 1.2, 21)))
    holed = good.copy(deep=True)
    holed["phi"][8], holed["kind"][8], holed["fold_margin"][8] = np.nan, 0, np.nan
    before = len(pk.plot.bifurcation_diagram(good).lines)
    assert len(pk.plot.bifurcation_diagram(holed).lines) > before


@pytest.mark.parametrize("y", ["energy", "curvature", "natural_frequency", "exponent"])
def test_other_quantities(y):
    ds = pk.equilibria(pk.Reduced(LAM, PSI))
    ax = pk.plot.bifurcation_diagram(ds, y=y)
    drawn = np.concatenate([line.get_ydata() for line in ax.lines if line.get_label() in KINDS])
    for value in ds[y].values[np.isfinite(ds[y].values)]:
        assert np.nanmin(np.abs(drawn - value)) < 1e-9
    ((x, at),) = marks(ax, "fold")
    assert x == pytest.approx(FOLD, abs=2e-3)
    if y != "energy":
        assert at == pytest.approx(0.0, abs=0.1)
    unit = {"energy": "s$^{-2}$", "curvature": "s$^{-2}$"}.get(y, "s$^{-1}$")
    assert ax.get_ylabel().endswith(f"({unit})")


def test_from_a_sweep_with_a_selection_and_another_coordinate():
    disk = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.012, r=0.2, omega1=31.4)
    ds = pk.sweep(disk, beta=np.linspace(0.1, 1.5, 41), a=[0.0, 0.02])
    row = ds.isel(a=1)
    row = row.assign_coords(tilt=("beta", 90.0 - np.rad2deg(row.beta.values), {"units": "degree"}))
    ax = pk.plot.bifurcation_diagram(row, x="tilt")
    assert ax.get_xlabel() == "tilt (degree)"
    low, high = ax.get_xlim()
    assert low < high


def test_a_falling_parameter():
    rising = pk.equilibria(pk.Reduced(LAM, PSI))
    falling = rising.isel(lam=slice(None, None, -1))
    ((x, phi),) = marks(pk.plot.bifurcation_diagram(falling), "fold")
    ((x0, phi0),) = marks(pk.plot.bifurcation_diagram(rising), "fold")
    assert (x, phi) == (pytest.approx(x0), pytest.approx(phi0))


GOOD = pk.equilibria(pk.Reduced(LAM, PSI))


@pytest.mark.parametrize(
    ("dataset", "options", "message"),
    [
        (None, {}, "^dataset: got None, wants a Dataset"),
        (GOOD.phi, {}, "^dataset: got a DataArray"),
        (xr.Dataset(), {}, "^dataset: got a Dataset without 'phi'"),
        (pk.equilibria(pk.Reduced(0.1, 0.2)), {}, "^dataset: got a single system, wants one swept"),
        (
            pk.equilibria(pk.Reduced([0.1, 0.2], [0.3, 0.4])),
            {},
            "^x: got None, wants one of lam, psi",
        ),
        (pk.equilibria(pk.Reduced([0.1, 0.2], [0.3, 0.4])), {"x": "lam"}, r"isel\(psi=0\)"),
        (GOOD, {"x": "lambda"}, "^x 'lambda' is unknown"),
        (GOOD, {"x": 3}, "^x 3 is unknown"),
        (GOOD, {"x": "psi"}, "^x 'psi' is unknown"),
        (GOOD, {"y": "energie"}, "^y 'energie' is unknown; did you mean 'energy'"),
        (GOOD, {"y": "kind"}, "^y 'kind' is unknown"),
        (GOOD, {"y": "fold_margin"}, "^y 'fold_margin' is unknown"),
        (GOOD, {"angles": "grad"}, "^angles: got 'grad', wants 'rad' or 'deg'"),
        (GOOD, {"ax": plt}, "^ax: got"),
        (GOOD.isel(lam=[0]), {}, "^x: got .*, wants at least two"),
        (GOOD.isel(lam=[0, 2, 1]), {}, "^x: got .*sortby"),
    ],
)
def test_wrong_arguments_are_named(dataset, options, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.bifurcation_diagram(dataset, **options)
