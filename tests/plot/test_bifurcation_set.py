"""Pictures of bifurcation sets, of the atlas, and of the surface of equilibria."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import phasekit as pk
from phasekit.bifurcation.along import view_of
from phasekit.bifurcation.surface import equilibrium_surface
from phasekit.labelled.atlas import branches
from phasekit.labelled.bifurcation_set import bifurcation_set
from phasekit.plot.parts import style

DISK = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.012, r=0.2, omega1=31.4)
REDUCED = pk.Reduced(0.3, 0.1)


@pytest.fixture(scope="module")
def astroid():
    return bifurcation_set(REDUCED, "lam", "psi", xlim=(-1.5, 1.5), ylim=(-1.2, 1.2))


def texts(ax):
    return sorted(text.get_text() for text in ax.texts)


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_the_set_is_drawn_as_it_is(astroid, ax):
    assert pk.plot.bifurcation_set(astroid, ax=ax) is ax
    (fold,) = (line for line in ax.lines if line.get_label() == "fold, $A > 0$")
    x, y = fold.get_data()
    there = np.isfinite(x)
    assert np.cbrt(x[there]) ** 2 + np.cbrt(y[there]) ** 2 == pytest.approx(1.0, abs=1e-12)
    assert (ax.get_xlim(), ax.get_ylim()) == ((-1.5, 1.5), (-1.2, 1.2))
    assert texts(ax) == ["2", "4", "CP", "CP", "CP", "CP"]
    assert set(legend(ax)) == {
        "fold, $A > 0$",
        "saddles of equal energy",
        "centers of equal energy",
        "cusp",
    }


def test_regions_show_their_counts(astroid):
    ax = pk.plot.bifurcation_set(astroid)
    for text in ax.texts:
        if text.get_text() in "24":
            count = pk.equilibria(pk.Reduced(*text.get_position())).n_equilibria
            assert count == int(text.get_text())
    assert texts(pk.plot.bifurcation_set(astroid, counts=False)) == ["CP"] * 4


def test_angles_in_degrees():
    ds = bifurcation_set(DISK, "beta", "a", xlim=(0, np.pi / 2), ylim=(-0.1, 0.1))
    ax = pk.plot.bifurcation_set(ds, angles="deg", legend=False)
    assert ax.get_xlim() == (0.0, 90.0)
    assert ax.get_xlabel().endswith("(°)")
    assert ax.get_legend() is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dataset": 3}, "dataset: got 3"),
        ({"dataset": pk.equilibria(REDUCED)}, "without 'curve_kind'"),
        ({"counts": "yes"}, "counts: got 'yes'"),
        ({"angles": "grad"}, "angles: got 'grad'"),
        ({"ax": 3}, "ax: got 3"),
    ],
)
def test_bad_arguments(astroid, arguments, message):
    with pytest.raises(pk.ParameterError) as error:
        pk.plot.bifurcation_set(**{"dataset": astroid, **arguments})
    assert message in str(error.value)


def test_the_atlas_is_drawn_with_labelled_points():
    ds = branches(DISK, "beta", (0.0, np.pi))
    ax = pk.plot.bifurcation_diagram(ds, angles="deg")
    assert texts(ax) == ["LP"] * 4
    assert legend(ax) == ["center", "saddle", "fold"]
    (folds,) = (line.get_xydata() for line in ax.lines if line.get_label() == "fold")
    want = pk.critical(DISK, "beta").critical_fold.values / pk.deg
    assert np.sort(folds[:, 0]) == pytest.approx(np.sort([*want, *(180 - want)]), rel=1e-12)
    assert ax.get_xlim() == (0.0, 180.0)
    assert ax.get_ylim() == (-180.0, 180.0)


def test_curves_have_the_style_of_their_kind():
    ds = branches(pk.Coefficients(1.0, 0.5, 0.0), "B", (0.0, 2.0))
    ax = pk.plot.bifurcation_diagram(ds)
    assert "BP" in texts(ax)
    for code, name in ((1, "center"), (2, "saddle")):
        lines = [line for line in ax.lines if line.get_label() == name]
        assert {line.get_color() for line in lines} == {style.BRANCHES[code]["color"]}
        for line in lines:
            x, y = line.get_data()
            inside = np.isfinite(y) & (x > 1e-3) & (x < 2.0 - 1e-3) & (np.abs(x - 1) > 1e-3)
            bend = x * np.cos(y) - np.cos(2 * y)
            assert np.all((bend > 0)[inside] == (code == 1))


def test_the_atlas_of_another_quantity():
    ds = branches(DISK, "beta", (0.0, np.pi))
    ax = pk.plot.bifurcation_diagram(ds, y="energy")
    (folds,) = (line.get_xydata() for line in ax.lines if line.get_label() == "fold")
    A, B, C = DISK.replace(beta=folds[:, 0]).coefficients()
    phi = np.arctan2(-np.sign(A) * np.cbrt(C), np.sign(A) * np.cbrt(B)).values
    assert folds[:, 1] == pytest.approx(
        (-B * np.cos(phi) + A / 2 * np.cos(phi) ** 2 - C * np.sin(phi)).values, abs=1e-9
    )
    with pytest.raises(pk.ParameterError, match="did you mean 'energy'"):
        pk.plot.bifurcation_diagram(ds, y="energi")
    with pytest.raises(pk.ParameterError, match="x 'e' is unknown"):
        pk.plot.bifurcation_diagram(ds, x="e")


def test_the_surface_consists_of_equilibria():
    law, values = pk.Coefficients.trigonometric(), {"A": 1.0, "B": 0.0, "C": 0.0}
    force = view_of(law, values, ("B", "C"), ((0.0, 1.5), (-0.6, 0.6))).force
    x, y = np.linspace(0.0, 1.5, 31), np.linspace(-0.6, 0.6, 25)
    phi = np.linspace(-np.pi, np.pi, 61)
    centers, saddles = equilibrium_surface(force, x, y, phi)
    for triangles, sign in ((centers, 1), (saddles, -1)):
        B, C, angle = np.moveaxis(triangles[..., :3].mean(axis=1), -1, 0)
        slope = (B - np.cos(angle)) * np.sin(angle) - C * np.cos(angle)
        assert np.abs(slope).max() < 0.01
        bend = B * np.cos(angle) - np.cos(2 * angle) + C * np.sin(angle)
        assert np.mean(sign * bend > 0) > 0.99
    # Sheets over each point: as many as equilibria.
    rng = np.random.default_rng(0)
    corners = np.concatenate([centers, saddles])[..., :2]
    for point in rng.uniform((0.0, -0.6), (1.5, 0.6), (40, 2)):
        margin = pk.equilibria(pk.Coefficients(1.0, *point)).fold_margin.item()
        if abs(margin) > 0.05:
            (ax, ay), (bx, by), (cx, cy) = np.moveaxis(corners - point, (1, 2), (0, 1))
            areas = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
            over = (np.sign(areas[0]) == np.sign(areas[1])) & (
                np.sign(areas[1]) == np.sign(areas[2])
            )
            over &= np.abs(areas[0] + areas[1] + areas[2]) > 1e-12  # some are points
            assert over.sum() == (4 if margin > 0 else 2)


@pytest.mark.slow
def test_the_branch_surface():
    ax = pk.plot.branch_surface(
        DISK, "beta", "a", xlim=(0.5, np.pi / 2), ylim=(-0.05, 0.05), cells=10, angles="deg"
    )
    assert sum(isinstance(c, Poly3DCollection) for c in ax.collections) == 2
    assert {line.get_label() for line in ax.lines} == {"fold", "cusp"}
    assert ax.get_zlim() == (-180.0, 180.0)
    assert legend(ax) == ["center", "saddle", "fold", "cusp"]
    ax.figure.canvas.draw()


def test_the_surface_of_any_potential():
    """Over a line it reaches a little beyond its equilibria, here from the fold at m = 2."""
    well = pk.Potential("x^4/4 - m*x^2/2 + h*x", "x", {"m": 1.0, "h": 0.0})
    box = {"xlim": (-1.0, 2.0), "ylim": (-1.0, 1.0)}
    ax = pk.plot.branch_surface(well, "m", "h", **box, cells=8)
    assert {line.get_label() for line in ax.lines} == {"fold", "cusp"}
    assert ax.get_zlabel() == "$x$"
    ends = np.sort(np.roots([1.0, 0.0, -2.0, -1.0]).real)[[0, -1]]
    reach = max(ends)
    assert ax.get_zlim() == pytest.approx((-1.2 * reach, 1.2 * reach), rel=1e-6)
    with pytest.raises(pk.ParameterError, match="cut: got 1.0, wants None"):
        pk.plot.branch_surface(well, "m", "h", **box, cells=8, cut=1.0)


def test_the_picture_of_a_plane_of_any_potential():
    narrow = pk.Potential("x^4/4 - m*x^2/2 + h*x", "x", {"m": 1.0, "h": 0.0}, interval=(-1.2, 1.0))
    ds = pk.bifurcation_set(narrow, "m", "h", xlim=(-1.0, 2.0), ylim=(-1.0, 1.0))
    ax = pk.plot.bifurcation_set(ds)
    assert legend(ax) == ["fold", "leaves the interval", "centers of equal energy", "cusp"]


def test_the_surface_takes_axes_of_three_dimensions_only(ax):
    limits = {"xlim": (0.0, 1.0), "ylim": (0.0, 1.0)}
    solid = plt.figure().add_subplot(projection="3d")
    got = pk.plot.branch_surface(REDUCED, "lam", "psi", **limits, cells=6, ax=solid)
    assert got is solid
    with pytest.raises(pk.ParameterError, match="ax: got"):
        pk.plot.branch_surface(REDUCED, "lam", "psi", **limits, ax=ax)
    with pytest.raises(pk.ParameterError, match="cells: got 1000"):
        pk.plot.branch_surface(REDUCED, "lam", "psi", **limits, cells=1000)
