"""Parameter maps: codes by name, values with units, and the curves where they belong."""

import functools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.plot.parts import style

SQUARE = np.linspace(-1.5, 1.5, 61)
DISK = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.012, r=0.2, omega1=31.4)
BETA, A = np.linspace(0.0, np.pi / 2, 61), np.arange(-20, 21) * 3e-3


@functools.cache
def plane():
    """Map over lambda and psi."""
    return pk.sweep(pk.Reduced(0.1, 0.2), lam=SQUARE, psi=SQUARE)


@functools.cache
def disk_map():
    """Map over angle and distance of the disk."""
    return pk.sweep(DISK, beta=BETA, a=A)


@functools.cache
def branches():
    """Map of the branches of x' = mu + a x + c - x^3, which have folds where a > 0."""
    bent = pk.Problem(
        {"x": "mu + a*x + c - x^3"}, parameters={"mu": 0.0, "a": 1.0, "c": 0.0},
        window={"x": (-3.0, 3.0)},
    )  # fmt: skip
    of = ["branch_status", "special_points"]
    return pk.sweep(bent, a=[-1.0, 0.5], c=[-0.1, 0.1], of=of, along=("mu", (-1.0, 1.0)))


def bar(ax):
    """Return the Axes of the color bar."""
    return ax.collections[0].colorbar.ax


def paths(ax, number=0):
    """Return the vertices of a contour."""
    contours = [c for c in ax.collections if hasattr(c, "levels")]
    return np.concatenate([path.vertices for path in contours[number].get_paths()])


def names(ax):
    return [tick.get_text() for tick in bar(ax).get_yticklabels()]


def test_returns_the_given_axes(ax):
    assert pk.plot.parameter_map(plane(), ax=ax) is ax
    assert ax.get_xlabel().startswith(r"$\lambda$")
    assert ax.get_ylabel().startswith(r"$\psi$")


def test_topology_is_named_and_colored_by_code():
    ax = pk.plot.parameter_map(disk_map())
    assert names(ax) == ["winding", "figure eight", "heteroclinic"]
    assert bar(ax).get_ylabel() == "topology of the separatrices"
    mesh = ax.collections[0]
    drawn = mesh.get_array().reshape(A.size, BETA.size)
    codes = np.unique(disk_map().topology.values)
    np.testing.assert_array_equal(codes[drawn], disk_map().topology.values.T)


def test_maps_of_branches_are_drawn_without_a_name():
    ds = branches()
    assert ds.n_fold.values.tolist() == [[0, 0], [2, 2]]
    assert names(pk.plot.parameter_map(ds)) == names(pk.plot.parameter_map(ds, "n_fold"))


def test_a_code_keeps_its_color():
    few = pk.plot.parameter_map(disk_map().isel(beta=slice(0, 9), a=slice(0, 9)))
    many = pk.plot.parameter_map(disk_map())
    color = {}
    for ax in (few, many):
        mesh = ax.collections[0]
        for i, name in enumerate(names(ax)):
            color.setdefault(name, set()).add(mesh.cmap(mesh.norm(i)))
    assert len(color["figure eight"]) == 1
    assert len(set.union(*color.values())) == 3


@pytest.mark.parametrize(
    ("variable", "expected"),
    [("n_equilibria", ["2", "4"]), ("figure_eight", ["no", "yes"])],
)
def test_counts_and_yes_or_no(variable, expected):
    assert names(pk.plot.parameter_map(disk_map(), variable)) == expected


def test_kinds_of_one_label():
    ax = pk.plot.parameter_map(disk_map(), "kind", equilibrium="lower_saddle")
    assert names(ax) == ["absent", "saddle"]
    assert bar(ax).get_ylabel() == "kind of the equilibrium, lower saddle"


@pytest.mark.parametrize(
    ("variable", "selection", "expected"),
    [
        ("branch_status", {}, ["complete"]),
        ("special_kind", {"special_point": 0}, ["absent", "fold"]),
        ("special_status", {"special_point": 1}, ["absent", "converged"]),
    ],
)
def test_flags_of_branches_are_named(variable, selection, expected):
    ds = branches()
    assert names(pk.plot.parameter_map(ds, variable, legend=False, **selection)) == expected


