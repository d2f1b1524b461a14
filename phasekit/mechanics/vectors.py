"""Vectors on the last axis: products, rotations, and checks of what is given as one.

Leading axes are a batch and broadcast. A single value that is unusable raises; inside a batch it
becomes NaN and leaves its neighbors alone.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.inputs import bad, is_labelled, reals
from phasekit.pickles import Stamped

#: The same where the shape is (..., 3), and where it is (...), of the batch.
Vectors: TypeAlias = Array
Numbers: TypeAlias = Array

#: Decorator: what overflows becomes infinite or NaN, without a warning.
quiet = np.errstate(all="ignore")

#: What counts as rounding, relative to the size of what was rounded.
ROUNDING = 32 * float(np.finfo(float).eps)


def dot(x: Array, y: Array) -> Array:
    """Scalar product.

    >>> float(dot(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 1.0])))
    5.0
    """
    return np.asarray(np.sum(x * y, axis=-1))[()]


def cross(x: Array, y: Array) -> Array:
    """Vector product.

    >>> cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])).tolist()
    [0.0, 0.0, 1.0]
    """
    return np.stack(
        [
            x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1],
            x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
            x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0],
        ],
        axis=-1,
    )


def times(number: npt.ArrayLike, x: Array) -> Array:
    """Vectors times numbers, one number a vector.

    >>> times([1.0, 2.0], np.array([1.0, 0.0, 3.0])).tolist()
    [[1.0, 0.0, 3.0], [2.0, 0.0, 6.0]]
    """
    return np.asarray(np.asarray(number)[..., None] * x)


def apply(tensor: Array, x: Array) -> Array:
    """Tensors (..., 3, 3) applied to vectors.

    >>> apply(np.diag([1.0, 2.0, 3.0]), np.ones(3)).tolist()
    [1.0, 2.0, 3.0]
    """
    return np.asarray(np.sum(tensor * x[..., None, :], axis=-1))


def unit(x: Array, floor: npt.ArrayLike = 0.0) -> Array:
    """Directions of vectors; NaN where the length is not above `floor`.

    >>> unit(np.array([[0.0, 3e-300, 4e-300], [0.0, 0.0, 0.0]])).round(9).tolist()
    [[0.0, 0.6, 0.8], [nan, nan, nan]]
    """
    _, exponent = np.frexp(np.max(np.abs(x), axis=-1))
    scaled = np.ldexp(x, -exponent[..., None])  # exact; squares neither overflow nor vanish
    length = np.sqrt(dot(scaled, scaled))
    long_enough = (length > 0.0) & (np.ldexp(length, exponent) > floor)
    return np.asarray(scaled / np.where(long_enough, length, np.nan)[..., None])


def rotation(n: Array, angle: npt.ArrayLike) -> Array:
    """Matrices of the right-handed rotation about the unit vector n, (..., 3, 3).

    >>> rotation(np.array([0.0, 0.0, 1.0]), np.pi / 2).round(12).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    angle = np.asarray(angle, dtype=float)[..., None, None]
    # The columns are the images of the axes: [n, e_k] and [n, [n, e_k]].
    once = np.swapaxes(cross(n[..., None, :], np.eye(3)), -1, -2)
    twice = np.swapaxes(cross(n[..., None, :], cross(n[..., None, :], np.eye(3))), -1, -2)
    return np.asarray(np.eye(3) + np.sin(angle) * once + 2.0 * np.sin(angle / 2.0) ** 2 * twice)


def plain(argument: str, value: Any, wants: str = "real numbers, an array_like") -> Array:
    """Return a new float64 array of real numbers, as `phasekit.inputs.reals` does."""
    if is_labelled(value):
        hint = (
            "dims pair by name in pk.rotators, pk.bearing_forces, pk.fixed_bearing_forces and "
            "pk.FreeGyroRotor; here give the numbers alone, .values, whose axes pair by place"
        )
        raise bad(argument, value, wants, hint)
    return reals(argument, value, wants)


def floats(**values: Any) -> list[Array]:
    """Return named values as float64 arrays, as `plain` does; what is one already is not copied.

    >>> [x.tolist() for x in floats(e=np.ma.array([0.1, 0.2], mask=[False, True]))]
    [[0.1, nan]]
    """
    return [
        value if type(value) is np.ndarray and value.dtype == np.float64 else plain(argument, value)
        for argument, value in values.items()
    ]


def broadcast(**values: Any) -> list[Array]:
    """Return named values as float64 arrays of one shape, to be read only."""
    arrays = floats(**values)
    common_shape(**{name: x.shape for name, x in zip(values, arrays, strict=True)})
    return list(np.broadcast_arrays(*arrays))


def numbers(argument: str, value: Any, wants: str = "a finite number or an array of them") -> Array:
    """Return numbers of any shape, as `tensors` does."""
    return tensors(argument, value, (), wants)


def vectors(argument: str, value: Any, wants: str = "three finite numbers, (..., 3)") -> Array:
    """Return vectors (..., 3), as `tensors` does."""
    return tensors(argument, value, (3,), wants)


def tensors(argument: str, value: Any, last: tuple[int, ...], wants: str) -> Array:
    """Return a float64 copy of what ends in the axes `last`.

    A single one must be finite; inside a batch the one that is not, or of which a number is
    masked, becomes NaN as a whole.
    """
    array = plain(argument, value, wants)
    if array.shape[array.ndim - len(last) :] != last:
        raise bad(argument, value, wants)
    own = tuple(range(-len(last), 0))
    finite = np.isfinite(array).all(axis=own, keepdims=True)
    if array.ndim == len(last) and not finite.all():
        raise bad(argument, value, wants)
    return np.where(finite, array, np.nan)


def directions(argument: str, value: Any) -> Array:
    """Return unit vectors (..., 3) along vectors of any length."""
    wants = "a direction: three finite numbers, not all zero, (..., 3)"
    along = unit(vectors(argument, value, wants))
    if along.ndim == 1 and np.isnan(along).any():
        raise bad(argument, value, wants)
    return along


def common_shape(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape that named batch shapes broadcast to."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise ParameterError(
            f"{listed}: got batch shapes that do not go together, wants shapes that broadcast"
        ) from None


def read_only(array: Array) -> Array:
    """Return the array, locked."""
    array.flags.writeable = False
    return array


class Frozen(Stamped):
    """Base of frozen dataclasses that hold arrays: compared by value, read-only when unpickled."""

    def __eq__(self, other: object) -> bool:
        """Whether it is of the same type with equal values; NaN equals NaN."""
        if type(self) is not type(other):
            return NotImplemented
        pairs = ((x, getattr(other, name)) for name, x in vars(self).items())
        return all(
            x == y if isinstance(x, Frozen) else np.array_equal(x, y, equal_nan=True)
            for x, y in pairs
        )

    def __hash__(self) -> int:
        """Hash of the values."""
        # 0.0 is added because -0.0 equals it
        keys = (
            x if isinstance(x, Frozen) else (np.shape(x), (np.asarray(x) + 0.0).tobytes())
            for x in vars(self).values()
        )
        return hash((type(self).__name__, *keys))

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled or copied one; its arrays are read-only again."""
        for name, value in state.items():
            kept = read_only(value) if isinstance(value, np.ndarray) else value
            object.__setattr__(self, name, kept)
