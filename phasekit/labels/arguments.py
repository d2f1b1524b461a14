"""What an argument may be, and the messages for what it may not.

Every message says which argument, what it got, what it wants, and what to do next. Parameters
and states share `numeric`; a parameter's own domain is checked where it is declared
(`phasekit.systems.system`). Names of states are none of the columns that a branch has.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias, TypeVar, Union, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.inputs import (
    SHOWN,
    FloatArray,
    bad,
    call_checked,
    describe,
    flag,
    one_of,
    reals,
    whole,
)  # fmt: skip
from phasekit.labels.units import factor, read_typed, si_unit
from phasekit.labels.units import number as typed
from phasekit.spellings import DEPRECATED, argument_meant, respelled

__all__ = ["FloatArray", "NumberLike", "Value", "bad", "brief", "call_checked", "describe"]
__all__ += [
    "flag",
    "numeric",
    "named",
    "number",
    "one_of",
    "pair",
    "reals",
    "same",
    "unknown",
    "variable_in_si",
    "whole",
]

# Not written with |, for which xarray, as yet a module to be loaded later, would be loaded.
#: What a user may pass for a number: a scalar, a 1-D list or array, or a DataArray.
NumberLike: TypeAlias = Union[float, Sequence[float], NDArray[Any], "xr.DataArray"]  # noqa: UP007
#: What is kept of it: a float, a read-only 1-D array, or a DataArray of float64.
Value: TypeAlias = Union[float, FloatArray, "xr.DataArray"]  # noqa: UP007

Function = TypeVar("Function", bound=Callable[..., Any])


#: Names that a message or a representation lists in full.
LISTED = 40


def list_names(names: Sequence[str]) -> str:
    """Write names one after the other, many by their ends."""
    if len(names) <= LISTED:
        return ", ".join(names)
    return f"{', '.join(names[:3])}, ..., {names[-1]}"


def unknown(what: str, name: object, valid: Iterable[str], listed: str = "") -> ParameterError:
    """Return the error for a name that is not one of `valid`, with the nearest of them.

    Where they are too many for a message, `listed` says what lists them.

    >>> print(unknown("axis", "bata", ["beta", "e"]))
    axis 'bata' is unknown; did you mean 'beta'? Valid are: beta, e
    """
    names = list(dict.fromkeys(valid))
    text = f"{what} {describe(name)} is unknown"
    near = argument_meant(name, names) if isinstance(name, str) else ""
    if listed:
        text += f"; did you mean {near!r}?" if near else ";"
        return ParameterError(f"{text} {listed} lists those that are valid")
    text += f"; did you mean {near!r}? Valid are: " if near else "; valid are: "
    return ParameterError(text + list_names(names))


#: What `numeric` takes.
WANTS = "a real number, a 1-D list or array of them, or a DataArray"


def named(what: str, name: Any, valid: Iterable[str]) -> str:
    """Return a name that is one of `valid`; otherwise raise what `unknown` returns."""
    names = list(valid)
    if not isinstance(name, str) or name not in names:
        raise unknown(what, name, names)
    return name


def numeric(argument: str, value: Any, units: str | None = "", wants: str = WANTS) -> Value:
    """Return `value` as a float, a read-only 1-D float64 array or a float64 DataArray.

    Numbers may be text with a unit, ``"40deg"``, or without, ``"pi/4"``. Bools, other text, None,
    complex numbers, dates, bare arrays of two and more dimensions and empty arrays are refused. A
    scalar must be finite; an array may hold NaN, infinity and masked values, which become invalid
    cells. A DataArray whose attribute ``units`` is not that which is wanted is converted; None
    wants any unit, in SI units; by default units do not matter.
    """
    if isinstance(value, xr.DataArray):
        return _data_array(argument, value, wants, units)
    if isinstance(value, (xr.Dataset, xr.Variable, Mapping)):
        hint = "name its dims in a DataArray" if isinstance(value, xr.Variable) else ""
        raise bad(argument, value, wants, hint or "name one variable of it")
    if isinstance(value, (list, tuple)) and xr.DataArray in set(map(type, value)):
        value = [_single(argument, item, units) for item in value]
    listed = isinstance(value, (list, tuple)) and str in set(map(type, value))
    if units != "" and (listed or isinstance(value, str)):
        value = _typed(argument, value, units or "1")
    array = reals(argument, value, wants)
    if array.ndim == 0:
        if not np.isfinite(array):
            raise bad(argument, value, "a finite number")
        return float(array)
    if array.ndim > 1:
        hint = f"name the dimensions: xr.DataArray({argument}, dims=(...))"
        raise bad(argument, value, wants, hint if wants is WANTS else "")
    if array.size == 0:
        raise bad(argument, value, "at least one value")
    array.flags.writeable = False
    return array


def _typed(argument: str, value: Any, units: str) -> Any:
    """Return numbers that are written as text; what is none is left to be refused."""
    if isinstance(value, str):
        return typed(argument, value, units) if read_typed(value) else value
    return [_typed(argument, item, units) if isinstance(item, str) else item for item in value]


def _single(argument: str, item: Any, units: str | None) -> Any:
    """Return an item of a list as a number; what is none is left to be refused."""
    if not isinstance(item, xr.DataArray) or item.ndim or item.dtype.kind not in "iuf":
        return item.values if isinstance(item, xr.DataArray) else item
    return float(_converted(argument, item.variable.astype(np.float64), units).values)


def _data_array(argument: str, value: xr.DataArray, wants: str, units: str | None) -> Value:
    if value.dtype.kind not in "iuf" or hasattr(value.variable._data, "magnitude"):
        raise bad(argument, value, wants)
    if value.size == 0:
        raise bad(argument, value, "at least one value")
    if not all(isinstance(dim, str) for dim in value.dims):
        raise bad(argument, value, "dims that are strings")
    if len(set(value.dims)) < value.ndim:
        raise bad(argument, value, "dims that differ")
    with np.errstate(over="ignore"):  # of numbers in extended precision
        kept = _converted(argument, value.variable.astype(np.float64), units)
    if value.ndim == 0:
        number = float(kept.values)
        if not np.isfinite(number):
            raise bad(argument, value, "a finite number")
        return number
    # Only the coordinates of its own dims travel on: others (the fixed parameters of the map
    # that it was taken from, say) would contradict the system that it is put into.
    coords: dict[Any, Any] = {
        dim: value.coords[dim] if own is held else own
        for dim in value.dims
        if _is_plain_axis(value, dim)
        for held in [value.coords[dim].variable]
        for own in [variable_in_si(str(dim), held)]
    }
    axis = value.coords.get(value.dims[0])
    if value.ndim == 1 and kept.chunks is None and value.dims[0] in coords and axis is not None:
        # An axis that is its own coordinate stays so in other units.
        if value.variable.equals(axis.variable):  # type: ignore[no-untyped-call]
            coords = {value.dims[0]: kept}
    return xr.DataArray(kept, coords=coords, name=argument)


def _converted(argument: str, value: xr.Variable, units: str | None) -> xr.Variable:
    """Return numbers in the unit that is wanted, from the one that their attributes name."""
    given = value.attrs.get("units", units)
    if given in (None, "", units) or units == "":
        return value
    times = factor(argument, given, units)
    # 1.153 mm divided by 1000 is rounded once.
    data = value.data / float(1 / times) if 1 / times % 1 == 0 else value.data * float(times)
    attrs = {key: item for key, item in value.attrs.items() if key != "units"}
    return xr.Variable(value.dims, data, attrs if units is None else {**attrs, "units": units})


def variable_in_si(argument: str, value: xr.Variable) -> xr.Variable:
    """Return numbers in SI units or radians; the variable itself where its unit is not known."""
    given = value.attrs.get("units")
    return (
        value
        if given is None or value.dtype.kind not in "iuf"
        else _converted(argument, value, si_unit(given) or given)
    )


def _is_plain_axis(value: xr.DataArray, dim: Any) -> bool:
    return dim in value.xindexes and len(value.xindexes.get_all_coords(dim)) == 1


def number(
    argument: str, value: Any, wants: str = "a finite number", units: str | None = ""
) -> float:
    """Return one finite number.

    >>> number("radius", 3)
    3.0
    """
    kept = numeric(argument, value, units, wants)
    if not isinstance(kept, float):
        raise bad(argument, value, wants)
    return kept


def pair(argument: str, value: Any, wants: str, units: str | None = "") -> tuple[float, float]:
    """Return two finite numbers.

    >>> pair("span", [0, 1.5], "two numbers")
    (0.0, 1.5)
    """
    if isinstance(value, (list, tuple)):
        if len(value) != 2:
            raise bad(argument, value, wants)
        first, second = (number(argument, end, wants, units) for end in value)
        return first, second
    if isinstance(value, str):
        raise bad(argument, value, wants)
    ends = np.asarray(numeric(argument, value, units, wants))
    if ends.shape != (2,) or not np.isfinite(ends).all():
        raise bad(argument, value, wants)
    return float(ends[0]), float(ends[1])


def same(left: Value | None, right: Value | None) -> bool:
    """Whether two kept values are equal: NaN equals NaN, dims and coordinates count.

    >>> same(np.array([1.0, np.nan]), np.array([1.0, np.nan])), same(1.0, np.array([1.0]))
    (True, False)
    """
    if isinstance(left, xr.DataArray) and isinstance(right, xr.DataArray):
        return bool(left.equals(right))
    if isinstance(left, np.ndarray) and isinstance(right, np.ndarray):
        return np.array_equal(left, right, equal_nan=True)
    if isinstance(left, (xr.DataArray, np.ndarray)) or isinstance(
        right, (xr.DataArray, np.ndarray)
    ):
        return False
    return left == right


def brief(value: Value) -> str:
    """Write a kept value for a representation: short arrays in full, long ones by their ends."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, np.ndarray):
        if value.size <= SHOWN:
            return repr(value.tolist())
        return f"<{value.size} values, {value[0]:.6g} to {value[-1]:.6g}>"
    sizes = ", ".join(f"{dim}: {size}" for dim, size in value.sizes.items())
    return f"<{'lazy ' if value.chunks is not None else ''}DataArray ({sizes})>"


