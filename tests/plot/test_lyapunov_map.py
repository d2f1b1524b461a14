"""Orbit diagrams and maps of exponents: what they show is what was computed."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

LOGISTIC = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0, 1)})


def values(exponents, errors):
    attrs = {"long_name": "Lyapunov exponent", "units": "s-1"}
    data = {
        "lyapunov_exponent": (("a", "b", "exponent"), exponents, attrs),
        "lyapunov_error": (("a", "b", "exponent"), errors),
    }
    return xr.Dataset(data, {"a": [1.0, 2.0, 3.0], "b": [0.0, 1.0], "exponent": [1, 2]})


def test_a_map_hatches_what_is_within_its_error_of_zero(ax):
    first = np.array([[-1.0, -0.2], [0.1, 0.5], [0.01, np.nan]])
    ds = values(np.stack([first, first - 5.0], axis=-1), np.full((3, 2, 2), 0.05))
    pk.plot.lyapunov_map(ds, ax=ax)
    mesh, hatched = ax.collections
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), np.nan), first.T)
    assert mesh.norm(0.0) == pytest.approx(0.5)
    assert np.ma.getmaskarray(hatched.get_array()).tolist() == [
        [True, True, False],
        [True, True, True],
    ]
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["0 within its error", "absent"]
    # Lightness falls from below to above zero, in gray print as well.
    gray = mesh.cmap(np.linspace(0.0, 1.0, 256))[:, :3] @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(gray) < 1e-9).all()
    assert gray[127] - gray[128] > 0.15


def test_another_exponent_and_other_axes(ax):
    first = np.arange(6.0).reshape(3, 2)
    ds = values(np.stack([first, first - 20.0], axis=-1), np.zeros((3, 2, 2)))
    pk.plot.lyapunov_map(ds, 2, x="b", ax=ax)
    np.testing.assert_array_equal(ax.collections[0].get_array(), first - 20.0)
    with pytest.raises(pk.ParameterError, match="exponent: got 3, wants a number from 1 to 2"):
        pk.plot.lyapunov_map(ds, 3)
    with pytest.raises(pk.ParameterError, match="without 'lyapunov_exponent'"):
        pk.plot.lyapunov_map(ds.drop_vars("lyapunov_exponent"))


def test_a_diagram_shows_all_samples_by_their_direction(ax):
    r = np.array([2.5, 2.9, 3.2, 3.5, 3.2, 2.9])
    ds = pk.orbit_diagram(LOGISTIC, "r", r, n=8)
    pk.plot.orbit_diagram(ds, "sample_x", ax=ax)
    rising, falling = ax.get_lines()
    np.testing.assert_array_equal(rising.get_xdata(), np.repeat(r[:4], 8))
    np.testing.assert_array_equal(rising.get_ydata(), ds.sample_x.values[:4].ravel())
    np.testing.assert_array_equal(falling.get_ydata(), ds.sample_x.values[4:].ravel())
    assert rising.get_marker() != falling.get_marker()
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["$r$ rising", "$r$ falling"]
    with pytest.raises(pk.ParameterError, match="variable 'y' is unknown"):
        pk.plot.orbit_diagram(ds, "y")
    with pytest.raises(pk.ParameterError, match="without samples"):
        pk.plot.orbit_diagram(ds.drop_vars("sample_x"))
