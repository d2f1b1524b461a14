"""Numbers as users pass them, as plain float64 arrays; and the messages for what is no number.

Every message says which argument, what it got, what it wants, and what to do next.
"""

from __future__ import annotations

import decimal
import functools
import inspect
import math
import numbers
import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from phasekit.docstrings import completed
from phasekit.errors import ArgumentError, ParameterError
from phasekit.spellings import ARGUMENTS, DEPRECATED, keyword_meant, respelled

FloatArray: TypeAlias = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])

#: What a function raises whose docstring does not say it.
UNUSABLE = "ParameterError\n    If an argument is unusable."

#: Largest number of elements that a description or a representation writes out.
SHOWN = 5

_NUMBERS = (numbers.Real, decimal.Decimal)
#: Types that are registered as numbers, or count as such, and are none here.
_NO_NUMBERS = (bool, np.bool_, np.datetime64, np.timedelta64)
_SEQUENCES = (list, tuple)


def is_whole(value: object) -> bool:
    """Whether it is a whole number; NumPy's durations count as such, and are none here.

    >>> is_whole(np.int8(3)), is_whole(np.timedelta64(3, "s")), is_whole(True)
    (True, False, False)
    """
    return isinstance(value, (int, np.integer)) and not isinstance(value, _NO_NUMBERS)


def is_real(value: object) -> bool:
    """Whether it is a real number of any type, but neither a bool nor a duration."""
    return isinstance(value, _NUMBERS) and not isinstance(value, _NO_NUMBERS)


def describe(value: object) -> str:
    """Say what a value is, on one line.

    >>> describe(30), describe([[1, 2], [3, 4]]), describe(None)
    ('30', 'a 2-D list of shape (2, 2)', 'None')
    """
    if isinstance(value, np.ma.MaskedArray) and value.ndim == 0 and value.mask:
        return "a masked value"
    if is_labelled(value):
        labelled: Any = value
        dims = tuple(labelled.dims)
        if hasattr(labelled, "dtype"):
            if dims:
                return f"a {type(value).__name__} with dims {dims} and dtype {labelled.dtype}"
            value = labelled.values
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, (np.datetime64, np.timedelta64)):  # whose items may be mere numbers
        return f"the {'date' if isinstance(value, np.datetime64) else 'duration'} {value}"
    if isinstance(value, (*_SEQUENCES, range, np.ndarray)):
        array = _array(value)
        if array is not None and array.ndim > 0 and array.dtype.kind in "mM":
            return f"{'dates' if array.dtype.kind == 'M' else 'durations'} of shape {array.shape}"
        if array is not None and array.ndim == 1 and array.size <= SHOWN:
            return _short(tuple(array.tolist()) if isinstance(value, tuple) else array.tolist())
        if array is not None and array.ndim > 0:
            kind = "array" if isinstance(value, np.ndarray) else type(value).__name__
            return f"a {array.ndim}-D {kind} of shape {array.shape}"
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (numbers.Number, str, type(None), tuple, list, dict)):
        return _short(value)
    own = getattr(type(value), "_in_errors", None)
    if isinstance(own, property) and own.fget is not None:
        return str(own.fget(value))
    name = value.__name__ if isinstance(value, type) else type(value).__name__
    return f"the class {name}" if isinstance(value, type) else f"an object of type {name}"


def _short(value: object) -> str:
    try:
        text = repr(value)
    except Exception:  # an int of thousands of digits, or an object whose own code fails
        text = ""
    if isinstance(value, int) and not 0 < len(text) <= 60:
        return f"a whole number of {value.bit_length()} bits"
    return text if 0 < len(text) <= 60 else f"an object of type {type(value).__name__}"


def bad(argument: str, got: object, wants: str, hint: str = "") -> ParameterError:
    """Return the error for an unusable argument; the caller raises it.

    >>> print(bad("mass", -1.0, "a number > 0"))
    mass: got -1.0, wants a number > 0
    """
    text = f"{argument}: got {describe(got)}, wants {wants}"
    return ParameterError(f"{text}; {hint}" if hint else text)


def is_labelled(value: object) -> bool:
    """Whether it is a DataArray, a Variable or a Dataset, whose dims have names."""
    return hasattr(value, "dims") and hasattr(value, "to_dict")


def flag(argument: str, value: object) -> None:
    """Raise a `ParameterError` unless `value` is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise bad(argument, value, "True or False")


def one_of(argument: str, value: object, names: Sequence[str]) -> int:
    """Return the place of a name among those that an argument may take.

    >>> one_of("side", "right", ("left", "right"))
    1
    """
    if not isinstance(value, str) or value not in names:
        raise bad(argument, value, f"one of {', '.join(names)}")
    return list(names).index(value)


def whole(argument: str, value: Any, wants: str, low: int = 1) -> int:
    """Return a whole number that is at least `low`.

    >>> whole("n", np.int64(4), "a number >= 1")
    4
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not is_whole(value) or not low <= value < 2**63:
        raise bad(argument, value, wants)
    return int(value)


def reals(argument: str, value: Any, wants: str) -> FloatArray:
    """Return a new float64 array, of any shape, of the real numbers that a user passes.

    Numbers may be of any real type, fractions and decimals as well. Masked ones become NaN; those
    beyond the largest double become infinite.
    """
    if type(value) is float:
        return np.array(value)
    if type(value) is np.ndarray and value.dtype.kind in "iuf":
        with np.errstate(over="ignore"):  # of numbers in extended precision
            return value.astype(np.float64)
    if is_labelled(value):
        raise bad(argument, value, wants, "arrays with named dims have their numbers in .values")
    if hasattr(value, "magnitude") or (hasattr(value, "unit") and hasattr(value, "to_value")):
        raise bad(argument, value, wants, "give the number alone, in SI units and radians")
    kinds = _kinds(value) if isinstance(value, _SEQUENCES) else {type(value)}
    if kinds & {bool, np.bool_}:
        raise bad(argument, value, wants, "it holds a bool" if type(value) not in kinds else "")
    array = _array(value)
    if array is None or array.dtype.kind not in "iufO":
        raise bad(argument, value, wants)
    if array.dtype.kind == "O":
        return _each(argument, value, array, wants)
    with np.errstate(over="ignore"):  # of numbers in extended precision
        return array.astype(np.float64)


