"""Map of the bearing load: the colors are the greatest forces, found by stepping along loops."""

import functools

import numpy as np
import pytest
from witnesses import disk_forces

import phasekit as pk

BODY = {"e": 0.05, "r": 0.2, "omega1": 31.4, "m": 2.0, "g": 9.81, "half_span": 0.2}
DISK = pk.GyroRotorDisk(beta=1.0, a=0.0, **BODY)
BETA, A = np.linspace(0.3, 1.5, 9), np.linspace(-0.04, 0.05, 7)


@functools.cache
def disk_map():
    """Map over angle and distance of the disk."""
    return pk.sweep(DISK, beta=BETA, a=A)


@functools.cache
def loads():
    """The greatest forces on its separatrices."""
    return disk_map().phasekit.bearing_forces(on="separatrix")


def drawn(ax):
    """The values of the cells, (beta, a)."""
    return np.ma.filled(ax.collections[0].get_array(), np.nan).reshape(A.size, BETA.size).T


def words(ax):
    return ax.collections[0].colorbar.ax.get_ylabel().replace("\n", " ")


def test_returns_the_given_axes(ax):
    assert pk.plot.bearing_load_map(disk_map(), ax=ax) is ax
    assert words(ax) == (
        "greatest force in the bearing on the separatrix, larger of A$_2$ and B$_2$ (N)"
    )
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["fold", "$A = 0$"]


def test_the_load_is_the_greatest_on_any_separatrix():
    """Particles, at the energy of the highest saddle round the whole circle, both ways."""
    values = drawn(pk.plot.bearing_load_map(disk_map(), saddle="upper"))
    phi = np.linspace(-np.pi, np.pi, 4001)
    for i, k in ((0, 0), (4, 3), (8, 6), (7, 2)):
        disk = DISK.replace(beta=BETA[i], a=A[k])
        top = float(pk.separatrices(disk).saddle_energy.max())
        assert int(pk.separatrices(disk).loop.sel(saddle="upper")) == pk.Loop.WINDING
        potential = pk.potential(disk, phi).potential.values
        speed = np.sqrt(2.0 * np.maximum(top - potential, 0.0))
        particles = disk_forces.Disk(beta=BETA[i], a=A[k], **BODY)
        sizes = [particles.sizes(phi, sign * speed) for sign in (1.0, -1.0)]
        assert values[i, k] == pytest.approx(np.max(sizes), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("saddle", ["lower", "upper"])
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("bearing", ["A2", "B2"])
def test_a_saddle_a_side_a_bearing(saddle, side, bearing):
    options = {"saddle": saddle, "side": side, "bearing": bearing}
    ax = pk.plot.bearing_load_map(disk_map(), **options)
    np.testing.assert_array_equal(drawn(ax), loads().peak_force.sel(options))
    assert words(ax).endswith(f"{saddle} saddle, {side} side, {bearing[0]}$_2$ (N)")


def test_loads_are_taken_from_the_map_that_has_them():
    changed = loads().assign(peak_force=loads().peak_force * 2.0)
    np.testing.assert_array_equal(
        drawn(pk.plot.bearing_load_map(changed)),
        2.0 * loads().peak_force.max(["saddle", "side", "bearing"]),
    )
    one = loads().sel(saddle="upper", bearing="A2")
    np.testing.assert_array_equal(
        drawn(pk.plot.bearing_load_map(one, "rms_force", side="left")),
        loads().rms_force.sel(saddle="upper", bearing="A2", side="left"),
    )


def test_the_fold_curve_is_that_of_the_map():
    """Also on loads that were computed from a map, and do not hold the margins."""

    def fold(ax):
        contours = [c for c in ax.collections if hasattr(c, "levels")]
        return np.concatenate([path.vertices for path in contours[0].get_paths()])

    want = fold(pk.plot.parameter_map(disk_map(), "fold_margin"))
    for ds in (disk_map(), loads()):
        np.testing.assert_allclose(fold(pk.plot.bearing_load_map(ds)), want)


@pytest.mark.slow
def test_the_scale_is_logarithmic_where_loads_span_decades():
    scales = [
        type(pk.plot.bearing_load_map(ds, log=log).collections[0].norm).__name__
        for ds, log in ((disk_map(), None), (disk_map(), True), (disk_map(), False))
    ]
    assert scales == ["Normalize", "LogNorm", "Normalize"]
    wide = pk.sweep(DISK, omega1=np.geomspace(1.0, 300.0, 12), a=np.linspace(0.001, 0.02, 4))
    ax = pk.plot.bearing_load_map(wide)
    mesh = ax.collections[0]
    assert type(mesh.norm).__name__ == "LogNorm"
    load = wide.phasekit.bearing_forces(on="separatrix").peak_force
    np.testing.assert_allclose(
        np.ravel(mesh.get_array()), load.max(["saddle", "side", "bearing"]).values.T.ravel()
    )
    ticks = mesh.colorbar.ax.get_yticks()
    assert 3 <= ticks.size <= 9


def test_numbers_that_are_not_positive_are_absent_on_a_logarithmic_scale():
    signed = disk_map().assign(
        curved=disk_map().curvature.sel(equilibrium="upper_saddle") * [[1.0] + [-1.0] * 6]
    )
    ax = pk.plot.parameter_map(signed, "curved", log=True)
    mask = np.ma.getmaskarray(ax.collections[0].get_array()).reshape(A.size, BETA.size)
    assert not mask[1:].any()  # where -V'' > 0
    assert mask[0].all()
    assert "absent" in [text.get_text() for text in ax.get_legend().get_texts()]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dataset", "options", "message"),
    [
        (lambda: None, {}, "^dataset: got None"),
        (disk_map, {"variable": "peak"}, "^variable: got 'peak', wants one of peak_force"),
        (disk_map, {"bearing": "C2"}, "^bearing: got 'C2', wants one of larger, A2, B2"),
        (disk_map, {"saddle": 1}, "^saddle: got 1"),
        (disk_map, {"side": "both"}, "^side: got 'both'"),
        (lambda: disk_map().isel(a=0), {}, "^variable: got peak_force with the dims beta"),
        (
            lambda: pk.sweep(pk.Reduced(0.1, 0.2), lam=BETA, psi=A),
            {},
            "^dataset: got a map of Reduced",
        ),
        (lambda: pk.sweep(DISK.replace(m=None), beta=BETA, a=A), {}, "m"),
        (lambda: disk_map().drop_attrs(deep=False), {}, "^dataset: got"),
    ],
)
def test_wrong_arguments_are_named(dataset, options, message):
    given = dataset()
    with pytest.raises(pk.ParameterError, match=message):
        pk.plot.bearing_load_map(given, **options)


def test_the_accessor_draws_the_same():
    ax = disk_map().phasekit.plot.bearing_load_map("mean_force", side="left")
    want = pk.plot.bearing_load_map(disk_map(), "mean_force", side="left")
    np.testing.assert_array_equal(drawn(ax), drawn(want))
