"""Rigid bodies by mass, center and inertia: made, shifted and rotated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.inputs import bad, call_checked
from phasekit.mechanics.disk import disk_eccentricity, disk_inertia
from phasekit.mechanics.general.mass_moments import MassMoments
from phasekit.mechanics.vectors import (
    apply,
    common_shape,
    dot,
    numbers,
    quiet,
    read_only,
    tensors,
    times,
    vectors,
)

#: Relative error up to which a tensor counts as symmetric, possible or orthogonal.
TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class RigidBody(MassMoments):
    """Rigid body, or a batch of them, by its mass, mass center and inertia at a pole.

    The mass moment vectors at the pole for an axis through it say how the body resists a
    rotation about that axis.

    Parameters
    ----------
    mass : float or array_like
        Mass in kg, > 0, shape (...).
    center : array_like
        Vector from the pole to the mass center in m, shape (..., 3).
    inertia : array_like
        Inertia tensor about the pole in kg m^2, shape (..., 3, 3), symmetric; its elements off
        the diagonal are ``-sum m x y``. The shapes broadcast.

    Raises
    ------
    ParameterError
        If a single value is not finite, a mass not positive, a tensor not symmetric, or a single
        body impossible: about the center, no principal moment exceeds the sum of the two others
        (up to 1e-12 of the tensor). In a batch such bodies become NaN.

    Notes
    -----
    Moments: [HedrihVeljovic2011] (2.1)-(2.6). ``n`` may have any length; batches of bodies and
    of vectors broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> from phasekit import RigidBody
    >>> body = RigidBody(2.0, [0.1, 0.0, 0.0], np.diag([0.1, 0.2, 0.25]))
    >>> body
    RigidBody(mass=2, center=[0.1, 0, 0], inertia=[[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.25]])
    >>> body.linear_moment([0, 0, 1]).tolist()
    [0.0, 0.2, 0.0]
    >>> float(body.axial_moment([0, 0, 3]))
    0.25
    """

    mass: Any
    center: Any
    inertia: Any

    def __post_init__(self) -> None:
        """Check the values and keep them as read-only arrays."""
        mass = numbers("mass", self.mass, "a number > 0 in kg, or an array of them")
        if mass.ndim == 0 and not mass > 0.0:
            raise bad("mass", self.mass, "a number > 0 in kg")
        center = vectors("center", self.center, "three finite numbers in m, (..., 3)")
        wants = "a symmetric tensor of finite numbers in kg m^2, (..., 3, 3)"
        inertia = tensors("inertia", self.inertia, (3, 3), wants)
        symmetric = _symmetric(inertia)
        if inertia.ndim == 2 and not symmetric:
            raise bad("inertia", self.inertia, wants)
        common_shape(mass=mass.shape, center=center.shape[:-1], inertia=inertia.shape[:-2])
        inertia = 0.5 * (inertia + np.swapaxes(inertia, -1, -2))
        with np.errstate(all="ignore"):  # beyond the largest double nothing is a body
            excess = _excess(mass, center, inertia)
        if excess.ndim == 0 and not excess <= TOLERANCE:
            wants = (
                "the tensor about the pole of a body of this mass and center; about the center "
                f"one principal moment exceeds the sum of the others (by {excess:.1e}, relative)"
            )
            raise bad("inertia", self.inertia, wants)
        self._keep(mass, center, inertia, symmetric & (mass > 0.0) & (excess <= TOLERANCE))

    def _keep(
        self, mass: Array, center: Array, inertia: Array, valid: npt.ArrayLike = True
    ) -> None:
        """Set the values, NaN where they are not a body."""
        shape = common_shape(mass=mass.shape, center=center.shape[:-1], inertia=inertia.shape[:-2])
        valid = np.asarray(valid & np.isfinite(mass) & np.isfinite(center).all(axis=-1))
        valid = valid & np.isfinite(inertia).all(axis=(-2, -1))
        mass = np.where(valid, np.broadcast_to(mass, shape), np.nan)
        object.__setattr__(self, "mass", read_only(mass) if shape else float(mass))
        object.__setattr__(self, "center", read_only(np.where(valid[..., None], center, np.nan)))
        inertia = np.where(valid[..., None, None], inertia, np.nan)
        object.__setattr__(self, "inertia", read_only(inertia))

    @classmethod
    def _make(cls, mass: Array, center: Array, inertia: Array, valid: npt.ArrayLike = True) -> Self:
        """Make a body of values that are right by construction up to rounding."""
        body = object.__new__(cls)
        body._keep(mass, center, inertia, valid)
        return body

    @classmethod
    @quiet
    def from_points(cls, masses: npt.ArrayLike, positions: npt.ArrayLike) -> Self:
        """Return the body that consists of particles.

        Parameters
        ----------
        masses : array_like
            Masses in kg, >= 0 and not all zero, shape (..., n).
        positions : array_like
            Positions from the pole in m, shape (..., n, 3).

        Returns
        -------
        RigidBody

        Raises
        ------
        ParameterError
            If the shapes do not go together, or the particles of a single body are unusable.

        Examples
        --------
        >>> RigidBody.from_points([1, 3], [[0, 0, 1], [0, 0, -1]])
        RigidBody(mass=4, center=[0, 0, -0.5], inertia=[[4, 0, 0], [0, 4, 0], [0, 0, 0]])
        """
        wants = "masses in kg, finite, >= 0 and not all zero, (..., n)"
        points = vectors("positions", positions, "positions in m, finite, (..., n, 3)")
        m = numbers("masses", masses, wants)
        if points.ndim < 2 or points.shape[-2] == 0:
            raise bad("positions", positions, "positions in m, finite, (..., n, 3)")
        if m.ndim == 0 or m.shape[-1] != points.shape[-2]:
            raise bad("masses", masses, f"one mass a position, n = {points.shape[-2]}")
        common_shape(masses=m.shape[:-1], positions=points.shape[:-2])
        total = np.asarray(m.sum(axis=-1))
        good = np.asarray((m >= 0.0).all(axis=-1) & (total > 0.0) & np.isfinite(total))
        if m.ndim == 1 and not good:
            raise bad("masses", masses, wants)
        if points.ndim == 2 and np.isnan(points).any():
            raise bad("positions", positions, "positions in m, finite, (..., n, 3)")
        center = times(1.0 / np.where(good, total, np.nan), (m[..., None] * points).sum(axis=-2))
        return cls._make(total, center, _steiner(m, points).sum(axis=-3), good)

    @classmethod
    @quiet
    def disk(
        cls, m: npt.ArrayLike, r: npt.ArrayLike, e: npt.ArrayLike, beta: npt.ArrayLike
    ) -> Self:
        """Return the thin disk that is skew and eccentric on its shaft, with O2 as the pole.

        The axes are those of the carrier, (u01, v01, n1) = (shaft, outward, up), at phi = 0,
        where the center hangs at ``e (cos beta, 0, -sin beta)``. So it is the disk for
        ``CoupledRotation(body, n1=(0, 0, 1), n2=(1, 0, 0), a=a)``.

        Parameters
        ----------
        m, r, e : float or array_like
            Mass > 0 in kg; radius and distance of the center from O2, both >= 0 in m.
        beta : float or array_like
            Angle between the shaft and the diameter through O2, 0 to pi rad.

        Returns
        -------
        RigidBody

        Raises
        ------
        ParameterError
            If a scalar is unusable. In arrays such disks become NaN.

        Examples
        --------
        >>> RigidBody.disk(2.0, 0.2, 0.1, np.pi / 2).axial_moment([1, 0, 0]).round(12).item()
        0.06
        """
        limits = {"m": "> 0 in kg", "r": ">= 0 in m", "e": ">= 0 in m", "beta": "0 to pi in rad"}
        kept = {}
        for name, value in {"m": m, "r": r, "e": e, "beta": beta}.items():
            kept[name] = numbers(name, value, f"a number {limits[name]}, or an array of them")
            if kept[name].ndim == 0 and not _inside(name, kept[name]):
                raise bad(name, value, f"a number {limits[name]}")
        shape = common_shape(**{name: value.shape for name, value in kept.items()})
        kept = {name: np.broadcast_to(value, shape) for name, value in kept.items()}
        valid = np.all([_inside(name, value) for name, value in kept.items()], axis=0)
        mass, r, e, beta = kept.values()
        ju, jv, jn, jvn = disk_inertia(mass, r, e, beta)
        zero = np.zeros_like(mass)
        center = np.stack([e * np.cos(beta), zero, -disk_eccentricity(e, beta)], axis=-1)
        # At phi = 0: u2 = v01, v2 = n1 and n2 = u01.
        rows = [[jn, zero, jvn], [zero, ju, zero], [jvn, zero, jv]]
        inertia = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        return cls._make(mass, center, inertia, valid)

    @quiet
    def shifted(self, vector: npt.ArrayLike) -> Self:
        """Return the body with another pole, at `vector` from this one, in m.

        The transfer of [HedrihVeljovic2011] (2.3), whose vector points from the new pole to the
        old one; to the mass center and from it, the theorem of Huygens and Steiner, (2.4).

        Parameters
        ----------
        vector : array_like
            Where the new pole lies from this one, in m, shape (..., 3).

        Returns
        -------
        RigidBody

        Examples
        --------
        >>> RigidBody.from_points([2.0], [[3.0, 0.0, 1.0]]).shifted([3, 0, 0])
        RigidBody(mass=2, center=[0, 0, 1], inertia=[[2, 0, 0], [0, 2, 0], [0, 0, 0]])
        """
        step = vectors("vector", vector, "three finite numbers in m, (..., 3)")
        common_shape(body=self.shape, vector=step.shape[:-1])
        center = self.center - step
        # m {c'^2 E - c' c'} - m {c^2 E - c c} without the squares that cancel
        change = -_product(self.mass, step, self.center + center)
        return self._make(np.asarray(self.mass), center, self.inertia + change)

    @quiet
    def centroidal(self) -> Self:
        """Return the body with its mass center as the pole.

        Returns
        -------
        RigidBody

        Examples
        --------
        >>> RigidBody.from_points([1.0, 1.0], [[1, 0, 0], [1, 2, 0]]).centroidal()
        RigidBody(mass=2, center=[0, 0, 0], inertia=[[2, 0, 0], [0, 0, 0], [0, 0, 2]])
        """
        return self.shifted(self.center)

    @quiet
    def rotated(self, matrix: npt.ArrayLike) -> Self:
        """Return the body turned about the pole, or mirrored.

        Parameters
        ----------
        matrix : array_like
            Orthogonal matrices (..., 3, 3); of determinant -1 they give mirror images.

        Returns
        -------
        RigidBody

        Raises
        ------
        ParameterError
            If a single matrix is not orthogonal up to 1e-12. In a batch such bodies become NaN.

        Examples
        --------
        >>> body = RigidBody.from_points([2.0], [[3.0, 0.0, 0.0]])
        >>> body.rotated([[0, -1, 0], [1, 0, 0], [0, 0, 1]]).center.tolist()
        [0.0, 3.0, 0.0]
        """
        wants = "an orthogonal matrix, (..., 3, 3)"
        turn = tensors("matrix", matrix, (3, 3), wants)
        across = np.swapaxes(turn, -1, -2)
        orthogonal = (np.abs(turn @ across - np.eye(3)) <= TOLERANCE).all(axis=(-2, -1))
        if turn.ndim == 2 and not orthogonal:
            raise bad("matrix", matrix, wants)
        common_shape(body=self.shape, matrix=turn.shape[:-2])
        center, inertia = apply(turn, self.center), turn @ self.inertia @ across
        inertia = 0.5 * (inertia + np.swapaxes(inertia, -1, -2))
        return self._make(np.asarray(self.mass), center, inertia, orthogonal)

    def __repr__(self) -> str:
        """Write a single body to six digits, a batch by its shape and masses."""
        if not self.shape:
            center, inertia = _brief(self.center), ", ".join(_brief(row) for row in self.inertia)
            return f"RigidBody(mass={self.mass:.6g}, center={center}, inertia=[{inertia}])"
        good = self.mass[np.isfinite(self.mass)]
        span = f"mass {good.min():.6g} to {good.max():.6g}" if good.size else "none valid"
        return f"RigidBody(<batch of shape {self.shape}, {span}>)"


RigidBody.__init__ = call_checked(RigidBody.__init__, "RigidBody")  # type: ignore[method-assign]


def _product(mass: npt.ArrayLike, x: Array, y: Array) -> Array:
    """Tensor ``m {(x, y) E - (x y + y x)/2}``, (..., 3, 3)."""
    outer = x[..., :, None] * y[..., None, :]
    both = 0.5 * (outer + np.swapaxes(outer, -1, -2))
    return np.asarray(mass)[..., None, None] * (dot(x, y)[..., None, None] * np.eye(3) - both)


def _steiner(mass: npt.ArrayLike, x: Array) -> Array:
    """Tensor of inertia of a particle at x."""
    return _product(mass, x, x)


def _symmetric(tensor: Array) -> npt.NDArray[np.bool_]:
    gap = np.abs(tensor - np.swapaxes(tensor, -1, -2)).max(axis=(-2, -1))
    return np.asarray(gap <= TOLERANCE * np.abs(tensor).max(axis=(-2, -1)))


def _excess(mass: Array, center: Array, inertia: Array) -> Array:
    """By how much a moment at the center exceeds the sum of the others, relative; NaN for NaN.

    The tensor ``sum m x x`` has no negative eigenvalue if, and only if, none does.
    """
    about_center = inertia - _steiner(mass, center)
    half_trace = 0.5 * np.trace(about_center, axis1=-2, axis2=-1)[..., None, None]
    spread = half_trace * np.eye(3) - about_center
    size = np.maximum(np.abs(np.trace(inertia, axis1=-2, axis2=-1)), mass * dot(center, center))
    finite = np.isfinite(spread).all(axis=(-2, -1))
    least = np.linalg.eigvalsh(np.where(finite[..., None, None], spread, 0.0))[..., 0]
    with np.errstate(invalid="ignore"):
        relative = np.where(size > 0.0, -2.0 * least / np.where(size > 0.0, size, 1.0), -least)
    return np.asarray(np.where(finite, relative, np.nan))


def _inside(name: str, value: Array) -> npt.NDArray[np.bool_]:
    """Whether a parameter of the disk lies in its domain."""
    low = value > 0.0 if name == "m" else value >= 0.0
    return np.asarray(low & (value <= np.pi) if name == "beta" else low)


def _brief(row: Array) -> str:
    return "[" + ", ".join(f"{x + 0.0:.6g}" for x in row) + "]"
