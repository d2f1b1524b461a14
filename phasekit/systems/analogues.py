"""The same equation in other guises: the papers' reduced form, particle, pendulum, magnet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from phasekit.constants import STANDARD_GRAVITY
from phasekit.labels.arguments import NumberLike
from phasekit.laws.terms import Rate
from phasekit.laws.trigonometric import Values, turn
from phasekit.systems.parameter import parameter
from phasekit.systems.system import System


def _particle_euler(v: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    """The Euler force of omega' on a particle, along the circle.

    The normal of the circle's plane points to the side to which omega turns its horizontal.
    """
    sine = turn(v["tilt"])[0]
    return sine, v["offset"] * sine / v["radius"], v["normal_offset"] / v["radius"]


class ParticleOnCircle(System):
    """Heavy particle on a circle that is carried round a vertical axis.

    The circle lies in a plane tilted from the vertical; phi is measured from its lowest point.

    Notes
    -----
    ``A = omega^2 cos^2 tilt``, ``B = (g/radius) cos tilt + omega^2 normal_offset sin tilt/radius``,
    ``C = omega^2 offset/radius``. With tilt 0 it is the disk at ``beta = pi/2`` with ``r = 0``,
    ``e = radius`` and ``a = offset``.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.ParticleOnCircle(radius=0.5, omega=2.0, g=10.0, offset=0.25).coefficients()
    Coefficients(A=4.0, B=20.0, C=2.0)
    """

    radius: NumberLike = parameter("m", "radius of the circle", positive=True)
    omega: NumberLike = parameter("s-1", "angular velocity about the vertical axis")
    tilt: NumberLike = parameter(
        "rad",
        "angle of the circle's plane from the vertical",
        default=0.0,
        low=-np.pi / 2,
        high=np.pi / 2,
    )
    offset: NumberLike = parameter(
        "m", "distance of the circle's center from the axis, in the plane", default=0.0
    )
    normal_offset: NumberLike = parameter(
        "m", "distance of the circle's center from the axis, square to the plane", default=0.0
    )
    g: NumberLike = parameter("m s-2", "acceleration of gravity", default=STANDARD_GRAVITY)

    frame_rate: ClassVar[Rate | None] = Rate("omega", _particle_euler)

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """The particle's law, as polynomials of its parameters."""
        sine, cosine, unit = v["tilt"]
        omega_sq = v["omega"] * v["omega"]
        return (
            v["radius"] * (omega_sq * (cosine * cosine)),
            (v["g"] * cosine + omega_sq * v["normal_offset"] * sine) * unit,
            omega_sq * v["offset"] * (unit * unit),
            v["radius"] * (unit * unit),
        )


class Pendulum(System):
    """Plane pendulum, ``phi'' + (g/length) sin phi = 0``.

    Parameters
    ----------
    length : float, 1-D array_like or xarray.DataArray
        Length in m, > 0; of a compound pendulum the reduced length.

    Notes
    -----
    ``A = C = 0``, ``B = g/length`` in the equation of [Veljovic2015] (12).

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.Pendulum(length=0.5, g=10.0).coefficients()
    Coefficients(A=0.0, B=20.0, C=0.0)
    """

    length: NumberLike = parameter("m", "length of the pendulum", positive=True)
    g: NumberLike = parameter("m s-2", "acceleration of gravity", default=STANDARD_GRAVITY)

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """Gravity alone."""
        return 0 * v["g"], v["g"], 0 * v["g"], v["length"]


class StonerWohlfarth(System):
    """Single-domain magnetic particle, ``V = K sin^2 phi - h_x cos phi - h_y sin phi``.

    phi is the angle of the magnetisation from the easy axis. Its switching astroid is the fold
    curve: four equilibria inside, two outside.

    Parameters
    ----------
    h_x, h_y : float or array_like
        Applied field along the easy axis and across it, times the magnetisation
        (``mu_0 M_s H``), of any sign.

    Notes
    -----
    ``A = -2 K``, ``B = h_x``, ``C = h_y``; V differs from phasekit's potential by the constant K.
    Like every potential here, K, h_x and h_y are per unit of inertia, in s^-2. Equilibria and
    topology depend on their ratios only: given as energy densities in J m^-3 they make the
    energies come out in J m^-3.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.StonerWohlfarth(K=2.0, h_x=1.0, h_y=0.5).coefficients()
    Coefficients(A=-4.0, B=1.0, C=0.5)
    """

    K: NumberLike = parameter("s-2", "constant of the uniaxial anisotropy")
    h_x: NumberLike = parameter("s-2", "field along the easy axis")
    h_y: NumberLike = parameter("s-2", "field across the easy axis")

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """Anisotropy and field."""
        return -2 * v["K"], v["h_x"], v["h_y"], 1
