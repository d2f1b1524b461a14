"""Spectra of motions, labelled: amplitudes, densities, and harmonics of a known period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.errors import warn
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, number, one_of, unknown, whole
from phasekit.labels.grid import variable
from phasekit.motion import spectra

WINDOWS = ("hann", "hamming", "blackman", "flattop", "none")
KINDS = ("amplitude", "density")
MOTION = "motion_"
SOURCE = "[Harris1978]"
#: Harmonics that are computed unless a number is given.
MOST = 50


@call_checked
def spectrum(
    motion: xr.Dataset,
    variables: str | Sequence[str] | None = None,
    *,
    period: Any = None,
    harmonics: int | None = None,
    kind: str = "amplitude",
    window: str = "hann",
    parts: int = 8,
) -> xr.Dataset:
    """Spectrum of motions: which frequencies they are made of.

    Parameters
    ----------
    motion : xarray.Dataset
        What `flow` returns for times along ``time``, or a periodic orbit of `periodic_orbit` or
        ``branch.orbit(i)``. Motions over a swept parameter give a spectrum for each of its values.
        Leave out transients first: ``motion.sel(time=slice(100.0, None))``.
    variables : str or sequence of str, optional
        Names of states or observables; by default all that are there.
    period : float or xarray.DataArray, optional
        A period that the motions have, one number or one for each motion. Their harmonics are found
        exactly then, by least squares, whatever the times. An orbit has its own.
    harmonics : int, optional
        With a period the highest harmonic; by default 50, or fewer where the times are too far
        apart to tell them.
    kind : {"amplitude", "density"}
        Without a period: amplitudes and phases of cosines, for motions that repeat themselves or
        nearly; or the density of the variance over the frequency, for noise and chaos.
    window : {"hann", "hamming", "blackman", "flattop", "none"}
        What the samples are multiplied by, so that a frequency between those of the grid leaks to
        few others. "flattop" has amplitudes of lines to 0.1 %, "none" the narrowest lines.
    parts : int, default 8
        Of a density: how many parts the motion is cut into, beside those that lie half-way. More
        have a smaller error, and a coarser grid of frequencies.

    Returns
    -------
    xarray.Dataset
        On ``frequency`` (angular, over the unit of time): of each state x ``amplitude_x`` and
        ``phase_x`` in ``x = sum of amplitude cos(frequency t + phase)``, its mean at the
        frequency 0; or ``density_x``, whose integral over the frequency is the variance, and
        ``density_error_x``, its standard error. With a period on ``harmonic``, ``frequency``
        beside it, and ``rest_x``: the root mean square of what is no harmonic.

    Raises
    ------
    ParameterError
        If an argument is unusable, times are uneven without a period, or too few.

    Notes
    -----
    The discrete Fourier transform with a window [Harris1978]; densities are means over parts that
    overlap by half [Welch1967]. Of orbits of the continuation the coefficients
    ``(2/T) int x exp(-i k w t) dt`` are those of the piecewise polynomial that solves it.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> duffing = pk.Problem(
    ...     ["v", "F*cos(w*t) - 0.1*v - x - x^3"], ("x", "v"), {"F": 0.3, "w": 1.4},
    ...     time="t", period="2*pi/w", start={"x": 0.0, "v": 0.0},
    ... )
    >>> motion = pk.flow(duffing, t=np.arange(300.0, 400.0, 0.05))
    >>> lines = pk.spectrum(motion, "x", period=duffing.forcing_period)
    >>> first, third = lines.amplitude_x.sel(harmonic=[1, 3]).values
    >>> bool(first > 20.0 * third > 0.0), bool(lines.amplitude_x.sel(harmonic=2) < 1e-6)
    (True, True)
    """
    if not isinstance(motion, xr.Dataset) or "time" not in motion.dims:
        raise bad("motion", motion, "a Dataset of motions along the dim time, such as pk.flow's")
    one_of("kind", kind, KINDS)
    one_of("window", window, WINDOWS)
    found = _variables(motion, variables)
    if harmonics is not None:
        harmonics = whole("harmonics", harmonics, "a number of harmonics >= 1")
    orbit = "n_intervals" in motion and "period" in motion and period is None
    if orbit or period is not None:
        if kind != "amplitude":
            raise bad("kind", kind, "'amplitude' of a motion with a period")
        return _of_orbit(motion, found, harmonics) if orbit else _with_period(
            motion, found, period, harmonics
        )  # fmt: skip
    if harmonics is not None:
        raise bad("harmonics", harmonics, "None without a period")
    return _over_frequency(motion, found, kind, window, whole("parts", parts, "a number >= 1"))


def _variables(motion: xr.Dataset, variables: Any) -> dict[str, xr.DataArray]:
    """The variables by the names of what they are of."""
    along = {
        str(name).removeprefix(MOTION): values.transpose(..., "time")
        for name, values in motion.data_vars.items()
        if "time" in values.dims and values.dtype.kind == "f"
    }
    if variables is None:
        chosen = list(along)
    else:
        chosen = [variables] if isinstance(variables, str) else list(variables)
    names = [str(name).removeprefix(MOTION) for name in chosen]
    for name in names:
        if name not in along:
            raise unknown("variables: variable", name, along)
    if not names:
        raise bad("motion", list(map(str, motion.data_vars)), "numbers along the dim time")
    return {name: along[name] for name in names}


def _frequency_attrs(motion: xr.Dataset) -> dict[str, str]:
    """Those of angular frequencies, in the unit of time of a motion, which may have none."""
    clock = _clock(motion)
    return {"long_name": "angular frequency", "units": f"{clock}-1" if clock else "1"}


def _clock(motion: xr.Dataset) -> str:
    unit = str(motion["time"].attrs.get("units", ""))
    return "" if unit == "1" else unit


def _times(motion: xr.Dataset, least: int) -> Array:
    t = np.asarray(motion["time"].values, dtype=float)
    if t.size < least or not np.isfinite(t).all() or not np.all(np.diff(t) > 0.0):
        raise bad("motion", f"{t.size} times", f"at least {least} times that rise")
    return t


def _over_frequency(
    motion: xr.Dataset, found: dict[str, xr.DataArray], kind: str, window: str, parts: int
) -> xr.Dataset:
    t = _times(motion, 4)
    step = (t[-1] - t[0]) / (t.size - 1)
    if np.abs(t - (t[0] + step * np.arange(t.size))).max() > 1e-6 * step:
        hint = "or give the period that the motion has"
        raise bad("motion", "uneven times", "times at equal steps: np.linspace or np.arange", hint)
    data: dict[str, xr.Variable] = {}
    frequency = np.empty(0)
    for name, values in found.items():
        x, dims = np.asarray(values.values, float), tuple(map(str, values.dims[:-1]))
        units, text = values.attrs.get("units", "1"), name
        if kind == "amplitude":
            frequency, lines = spectra.amplitudes(x, t, spectra.window_of(window, t.size))
            data |= _lines(name, (*dims, "frequency"), lines, units, text)
            continue
        size = max(t.size // parts, 4)
        if t.size < 4 * parts:
            raise bad("parts", parts, f"at most {t.size // 4}, of {t.size} times")
        shape = spectra.window_of(window, size)
        frequency, density, count = spectra.density(x, step, shape)
        error = density / np.sqrt(spectra.effective_parts(count, shape))
        error[..., [0, -1] if size % 2 == 0 else [0]] *= np.sqrt(2.0)
        square = "" if units == "1" else f"({units})^2"
        per = f"{square} {_clock(motion)}".strip() or "1"
        for what, column, words in (
            ("density", density, f"density of the variance of {text}"),
            ("density_error", error, f"standard error of the density of {text}"),
        ):
            attrs = {"long_name": words, "units": per, "equation": "variance = int S dw"}
            data[f"{what}_{name}"] = variable(
                (*dims, "frequency"), column, {**attrs, "source": "[Welch1967]"}
            )
    axis = variable(("frequency",), frequency, _frequency_attrs(motion))
    return _dataset(motion, data, {"frequency": axis})


def _with_period(
    motion: xr.Dataset, found: dict[str, xr.DataArray], period: Any, harmonics: int | None
) -> xr.Dataset:
    t = _times(motion, 4)
    if isinstance(period, xr.DataArray):
        dims, periods = tuple(map(str, period.dims)), np.asarray(period.values, float)
    else:
        dims, periods = (), np.asarray(number("period", period, "a number > 0", _clock(motion)))
    if not np.all(periods > 0.0) or not np.isfinite(periods).all():
        raise bad("period", period, "a number > 0, or an array of them")
    gaps = float(np.diff(t).max())
    if t[-1] - t[0] + gaps < periods.max() * (1.0 - 1e-9):
        raise bad(
            "period", float(periods.max()), f"at most {t[-1] - t[0]:.6g}, the motion's length"
        )
    able = int((np.floor(periods.min() / gaps * (1.0 - 1e-12)) - 1) // 2)
    if able < 1 or (harmonics is not None and harmonics > able):
        asked = 1 if harmonics is None else harmonics
        raise bad("harmonics", asked, f"at most {able}: there are too few times in a period")
    most = min(able, MOST) if harmonics is None else harmonics
    data: dict[str, xr.Variable] = {}
    for name, values in found.items():
        own = tuple(map(str, values.dims[:-1]))
        if not set(dims) <= set(own):
            raise bad("period", list(dims), f"dims of the motion: {', '.join(own) or 'none'}")
        x = np.asarray(values.values, float)
        like = values.isel(time=0, drop=True)
        spread = xr.DataArray(periods, dims=dims).broadcast_like(like).transpose(*own)
        each = np.asarray(spread.values, float)
        lines = np.full((*x.shape[:-1], most + 1), np.nan + 0j)
        rest = np.full(x.shape[:-1], np.nan)
        for cell in np.ndindex(x.shape[:-1]):
            if np.isfinite(x[cell]).all():
                lines[cell], rest[cell] = spectra.harmonics(x[cell], t, float(each[cell]), most)
        data |= _lines(name, (*own, "harmonic"), lines, values.attrs.get("units", "1"), name)
        attrs = {
            "long_name": f"root mean square of what of {name} is no harmonic",
            "units": values.attrs.get("units", "1"),
        }
        data[f"rest_{name}"] = variable(own, rest, attrs)
    return _dataset(motion, data, _harmonic_axis(motion, periods, dims, most))


def _of_orbit(
    motion: xr.Dataset, found: dict[str, xr.DataArray], harmonics: int | None
) -> xr.Dataset:
    from phasekit.cycles.fourier import coefficients

    count, period = int(motion["n_intervals"]), float(motion["period"])
    t = np.asarray(motion["time"].values, float)
    degree, left = divmod(t.size - 1, count)
    if left or degree < 1:
        raise bad("motion", f"{t.size} times", f"the orbit whole: {count} intervals")
    mesh = (t[::degree] - t[0]) / period
    able = max(count * degree // 4, 1)
    if harmonics is not None and harmonics > able:
        raise bad("harmonics", harmonics, f"at most {able}, a quarter of the orbit's points")
    most = min(able, MOST) if harmonics is None else harmonics
    data: dict[str, xr.Variable] = {}
    for name, values in found.items():
        x = np.asarray(values.values, float)
        lines = coefficients(mesh, x - (x[-1] - x[0]) * (t - t[0]) / period, degree, most)
        lines = lines * np.exp(-2j * np.pi * np.arange(most + 1) * t[0] / period)
        data |= _lines(name, ("harmonic",), lines, values.attrs.get("units", "1"), name)
    return _dataset(motion, data, _harmonic_axis(motion, np.asarray(period), (), most))


def _harmonic_axis(
    motion: xr.Dataset, periods: Array, dims: tuple[str, ...], most: int
) -> dict[str, xr.Variable]:
    number = np.arange(most + 1)
    frequency = 2.0 * np.pi * number / periods[..., None]
    return {
        "harmonic": variable(("harmonic",), number, {"long_name": "number of the harmonic"}),
        "frequency": variable((*dims, "harmonic"), frequency, _frequency_attrs(motion)),
    }


def _lines(
    name: str, dims: tuple[str, ...], lines: Any, units: str, text: str
) -> dict[str, xr.Variable]:
    amplitude, phase = spectra.lines_of(lines)
    equation = f"{name} = sum a cos(w t + p)"
    about = {
        "amplitude": (amplitude, units, f"amplitude of {text}"),
        "phase": (phase, "rad", f"phase of {text}"),
    }
    return {
        f"{what}_{name}": variable(
            dims, column,
            {"long_name": words, "units": unit, "equation": equation, "source": SOURCE},
        )
        for what, (column, unit, words) in about.items()
    }  # fmt: skip


def _dataset(
    motion: xr.Dataset, data: dict[str, xr.Variable], coords: dict[str, xr.Variable]
) -> xr.Dataset:
    kept = {
        str(name): values.variable
        for name, values in motion.coords.items()
        if "time" not in values.dims and str(name) not in coords
    }
    ds = xr.Dataset(data, {**kept, **coords}, motion.attrs)
    first = next(iter(data.values()))
    lost = int(np.isnan(first.values).any(axis=-1).sum())
    if lost:
        warn(
            f"motion: {lost} of {int(np.prod(first.shape[:-1], dtype=int))} motions have NaN among "
            "their values; so has their spectrum",
            RuntimeWarning,
        )
    return ds
