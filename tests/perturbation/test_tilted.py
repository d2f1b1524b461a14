"""Separatrices under a constant torque, against quadratures and roots in many digits."""

import os

import mpmath
import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.phase.exact.under_torque import sine_excess

CELLS = int(os.environ.get("PHASEKIT_EDGES", "4"))


def cells(n, seed=4):
    A, B, C, N = (
        xr.DataArray(x, dims="cell") for x in np.random.default_rng(seed).normal(size=(4, n))
    )
    return pk.Perturbed(pk.Coefficients(A, B, C), torque=0.4 * N)


def height(A, B, C, N, start):
    """Energy of a saddle less the tilted potential, over the angle from it, in many digits."""
    A, B, C, N = (mpmath.mpf(float(x)) for x in (A, B, C, N))
    at = mpmath.findroot(
        lambda x: B * mpmath.sin(x) - A * mpmath.sin(2 * x) / 2 - C * mpmath.cos(x) - N, start
    )
    V = lambda x: -B * mpmath.cos(x) + A * mpmath.cos(x) ** 2 / 2 - C * mpmath.sin(x) - N * x  # noqa: E731
    return lambda x: V(at) - V(at + x)


def test_turning_points_and_areas():
    perturbed = cells(CELLS)
    ds, points = pk.separatrices(perturbed), pk.equilibria(perturbed)
    A, B, C = (x.values for x in perturbed.coefficients())
    found = 0
    for cell, saddle, side in np.argwhere(ds.loop.values[..., None] * np.ones(2) > 0):
        way = (-1, 1)[side]
        phi, offset, area, error = (
            ds[name].values[cell, saddle]
            for name in ("saddle_phi", "turning_offset", "lobe_area", "lobe_area_error")
        )
        with mpmath.workdps(20):
            depth = height(A[cell], B[cell], C[cell], perturbed.torque.values[cell], phi)
            steps = np.linspace(0.0, 2 * np.pi, 121)[1:]
            under = [x for x in steps if depth(way * x) < 0]
            if np.isinf(offset[side]):
                assert area[side] == np.inf
                assert not under
                continue
            assert np.sign(offset[side]) == way
            end = mpmath.findroot(depth, offset[side])
            size = 1.0 + sum(abs(x[cell]) for x in (A, B, C))
            slope = abs(mpmath.diff(depth, end))
            assert abs(end - offset[side]) < 4e-16 * (size / slope + 4.0 * abs(end))
            assert under[0] >= abs(offset[side]) > under[0] - steps[0]
            marks = np.mod(way * (points.phi.values[cell] - phi), 2 * np.pi)
            marks = sorted(float(way * x) for x in marks if 1e-9 < x < abs(end))
            want = mpmath.quad(lambda x, f=depth: 2 * mpmath.sqrt(2 * f(x)), [0, *marks, end])
        assert abs(abs(want) - area[side]) < max(3.0 * error[side], 1e-12)
        assert error[side] < 1e-8 * area[side]
        found += 1
    assert found >= CELLS // 2


def test_the_washboard():
    """Barrier 2 (sqrt(1 - i^2) - i arccos i), plasma frequency (1 - i^2)^(1/4)."""
    junction = pk.JosephsonJunction(plasma_frequency=2.0)
    i = np.array([0.01, 0.4, 0.9, 0.9999])
    biased = pk.Perturbed(junction, torque=4.0 * i)
    ds, points = pk.separatrices(biased), pk.equilibria(biased)
    upper = ds.sel(saddle="upper")
    barrier = upper.saddle_energy - points.energy.sel(equilibrium="lower_center")
    with mpmath.workdps(30):
        exact = [8 * (mpmath.sqrt(1 - x * x) - x * mpmath.acos(x)) for x in map(mpmath.mpf, i)]
    want = np.array(exact, float)
    assert barrier.values == pytest.approx(want, abs=1e-14)
    assert upper.saddle_exponent.values == pytest.approx(2.0 * (1.0 - i * i) ** 0.25, rel=1e-11)
    assert (upper.loop == pk.Loop.LOBE).all()
    assert (ds.topology == pk.Topology.HOMOCLINIC).all()
    assert np.isinf(upper.turning_offset.sel(side="right")).all()
    assert ds.energy_per_turn.values == pytest.approx(8.0 * np.pi * i)
    # next to the fold a cubic: area (36/5) barrier/omega, turning point 3 times as far
    rate = upper.saddle_exponent.values[-1]
    assert upper.lobe_area.values[-1, 0] == pytest.approx(7.2 * want[-1] / rate, rel=1e-3)
    assert upper.turning_offset.values[-1, 0] == pytest.approx(
        1.5 * -2.0 * np.arccos(i[-1]), rel=1e-3
    )
    mirrored = pk.separatrices(biased.replace(torque=-4.0 * i)).sel(saddle="upper")
    assert mirrored.lobe_area.sel(side="right").values == pytest.approx(
        upper.lobe_area.sel(side="left").values, rel=1e-12
    )


