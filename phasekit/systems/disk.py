"""The systems of the papers: the coefficients themselves, and the disk."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from phasekit.bifurcation.exact.critical import critical_disk
from phasekit.constants import STANDARD_GRAVITY
from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray, NumberLike, Value, bad
from phasekit.labels.grid import combine
from phasekit.laws.terms import Rate
from phasekit.laws.trigonometric import turn
from phasekit.mechanics.disk import disk_eccentricity, disk_inertia, disk_products, mixing
from phasekit.systems.parameter import Parameter, attrs_of, parameter
from phasekit.systems.system import System

INERTIA_NAMES = (
    "moment of inertia about u2",
    "moment of inertia about v2",
    "moment of inertia about n2",
    "deviation moment of v2 and n2",
)


def _euler(v: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    """The torque of omega1' on a disk, ``-kappa cos phi``: Lagrange's equations."""
    sine, cosine, _ = turn(v["beta"])
    return 0.0, 0.0, -mixing(v["r"], v["e"], sine, cosine)


def _eccentricity(e: FloatArray, beta: FloatArray) -> tuple[FloatArray]:
    return (disk_eccentricity(e, beta),)


class DiskInertia(NamedTuple):
    """Moments of inertia of the disk at O2, in kg m^2: about u2, v2, n2, and the deviation."""

    Ju: Any
    Jv: Any
    Jn: Any
    Jvn: Any


class GyroRotorDisk(System):
    """Heavy disk, skew and eccentric on its shaft, the shaft carried round the vertical.

    The disk turns by phi about a horizontal shaft, which itself is carried with the angular
    velocity omega1 about the vertical at the distance a. ``phi = 0``: the mass center hangs
    straight down; ``phi = +pi/2`` is outward for ``a > 0``.

    Parameters
    ----------
    beta : float, 1-D array_like or xarray.DataArray
        Angle between the shaft and the disk's plane, 0 to pi rad; pi/2: square to its shaft.
    e : float or array_like
        Distance of the mass center from the point O2 of the shaft, in m, >= 0. The true
        eccentricity, the distance from the shaft, is ``e sin beta``.
    r : float or array_like
        Radius of the disk in m, >= 0; with ``r = 0`` it is a particle.
    m : float or array_like, optional
        Mass in kg, > 0. Only moments of inertia and forces need it.
    half_span : float or array_like, optional
        Half the distance between the bearings of the shaft, in m, > 0. Only forces need it.

    Raises
    ------
    ParameterError
        If a scalar is unusable, or r and ``e sin beta`` are both zero. Inside arrays such cells
        give NaN.

    Notes
    -----
    Each parameter is a scalar, a 1-D array (an axis of its own name; two make an outer product)
    or a DataArray (broadcast by the names of its dims; a chunked one stays lazy).

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=2.518)
    >>> A, B, C = disk.coefficients()
    >>> bool(A < 0)
    True
    >>> try:
    ...     disk.replace(beta=30)
    ... except pk.ParameterError as error:
    ...     print(error)
    beta: got 30, wants a number from 0 to 3.14159 in radians; if it is in degrees: 30 * pk.deg
    """

    beta: NumberLike = parameter(
        "rad", "angle between the shaft and the disk's plane", low=0.0, high=np.pi
    )
    e: NumberLike = parameter("m", "distance of the mass center from O2", low=0.0)
    a: NumberLike = parameter("m", "distance of the shaft from the vertical axis")
    r: NumberLike = parameter("m", "radius of the disk", low=0.0)
    omega1: NumberLike = parameter("s-1", "angular velocity about the vertical axis")
    m: NumberLike | None = parameter("kg", "mass of the disk", default=None, positive=True)
    g: NumberLike = parameter("m s-2", "acceleration of gravity", default=STANDARD_GRAVITY)
    half_span: NumberLike | None = parameter(
        "m", "half the distance between the bearings of the shaft", default=None, positive=True
    )

    def check(self) -> None:
        """Refuse what is no body."""
        zero_e = isinstance(self.e, float) and self.e == 0.0
        zero_beta = isinstance(self.beta, float) and self.beta in (0.0, np.pi)
        if isinstance(self.r, float) and self.r == 0.0 and (zero_e or zero_beta):
            culprit = "e" if zero_e else "beta"
            raise ParameterError(
                f"r: got 0.0 together with {culprit} = {getattr(self, culprit)!r}, wants r > 0 or "
                "e sin(beta) > 0; with both zero nothing has inertia about the shaft"
            )

    products = staticmethod(disk_products)
    frame_rate: ClassVar[Rate | None] = Rate("omega1", _euler)
    critical_values: ClassVar[Mapping[str, Callable[..., Any]]] = {
        name: functools.partial(critical_disk, name) for name in ("beta", "e", "a", "omega1")
    }

    @property
    def eccentricity(self) -> Value:
        """Distance of the mass center from the shaft, ``e sin beta``, in m."""
        result = Parameter(name="eccentricity", units="m", long_name="distance from the shaft")
        value: Value = self._derived(_eccentricity, ("e", "beta"), [result])[0]
        return value

    @property
    def skew(self) -> Value:
        """Angle between the disk's normal and the shaft, ``pi/2 - beta``, in rad."""
        result = Parameter(name="skew", units="rad", long_name="angle of the normal to the shaft")
        value: Value = self._derived(lambda beta: (np.pi / 2 - beta,), ("beta",), [result])[0]
        return value

    def inertia(self) -> DiskInertia:
        """Moments of inertia at O2 in the disk's own frame, in kg m^2.

        Returns
        -------
        DiskInertia
            Ju, Jv, Jn about the axes u2, v2, n2, and the deviation moment Jvn; floats, or
            DataArrays where a parameter is an array.

        Raises
        ------
        ParameterError
            If the mass is not given.

        Notes
        -----
        [Veljovic2015] before (12), at the pole O2; the papers' formulas at the mass center hold
        only for e = 0.

        Examples
        --------
        >>> import phasekit as pk
        >>> flat = pk.GyroRotorDisk(beta=90 * pk.deg, e=0, a=0, r=0.2, omega1=0, m=3.0)
        >>> round(flat.inertia().Jn, 12)  # m r^2/2
        0.06
        """
        if self.m is None:
            raise bad("m", None, "a mass for the moments of inertia", "use disk.replace(m=...)")
        moments = [
            Parameter(name=name, units="kg m2", long_name=f"{what} at O2")
            for name, what in zip(DiskInertia._fields, INERTIA_NAMES, strict=True)
        ]
        return DiskInertia(*self._derived(disk_inertia, ("m", "r", "e", "beta"), moments))

    def _derived(
        self, function: Any, inputs: tuple[str, ...], results: list[Parameter]
    ) -> tuple[Any, ...]:
        """Apply an array function to parameters; NaN where one of them leaves its domain."""
        declared = {p.name: p for p in self.declared}

        def masked(*arrays: FloatArray) -> tuple[FloatArray, ...]:
            valid = [declared[n].valid(x) for n, x in zip(inputs, arrays, strict=True)]
            inside = functools.reduce(np.logical_and, valid)
            return tuple(np.where(inside, result, np.nan) for result in function(*arrays))

        values = {key: self.parameters[key] for key in inputs}
        attrs = attrs_of(*self.declared, *results)
        names = [result.name for result in results]
        return combine(masked, values, names, attrs, tuple(self.parameters))