def state_arguments(function: Function) -> Function:
    """Let a function take the parts of a state by any name that they have anywhere.

    An angle is ``phi`` where it is a state, ``phi0`` where a motion starts there, ``state_phi`` as
    the coordinate of results, and has the name of the coordinate in a system that names it; so are
    its rates. The first argument is the system, or an accessor.
    """
    function = call_checked(function)
    former = DEPRECATED.get(function.__name__, {})
    first, *_ = order = list(inspect.signature(function).parameters)
    own = {name.rstrip("0"): name for name in order}
    own = {stem: name for stem, name in own.items() if stem in ("phi", "dphi", "ddphi")}
    other = {
        alias: name
        for stem, name in own.items()
        for alias in (stem, f"{stem}0", f"state_{stem}")
        if alias != name
    }

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        if not former.keys().isdisjoint(kwargs):
            kwargs = respelled(function.__name__, kwargs)
        if first in kwargs and not args:
            args = (kwargs.pop(first),)
        # A system with states of its own takes them by their names.
        own_states = () if not args else getattr(args[0], "state", getattr(args[0], "states", ()))
        names = {name: to for name, to in other.items() if name not in own_states}
        coordinate = getattr(args[0], "coordinate", None) if args else None
        if isinstance(coordinate, str):
            spelled = {stem.replace("phi", coordinate): name for stem, name in own.items()}
            for form in ("{}", "{}0", "state_{}"):
                names |= {form.format(stem): name for stem, name in spelled.items()}
        if not own_states and {"phi", "dphi"} <= own.keys() and "x0" in order:
            args = _spread(order, args, kwargs, own)
        for name in [name for name in kwargs if name in names and name not in own.values()]:
            if names[name] in kwargs:
                raise ParameterError(f"{name}: got it besides {names[name]}, wants it once")
            kwargs[names[name]] = kwargs.pop(name)
        return function(*args, **kwargs)

    return cast(Function, called)


