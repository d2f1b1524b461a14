"""Spectra: of sums of cosines, of orbits with known series, and of noise with a known density."""

import pickle

import numpy as np
import pytest
import xarray as xr
from scipy.special import ellipk, ellipkm1

import phasekit as pk
from phasekit.motion import spectra

LINES = ((0.3, 0.0, 0.0), (2.0, 1.5, 0.4), (0.05, 4.5, -2.0))  # amplitude, frequency, phase


def motion(t, units="1", **coords):
    x = sum(a * np.cos(w * t + p) for a, w, p in LINES)
    attrs = {"units": units}
    return xr.Dataset({"motion_x": ("time", x, attrs)}, {"time": t, **coords})


@pytest.mark.parametrize("window", ["hann", "hamming", "blackman", "flattop", "none"])
@pytest.mark.parametrize("count", [400, 401])
def test_lines_on_the_grid_have_their_amplitudes_and_phases(window, count):
    t = 3.0 + 8 * np.pi * np.arange(count) / count / 1.5 * 3
    ds = pk.spectrum(motion(t, "m"), window=window)
    assert ds.amplitude_x.units == "m"
    for a, w, p in LINES:
        line = ds.sel(frequency=w, method="nearest")
        assert line.frequency.item() == pytest.approx(w, abs=1e-12)
        assert line.amplitude_x.item() == pytest.approx(a, abs=1e-12)
        if w:
            assert line.phase_x.item() == pytest.approx(p, abs=1e-9)
    rest = ds.amplitude_x.sel(frequency=slice(2.5, 3.6))
    assert float(rest.max()) < 1e-8 or window == "hamming"  # whose ends are not 0


def test_harmonics_of_a_period_are_exact_at_any_times():
    rng = np.random.default_rng(1)
    t = 5.0 + np.cumsum(rng.uniform(0.05, 0.2, 200))
    ds = pk.spectrum(motion(t), period=2 * np.pi / 1.5, harmonics=4)
    np.testing.assert_allclose(ds.frequency, 1.5 * np.arange(5))
    np.testing.assert_allclose(ds.amplitude_x, [0.3, 2.0, 0.0, 0.05, 0.0], atol=1e-13)
    np.testing.assert_allclose(ds.phase_x[[1, 3]], [0.4, -2.0], atol=1e-12)
    assert ds.rest_x < 1e-13
    off = pk.spectrum(motion(t), period=2 * np.pi / 1.4, harmonics=4)
    assert off.rest_x > 0.1


def test_periods_of_each_motion():
    """Of x'' + 0.1 x' + x = cos(w t) the response 1/(1 - w^2 + 0.1 i w)."""
    w = np.array([0.5, 1.0, 2.0])
    driven = pk.Problem(
        ["v", "cos(w*t) - 0.1*v - x"], ("x", "v"), {"w": w}, time="t", period="2*pi/w",
        start={"x": 0.0, "v": 0.0},
    )  # fmt: skip
    motions = pk.flow(driven, t=np.arange(500.0, 560.0, 0.1))
    ds = pk.spectrum(motions, "x", period=2 * np.pi / motions.w, harmonics=2)
    assert ds.amplitude_x.dims == ("w", "harmonic")
    response = 1.0 / (1.0 - w**2 + 0.1j * w)
    np.testing.assert_allclose(ds.amplitude_x[:, 1], np.abs(response), rtol=1e-8)
    np.testing.assert_allclose(ds.phase_x[:, 1], np.angle(response), rtol=1e-8)
    np.testing.assert_allclose(ds.frequency[:, 1], w)