def _array(value: Any) -> NDArray[Any] | None:
    """Return what NumPy makes of a value, masked numbers as NaN; None where it makes nothing."""
    if isinstance(value, _SEQUENCES):
        masked = (np.ma.MaskedArray, np.ma.core.MaskedConstant)
        if any(issubclass(kind, masked) for kind in _kinds(value)):
            value = _filled(value)
    elif isinstance(value, np.ma.MaskedArray):
        value = _filled(value)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.asarray(value)
    except Exception:  # ragged, or a foreign object whose own code fails
        return None


def _filled(value: Any) -> Any:
    if isinstance(value, np.ma.MaskedArray):
        if value.dtype.kind not in "iuf":
            return value.data
        return np.ma.filled(value.astype(np.float64), np.nan)
    return [_filled(item) for item in value] if isinstance(value, _SEQUENCES) else value


def _kinds(value: Any, depth: int = 0) -> set[type]:
    """Types of the elements of nested lists; of arrays, the types of their elements too."""
    kinds = set(map(type, value))
    if depth < 32:
        if kinds & {*_SEQUENCES, np.ndarray}:
            for item in value:
                if isinstance(item, _SEQUENCES):
                    kinds |= _kinds(item, depth + 1)
                elif isinstance(item, np.ndarray):
                    kinds.add(item.dtype.type)
    return kinds


def _each(argument: str, value: Any, array: NDArray[Any], wants: str) -> FloatArray:
    """Convert an array of objects one by one."""
    out = np.empty(array.shape)
    items: Iterable[Any] = array.flat
    for place, item in zip(np.ndindex(array.shape), items, strict=True):
        if item is np.ma.masked or type(item).__name__ == "NAType":  # that of pandas
            out[place] = np.nan
            continue
        if issubclass(type(item), _NO_NUMBERS) or not isinstance(item, _NUMBERS):
            raise bad(argument, value, wants, f"it holds {describe(item)}" if array.ndim else "")
        try:
            out[place] = float(item)
        except OverflowError:
            out[place] = math.inf
        except (TypeError, ValueError):  # a signalling NaN, or a foreign type
            raise bad(argument, value, wants) from None
    return out


def _guessed(text: str, given: Iterable[str]) -> str:
    """A keyword that is another word for an argument of which a message says that it is missing."""
    missing = re.findall(r"missing a required argument: '(\w+)'", text)
    return next((one for one in given for name in missing if one in ARGUMENTS.get(name, ())), "")


def refuse_call(function: Any, strange: Iterable[str], missing: Iterable[str] = ()) -> None:
    """Refuse a call with keywords that mean nothing for the system, or without what it needs."""
    signature = inspect.signature(function)
    kinds = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    expected = [n for n, one in signature.parameters.items() if one.kind not in kinds]
    for name in strange:
        hint = keyword_meant(name, expected)
        raise ArgumentError(
            f"{function.__name__}() got an unexpected keyword argument {name!r};{hint and ' '}"
            f"{hint} its arguments are {', '.join(expected)}"
        )
    for name in missing:
        raise ArgumentError(
            f"{function.__name__}() missing a required argument: {name!r}; its arguments are "
            f"{', '.join(expected)}"
        )


def call_checked(function: Function, name: str = "") -> Function:
    """Make a call with an unknown, missing or surplus argument say what the arguments are.

    A method does not list its object, nor what is named by what it makes, `name`. A docstring need
    not say that a `ParameterError` is raised if an argument is unusable.
    """
    signature = inspect.signature(function)
    expected = list(signature.parameters)
    expected = expected[bool(name) or expected[:1] == ["self"] :]
    kinds = {parameter.kind for parameter in signature.parameters.values()}
    takes_all = inspect.Parameter.VAR_KEYWORD in kinds
    own = signature.parameters.values()
    former = DEPRECATED.get(function.__name__, {})
    by_name = [one.name for one in own if one.kind is inspect.Parameter.KEYWORD_ONLY]

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        if not former.keys().isdisjoint(kwargs):
            kwargs = respelled(function.__name__, kwargs)
        try:
            return function(*args, **kwargs)
        except TypeError:
            try:
                signature.bind(*args, **kwargs)
            except TypeError as unfit:
                error = unfit
            else:  # of what the function does
                raise
            strange = [name for name in kwargs if name not in expected and not takes_all]
            text, hint = str(error), ""
            if strange:  # rather than what is missing in its place
                text = f"got an unexpected keyword argument {strange[0]!r}"
                hint = keyword_meant(strange[0], expected, (*args, *kwargs.values()))
                hint = f" {hint}" if hint else ""
            elif takes_all and (guess := _guessed(text, kwargs)):
                hint = f" give it by its name, instead of {guess}=;"
            elif by_name and text == "too many positional arguments":
                hint = f" {by_name[0]}= and those after it go by name;"
            listed = ", ".join(expected)
            message = f"{name or function.__name__}() {text};{hint} its arguments are {listed}"
            raise ArgumentError(message) from None

    called.__doc__ = completed(function, raises=UNUSABLE)
    return cast(Function, called)