def test_a_small_torque_opens_the_eight_as_little():
    eight = pk.Coefficients(1.0, 0.35, 0.12)
    level, bent = (pk.separatrices(pk.Perturbed(eight, torque=x)) for x in (0.0, 1e-8))
    for name in pk.separatrices(eight):
        assert np.array_equal(level[name], pk.separatrices(eight)[name], equal_nan=True)
    assert bent.figure_eight
    assert bent.loop.values.tolist() == [pk.Loop.LOBES, pk.Loop.LOBE]
    lower = bent.sel(saddle="lower").lobe_area.values
    assert lower == pytest.approx(level.sel(saddle="lower").lobe_area.values, rel=1e-6)
    area = bent.sel(saddle="upper", side="left").lobe_area.item()
    assert area == pytest.approx(2.0 * level.sel(saddle="upper").winding_area.item(), rel=1e-3)


@pytest.mark.parametrize("less", [1e-6, 1e-10])
def test_next_to_a_fold_areas_are_as_good_as_their_errors(less):
    biased = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), torque=1.0 - less)
    found = pk.separatrices(biased).sel(saddle="upper", side="left")
    with mpmath.workdps(40):
        N = mpmath.mpf(1.0 - less)
        gap = 2 * mpmath.acos(N)  # from the saddle to the center
        at = mpmath.pi - mpmath.asin(N)
        depth = lambda x: mpmath.cos(at + x) - mpmath.cos(at) + N * x  # noqa: E731
        end = mpmath.findroot(depth, -1.5 * gap)
        want = abs(mpmath.quad(lambda x: 2 * mpmath.sqrt(2 * abs(depth(x))), [0, -gap, end]))
        off = abs(found.lobe_area.item() - want)
        assert off < found.lobe_area_error.item() < 1e-5 * want
        assert abs(found.turning_offset.item() - end) < 5e-16 / gap


@pytest.mark.parametrize("torque", [1e-9, -1e-14, 1e-17])
def test_a_small_torque_parts_two_saddles_as_little(torque):
    """Where V rises, a separatrix turns just before the other saddle, by sqrt(N)."""
    ds = pk.separatrices(pk.Perturbed(pk.Coefficients(-1.0, 0.35, 0.0), torque=torque))
    assert ds.loop.values.tolist() == [pk.Loop.LOBE, pk.Loop.LOBE]
    side, way = ("left", -1) if torque > 0 else ("right", 1)
    offsets = ds.turning_offset.sel(side=side).values
    with mpmath.workdps(60):
        A, B, N = map(mpmath.mpf, (-1.0, 0.35, torque))
        V = lambda x: -B * mpmath.cos(x) + A / 2 * mpmath.cos(x) ** 2 - N * x  # noqa: E731
        slope = lambda x: B * mpmath.sin(x) - A * mpmath.sin(2 * x) / 2 - N  # noqa: E731
        for start, offset in zip(ds.saddle_phi.values, offsets, strict=True):
            own, other = mpmath.findroot(slope, start), mpmath.findroot(slope, start + offset)
            gap = mpmath.sqrt(2 * (V(own) - V(other)) / mpmath.diff(slope, other))
            end = mpmath.findroot(lambda x, own=own: (V(own) - V(x)) / slope(x), other - way * gap)
            assert abs(end - own - offset) < 1e-15


@pytest.mark.parametrize("scale", [1e-200, 1e150])
def test_separatrices_do_not_depend_on_the_unit_of_energy(scale):
    values = np.array([1.0, 0.35, 0.12, 0.1])
    ds, want = (
        pk.separatrices(pk.Perturbed(pk.Coefficients(A, B, C), torque=N))
        for A, B, C, N in (scale * values, values)
    )
    assert want.loop.values.tolist() == [pk.Loop.LOBES, pk.Loop.LOBE]
    assert np.array_equal(ds.loop, want.loop)
    assert ds.turning_offset.values == pytest.approx(want.turning_offset.values, rel=1e-14)
    assert (ds.lobe_area / np.sqrt(scale)).values == pytest.approx(want.lobe_area.values, rel=1e-13)


def test_maps_and_refusals(tmp_path):
    pendulum = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0))
    ds = pk.sweep(
        pendulum, torque=[0.0, 0.3, 1.5, 1.0], of=["equilibria", "separatrices"],
        store=tmp_path / "map.zarr",
    )  # fmt: skip
    assert ds.loop.sel(saddle="upper").values.tolist() == [2, 4, 0, 0]
    assert ds.topology.values.tolist() == [1, 4, 0, 0]
    assert np.isnan(ds.turning_offset.sel(saddle="lower")).all()
    one = ds.sel(torque=0.3)
    assert one.phasekit.system() == pendulum.replace(torque=0.3)
    assert np.array_equal(
        one.lobe_area, pk.separatrices(one.phasekit.system()).lobe_area, equal_nan=True
    )
    with pytest.warns(pk.InvalidCellsWarning, match="torque: 1 of 2"):
        invalid = pk.separatrices(pendulum.replace(torque=[np.nan, 0.3]))
    assert invalid.topology.values.tolist() == [-1, 4]
    for more in ({"damping": 0.1}, {"damping": [0.0, 0.1]}, {"quadratic": 0.1}):
        with pytest.raises(pk.ParameterError, match="perturbed.system has"):
            pk.separatrices(pendulum.replace(torque=0.2, **more))


def test_sine_less_its_argument():
    x = np.array([1e-8, 0.3, 0.999, 1.001, -0.5, 6.0])
    with mpmath.workdps(40):
        want = [float(mpmath.sin(mpmath.mpf(v)) - mpmath.mpf(v)) for v in x]
    assert sine_excess(x) == pytest.approx(want, rel=1e-15)