def test_harmonics_of_an_orbit_of_duffing():
    """The motion x'' = -x^3 from x = 1: x = cn(t | 1/2), whose Fourier series is that of Jacobi."""
    duffing = pk.Problem.from_potential("k*x^4/4", "x", {"k": 1.0})
    K = ellipk(0.5)
    guess = np.linspace(0.0, 4 * K, 100, endpoint=False)
    x = np.cos(2 * np.pi * guess / (4 * K))
    samples = np.stack([x, -2 * np.pi / (4 * K) * np.sin(2 * np.pi * guess / (4 * K))], axis=1)
    orbit = pk.periodic_orbit(duffing, samples, period=4 * K)
    ds = pk.spectrum(orbit, "x", harmonics=5)
    q = np.exp(-np.pi * ellipkm1(0.5) / K)
    n = np.arange(3)
    series = 2 * np.pi / (np.sqrt(0.5) * K) * q ** (n + 0.5) / (1 + q ** (2 * n + 1))
    scale = 4 * K / orbit.period.item()  # orbits of other amplitudes a have the period 4 K/a
    np.testing.assert_allclose(ds.amplitude_x[1::2], scale * series, rtol=1e-7)
    np.testing.assert_allclose(ds.amplitude_x[::2], 0.0, atol=1e-9)


def test_harmonics_along_a_branch():
    """Of x'' + 0.1 x' + x = cos(w t): 1/(1 - w^2 + 0.1 i w), and nothing else."""
    driven = pk.Problem(
        ["v", "cos(w*t) - 0.1*v - x"], ("x", "v"), {"w": 0.6}, time="t", period="2*pi/w"
    )
    orbit = pk.periodic_orbit(driven, [0.0, 0.0])
    record = {
        "first": pk.fourier("x", 1),
        "square": pk.fourier("x^2", 2),
        "mean": pk.fourier("x", 0),
    }
    branch = pk.continuation(driven, "w", orbit=orbit, span=(0.6, 1.6), record=record)
    points = branch.points
    response = 1.0 / (1.0 - points.w**2 + 0.1j * points.w)
    np.testing.assert_allclose(points.first_amplitude, np.abs(response), rtol=1e-6)
    np.testing.assert_allclose(points.first_phase, np.angle(response), atol=1e-6)
    np.testing.assert_allclose(points.square_amplitude, np.abs(response) ** 2 / 2, rtol=1e-5)
    np.testing.assert_allclose(points.mean_amplitude, 0.0, atol=1e-7)
    one = pk.spectrum(branch.orbit(3), "x").amplitude_x
    assert one[1].item() == pytest.approx(points.first_amplitude[3].item(), rel=1e-9)
    with pytest.raises(pk.ParameterError, match="unknown symbol y"):
        pk.continuation(driven, "w", orbit=orbit, span=(0.6, 1.0), record={"y": pk.fourier("y", 1)})
    still = pk.Problem("l - x", "x", {"l": 0.0})
    with pytest.raises(pk.ParameterError, match="periodic orbits on equilibria"):
        pk.continuation(still, "l", span=(0.0, 1.0), record={"x1": pk.fourier("x", 1)})


@pytest.mark.slow
def test_formulas_are_recorded_of_orbits_branches_and_files(tmp_path):
    """Of the circle x = cos t, and of a line of equilibria; a file keeps formulas."""

    def raises(x, r):
        raise ZeroDivisionError("own")

    circle = pk.Problem(
        ["x*(r^2 - x^2 - y^2) - y", "y*(r^2 - x^2 - y^2) + x"], ("x", "y"), {"r": 1.5},
        observables={"energy": "(x^2 + y^2)/2"},
    )  # fmt: skip
    record = {"q": "x*y", "e": "energy/r", "x2": pk.fourier("x^2", 2), "f": raises}
    with pytest.warns(RuntimeWarning, match="record\\['f'\\]: raised ZeroDivisionError"):
        orbit = pk.periodic_orbit(circle, [1.0, 0.0], record=record)
    got = [orbit[n].item() for n in ("q_min", "q_max", "q_mean", "e_mean", "x2_amplitude")]
    np.testing.assert_allclose(got, [-1.125, 1.125, 0.0, 0.75, 1.125], atol=1e-8)
    assert np.isnan(orbit.f_mean)
    assert pk.periodic_orbit(circle, [1.0, 0.0], record="energy").energy_max.item() > 1.124
    del record["f"]
    branch = pk.continuation(circle, "r", orbit=orbit, span=(1.4, 1.6), record=record)
    np.testing.assert_allclose(branch.points.e_max, branch.points.r / 2, rtol=1e-7)
    branch.save(tmp_path / "branch.nc")
    assert pk.Branch.load(tmp_path / "branch.nc").points.identical(branch.points)
    rest = pk.Problem("l - x", "x", {"l": 0.0})
    line = pk.continuation(rest, "l", span=(0.0, 1.0), record={"q": "x^2 + l"}).points
    np.testing.assert_allclose(line.q, line.l**2 + line.l, atol=1e-12)
    with pytest.raises(pk.ParameterError, match="no observable"):
        pk.periodic_orbit(circle, [1.0, 0.0], record={"q": "z"})
    with pytest.raises(pk.ParameterError, match="names alone are observables"):
        pk.periodic_orbit(circle, [1.0, 0.0], record=[["energy"]])
    with pytest.raises(pk.ParameterError, match="have the shape"):
        pk.periodic_orbit(circle, [1.0, 0.0], record={"q": lambda x, r: x})