def _spread(
    order: list[str], args: tuple[Any, ...], kwargs: dict[str, Any], own: Mapping[str, str]
) -> tuple[Any, ...]:
    """Spread a state that is one argument, by name or in order, over those of its parts.

    The arguments by position that are left; the others are added to those by keyword.
    """
    at = order.index(own["phi"])
    whole: Any = args[at] if len(args) > at else kwargs.get("x0")
    if not isinstance(whole, Mapping):
        pair = isinstance(whole, (tuple, list)) and len(whole) == 2
        if len(args) > at or not pair or "x0" not in kwargs or own["phi"] in kwargs:
            return args
        whole = dict(zip(("phi", "dphi"), whole, strict=True))
    coordinate = getattr(args[0], "coordinate", None) if args else None
    names: dict[Any, str] = {"phi": "phi", "dphi": "dphi"}
    names |= {coordinate: "phi", f"d{coordinate}": "dphi"}
    given: dict[str, Any] = {names.get(name, name): value for name, value in whole.items()}
    if len(args) > at:  # what comes behind the state stands where its rate would
        behind = [name for name in order[at + 1 :] if name != own["dphi"]]
        kwargs.update(zip(behind, args[at + 1 :], strict=False))
        args = args[:at]
    else:
        del kwargs["x0"]
    if given.keys() <= {"phi", "dphi"}:
        for name, value in given.items():
            if own[name] in kwargs:
                raise ParameterError(f"{own[name]}: got it besides x0, wants it once")
            kwargs[own[name]] = value
    else:
        kwargs["x0"] = given
    return args