def test_values_have_units_and_absent_cells_are_told():
    ax = pk.plot.parameter_map(disk_map(), "exponent", equilibrium="lower_saddle")
    assert (
        bar(ax).get_ylabel().replace("\n", " ") == "exponent of the saddle, lower saddle (s$^{-1}$)"
    )
    assert "absent" in [text.get_text() for text in ax.get_legend().get_texts()]
    mesh = ax.collections[0]
    expected = disk_map().exponent.sel(equilibrium="lower_saddle").values.T
    np.testing.assert_array_equal(mesh.get_array().mask.reshape(expected.shape), np.isnan(expected))


def test_a_pole_does_not_take_all_colors():
    ax = pk.plot.parameter_map(disk_map(), "fold_margin")
    mesh = ax.collections[0]
    low, high = mesh.get_clim()
    assert disk_map().fold_margin.min() < 2 * low < 0 < high < 1.01
    assert mesh.colorbar.extend == "min"
    assert (
        pk.plot.parameter_map(disk_map(), "winding_area", saddle="upper")
        .collections[0]
        .colorbar.extend
        == "neither"
    )


def test_infinite_cells_are_extremes_and_not_absent():
    ds = pk.sweep(pk.Coefficients(1.0, 0.3, 0.1), A=[-1.0, 0.0, 1.0], B=[0.2, 0.3, 0.4])
    assert np.isneginf(ds.fold_margin.values[1]).all()
    ax = pk.plot.parameter_map(ds, "fold_margin")
    assert not np.ma.getmaskarray(ax.collections[0].get_array()).any()
    assert np.isfinite(ax.collections[0].get_clim()).all()


def test_angles_in_degrees():
    ax = pk.plot.parameter_map(disk_map(), "phi", equilibrium="upper_saddle", angles="deg")
    assert bar(ax).get_ylabel().endswith("(°)")
    assert ax.get_xlabel().endswith("(°)")
    assert ax.get_xlim()[1] > 90.0
    assert np.abs(ax.collections[0].get_array()).max() > 90.0


def test_the_fold_curve_is_the_astroid():
    lam, psi = paths(pk.plot.parameter_map(plane())).T
    assert lam.size > 100
    distance = np.abs(np.cbrt(lam) ** 2 + np.cbrt(psi) ** 2 - 1.0)
    assert np.median(distance) < 0.01
    assert distance.max() < 0.3  # at the cusps, where cells are coarse


def test_the_fold_curve_of_the_disk_is_the_closed_form():
    beta, a = paths(pk.plot.parameter_map(disk_map())).T
    for x, y in list(zip(beta, a, strict=True))[::7]:
        folds = pk.critical(DISK.replace(a=float(y)), "beta").critical_fold.values
        assert np.nanmin(np.abs(folds - x)) < 0.03


def test_the_line_where_A_changes_sign():
    ax = pk.plot.parameter_map(disk_map())
    beta, _ = paths(ax, 1).T
    np.testing.assert_allclose(beta, pk.critical(DISK, "beta").critical_sign_change, atol=2e-3)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["fold", "$A = 0$"]


def test_a_bare_dataset_has_no_model_and_no_sign_change():
    bare = disk_map().drop_attrs(deep=False)
    ax = pk.plot.parameter_map(bare)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["fold"]
    only = pk.plot.parameter_map(bare[["topology"]])
    assert only.get_legend() is None


def test_axes_by_name():
    ax = pk.plot.parameter_map(disk_map(), x="a")
    assert ax.get_xlabel().startswith("$a$")
    assert ax.get_ylabel().startswith(r"$\beta$")
    np.testing.assert_allclose(
        np.sort(paths(ax)[:, 1]), np.sort(paths(pk.plot.parameter_map(disk_map()))[:, 0])
    )
    other = pk.plot.parameter_map(disk_map(), y="beta")
    assert other.get_xlabel() == ax.get_xlabel()