@pytest.mark.slow
def test_formulas_stand_for_functions_that_are_given_again(tmp_path):
    rest, path = pk.Problem("l - x", "x", {"l": 0.0}), tmp_path / "branch.nc"
    own = {"q": lambda x, l: x[0] ** 2 + l}  # noqa: E741
    branch = pk.continuation(rest, "l", span=(0.0, 1.0), record=own)
    branch.save(own_path := tmp_path / "own.nc")
    loaded = pk.Branch.load(own_path, record={"q": "x^2 + l"}).points
    np.testing.assert_allclose(loaded.q, branch.points.q, rtol=1e-14)
    branch = pk.continuation(rest, "l", span=(0.0, 1.0), record={"q": "x^2 + l"})
    assert pickle.loads(pickle.dumps(branch)) == branch
    branch.save(path, overwrite=True)
    assert pk.Branch.load(path) == branch
    for given, said in ((3, "a formula, or a function"), ("x + z", "unknown symbol z")):
        with pytest.raises(pk.ParameterError, match=said):
            pk.Branch.load(own_path, record={"q": given})
    with pytest.raises(pk.ParameterError, match="nothing of periodic orbits"):
        pk.Branch.load(own_path, record={"q": pk.fourier("x", 1)}).points  # noqa: B018


@pytest.mark.slow
def test_density_of_noise():
    """Of x' = -a x with noise s: s^2/(pi (a^2 + w^2))."""
    noisy = pk.Problem("-a*x", "x", {"a": 2.0}, noise={"x": 0.7})
    path = pk.flow(noisy, 0.0, np.arange(10.0, 1010.0, 0.05), paths=8, seed=1, step=0.05)
    ds = pk.spectrum(path, kind="density", parts=50)
    assert ds.density_x.dims == ("path", "frequency")
    assert ds.density_x.attrs["units"] == "1"
    mean = ds.density_x.mean("path")
    error = ds.density_error_x.mean("path") / np.sqrt(8)
    low = slice(1.0, 8.0)
    exact = 0.49 / (np.pi * (4.0 + ds.frequency**2))
    off = ((mean - exact) / error).sel(frequency=low)
    # The trapezoid in time folds what is above the highest frequency, and steps are finite: 1 %.
    assert abs(float(off.mean())) < 1.0
    assert 0.6 < float(off.std()) < 1.4
    total = ds.density_x.integrate("frequency")
    np.testing.assert_allclose(total, path.motion_x.var("time"), rtol=0.05)


def test_errors_of_densities_hold():
    """The spread over many series of white noise, of which all parts are known."""
    rng = np.random.default_rng(1)
    x = rng.standard_normal((2000, 1024))
    shape = spectra.window_of("hann", 128)
    _, density, count = spectra.density(x, 1.0, shape)
    assert count == 15
    np.testing.assert_allclose(density[:, 1:-1].mean(), 1.0 / np.pi, rtol=0.01)
    spread = density[:, 5:60].std(axis=0).mean() / density[:, 5:60].mean()
    assert spread * np.sqrt(spectra.effective_parts(count, shape)) == pytest.approx(1.0, abs=0.05)