def named_arguments(title: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a call with an unknown, missing or surplus argument raise a `ParameterError`."""
    signature = inspect.signature(function)
    expected = dict(list(signature.parameters.items())[1:])  # without self or cls

    @functools.wraps(function)
    def checked(first: Any, *args: Any, **kwargs: Any) -> Any:
        for name in kwargs:
            if name not in expected:
                raise unknown(f"parameter of {title}", name, expected)
        try:
            signature.bind(first, *args, **kwargs)
        except TypeError as error:
            raise ParameterError(
                f"{title}: {error}; its parameters are {', '.join(expected)}"
            ) from None
        return function(first, *args, **kwargs)

    return checked


#: What a branch says of its points, and of each special point as ``special_<name>``.
COLUMNS = (
    "kind", "n_unstable", "kind_of_pair", "arclength", "special", "tangent", "step", "residual",
    "newton_steps", "point", "unknown", "end", "special_point",
)  # fmt: skip
OF_SPECIAL = (
    "kind", "label", "status", "message", "name", "residual", "corank", "index", "interval",
    "point",
)  # fmt: skip


def check_names(names: Sequence[str]) -> None:
    """Refuse states and free parameters whose columns would stand for something else."""
    taken = {*columns(names), *OF_SPECIAL}
    for name in names:
        if name in taken:
            raise bad(
                "problem", name, "names of states and free parameters that are no columns",
                f"these are {', '.join(COLUMNS)}, and special_<name> of special points",
            )  # fmt: skip


def columns(names: Iterable[str]) -> set[str]:
    """What the columns of a branch are called, beside its own states and parameters."""
    return {*COLUMNS, *(f"special_{one}" for one in (*OF_SPECIAL, *names))}