def test_a_cell_of_other_axes_by_the_nearest_value():
    cube = pk.sweep(DISK, beta=BETA[::6], a=A[::4], omega1=[10.0, 20.0, 30.0])
    ax = pk.plot.parameter_map(cube, "topology", omega1=19.0)
    drawn = ax.collections[0].get_array().reshape(A[::4].size, -1)
    codes = cube.topology.sel(omega1=20.0).values.T
    np.testing.assert_array_equal(np.unique(codes)[drawn], codes)


def test_invalid_cells_and_cells_without_force_are_named():
    ds = pk.sweep(pk.Coefficients(1.0, 0.0, 0.0), A=[0.0, 1.0, np.inf], B=[0.0, 0.5, 2.0])
    shown = names(pk.plot.parameter_map(ds.assign_coords(A=[0.0, 1.0, 2.0]), "n_equilibria"))
    assert shown[0] == "not valid"
    assert "none" in shown


@pytest.mark.parametrize(
    ("dataset", "options", "message"),
    [
        (lambda: None, {}, "^dataset: got None, wants a Dataset"),
        (
            disk_map,
            {"variable": "topologie"},
            "^variable 'topologie' is unknown; did you mean 'topology'",
        ),
        (disk_map, {"variable": "phi"}, "^variable: got phi .* equilibrium='lower_center'"),
        (lambda: disk_map().isel(a=0), {}, "^variable: got topology with the dims beta, wants two"),
        (lambda: disk_map().isel(a=0, beta=0), {}, "^variable: got topology with no dims"),
        (
            disk_map,
            {"variable": "phi", "equilibrium": "middle"},
            "^equilibrium: got 'middle', wants one of",
        ),
        (disk_map, {"saddle": "lower"}, "^dim of topology 'saddle' is unknown"),
        (disk_map, {"x": "gamma"}, "^x 'gamma' is unknown"),
        (disk_map, {"x": "a", "y": "a"}, "^y: got 'a'"),
        (disk_map, {"y": 3}, "^y 3 is unknown"),
        (disk_map, {"angles": 360}, "^angles: got 360"),
        (disk_map, {"ax": "here"}, "^ax: got 'here'"),
        (lambda: disk_map().isel(beta=[0]), {}, "^x: got .*, wants at least two"),
        (lambda: disk_map().isel(beta=[0, 2, 1]), {}, r"^x: got .*sortby\('beta'\)"),
    ],
)
def test_wrong_arguments_are_named(dataset, options, message):
    given = dataset()
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.parameter_map(given, **options)


def test_maps_in_grey_have_distinct_lightness():
    def lightness(color):
        return np.dot(plt.matplotlib.colors.to_rgb(color), (0.2126, 0.7152, 0.0722))

    for colors in (style.TOPOLOGY_COLORS, {k: style.COUNT_COLORS[k] for k in (-1, 0, 2, 4)}):
        levels = sorted(lightness(color) for color in colors.values())
        assert min(np.diff(levels)) > 0.02
    assert lightness(style.CODE_COLORS[0]) - lightness(style.CODE_COLORS[1]) > 0.2


def test_the_accessor_draws_the_same():
    cell = disk_map().sel(beta=1.4, a=0.012, method="nearest")
    ax = cell.phasekit.plot.phase_portrait()
    assert len(ax.lines) == len(pk.plot.phase_portrait(cell.phasekit.system()).lines)
    well, portrait = cell.phasekit.plot.potential_well()
    assert well.figure is portrait.figure
    assert disk_map().phasekit.plot.parameter_map("topology").get_xlabel()
    assert disk_map().isel(a=3).phasekit.plot.bifurcation_diagram().get_xlabel()
    assert isinstance(disk_map(), xr.Dataset)


@pytest.mark.parametrize("variable", [["topology"], {}, 3])
def test_a_variable_is_named_by_a_string(variable):
    with pytest.raises(pk.ParameterError, match="^variable .* is unknown; "):
        pk.plot.parameter_map(plane(), variable)