def test_nan_and_coordinates():
    t = np.linspace(0.0, 10.0, 101)
    ds = motion(t, b=2.0).expand_dims(a=[1.0, 2.0]).copy(deep=True)
    ds.motion_x.values[1, -1] = np.nan
    with pytest.warns(RuntimeWarning, match="1 of 2 motions have NaN"):
        found = pk.spectrum(ds)
    assert found.b.item() == 2.0
    assert np.isnan(found.amplitude_x[1]).all()
    assert np.isfinite(found.amplitude_x[0]).all()


T = np.linspace(0.0, 10.0, 101)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: pk.spectrum(3), "motion: got 3"),
        (lambda: pk.spectrum(motion(T), "y"), "variable 'y' is unknown"),
        (lambda: pk.spectrum(motion(T**2)), "uneven times"),
        (lambda: pk.spectrum(motion(T[:3])), "at least 4 times"),
        (lambda: pk.spectrum(motion(T), window="boxcar"), "window: got 'boxcar'"),
        (lambda: pk.spectrum(motion(T), kind="power"), "kind: got 'power'"),
        (lambda: pk.spectrum(motion(T), kind="density", parts=50), "parts: got 50"),
        (lambda: pk.spectrum(motion(T), harmonics=3), "None without a period"),
        (lambda: pk.spectrum(motion(T), period=11.0), "at most 10, the motion's length"),
        (lambda: pk.spectrum(motion(T), period=0.15), "too few times in a period"),
        (lambda: pk.spectrum(motion(T), period=-1.0), "period: got -1"),
        (lambda: pk.spectrum(motion(T), period=1.0, kind="density"), "kind: got 'density'"),
    ],
)
def test_what_is_wrong_is_said(call, said):
    with pytest.raises(pk.ParameterError) as error:
        call()
    assert said in str(error.value)


def test_pictures():
    t = np.arange(0.0, 60.0, 0.1)
    ds = pk.spectrum(motion(t))
    ax = pk.plot.spectrum(ds, highest=10.0)
    assert ax.get_yscale() == "log"
    assert ax.get_xlim() == (0.0, 10.0)
    (line,) = ax.get_lines()
    assert line.get_xdata()[np.argmax(line.get_ydata())] == pytest.approx(1.5, abs=0.1)
    stems = pk.plot.spectrum(pk.spectrum(motion(t), period=2 * np.pi / 1.5), log=False)
    assert stems.get_lines()[0].get_ydata().max() == pytest.approx(2.0, abs=1e-9)
    several = xr.concat([motion(t), motion(1.1 * t).assign_coords(time=t)], "b").assign_coords(
        b=[0.0, 1.0]
    )
    ax = pk.plot.waterfall(pk.spectrum(several), highest=6.0)
    assert ax.get_ylabel() == "$b$" or "b" in ax.get_ylabel()
    assert len(pk.plot.spectrum(pk.spectrum(several)).get_lines()) == 2
    with pytest.raises(pk.ParameterError, match="wants one swept parameter"):
        pk.plot.waterfall(ds)
    with pytest.raises(pk.ParameterError, match="variable 'x' is unknown"):
        pk.plot.spectrum(ds, "x")


@pytest.mark.parametrize("clock", ["ms", ""])
def test_frequencies_have_the_unit_of_time(clock):
    """A turn in 2 pi units of time: its line at 1, whatever these are."""
    turning = pk.Problem({"x": "y", "y": "-x"})
    if clock:
        turning = turning.described({"time": {"units": clock}})
    motion = pk.flow(turning, x=1.0, y=0.0, t=np.linspace(0.0, 20.0 * np.pi, 401))
    inverse = f"{clock}-1" if clock else "1"
    for lines in (pk.spectrum(motion), pk.spectrum(motion, period=2.0 * np.pi)):
        assert lines.frequency.attrs["units"] == inverse
        assert lines.frequency[np.argmax(lines.amplitude_x.values)] == pytest.approx(1.0, rel=0.01)
        ax = pk.plot.spectrum(lines, highest=3.0)
        shown = ax.get_xlabel().removeprefix("angular frequency")
        assert shown == (f" ({clock}$^{{-1}}$)" if clock else "")
        ax.figure.clear()
    density = pk.spectrum(motion, kind="density").density_x
    assert density.attrs["units"] == (clock or "1")
