"""What every system shares: declared parameters, validation, copies, equality, rebuilding.

A system is a set of parameters and a formula that turns them into the coefficients (A, B, C) of
``phi'' + B sin phi - A sin phi cos phi - C cos phi = 0``. A model declares its parameters once, as
a tuple of `Parameter`; validation, sweeps, coordinates of maps and rebuilding from a map all
follow from that declaration.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.labelled.arguments import (
    FloatArray,
    Value,
    bad,
    brief,
    numeric,
    same,
    unknown,
)
from phasekit.laws.ladder import Conservative, Law
from phasekit.laws.trigonometric import Trigonometric, Values
from phasekit.laws.trigonometric import law as make_law

if TYPE_CHECKING:
    import xarray as xr

    from phasekit.labelled.guises import Reduced
    from phasekit.labelled.models import Coefficients

#: Every model by its name, as maps store it.
MODELS: dict[str, type[Model]] = {}


def as_system(system: Any, *, rung: type[Law] = Law, what: str = "") -> Model:
    """Return the system that an argument is.

    Parameters
    ----------
    system : Any
        What was given.
    rung : type, optional
        The rung of the ladder on which its law has to stand.
    what : str, optional
        What needs that.

    Raises
    ------
    ParameterError
        If it is not a system, with the way from what it is to one.
    """
    if isinstance(system, Model):
        return stands_on(system, rung, what)
    make: Callable[..., Model] = MODELS["Coefficients"]
    if not isinstance(system, type) and callable(getattr(system, "coefficients", None)):
        coefficients = system.coefficients()
        if isinstance(coefficients, tuple) and len(coefficients) == 3:
            return make(*coefficients)
    hint = ""
    if isinstance(system, (tuple, list)) and len(system) == 3:
        hint = "three coefficients make one: pk.Coefficients(A, B, C)"
    elif isinstance(system, type):
        hint = "it is a class: call it with its parameters"
    elif hasattr(system, "data_vars"):
        hint = "a map gives its system back by ds.phasekit.system()"
    raise bad("system", system, f"one of {', '.join(MODELS)}", hint)


def stands_on(system: Model, rung: type[Law], what: str) -> Model:
    """Return a system whose law stands on a rung, or on a more special one.

    Raises
    ------
    ParameterError
        If it does not.
    """
    if issubclass(system.rung, rung):
        return system
    raise ParameterError(
        f"system: got {system!r}, wants {rung.called}, because {what} is in closed form"
    )


ModelType = TypeVar("ModelType", bound="Model")


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One declared parameter of a model: its name, meaning, unit and domain."""

    name: str
    units: str
    long_name: str
    low: float = -np.inf
    high: float = np.inf
    positive: bool = False  # zero is excluded
    optional: bool = False

    @property
    def least(self) -> float:
        """The least value, just above zero where that is excluded."""
        return max(self.low, math.ulp(0.0)) if self.positive else self.low

    @property
    def example(self) -> float:
        """A value of the domain, for where the parameter's own value does not count."""
        if np.isfinite(self.low) and np.isfinite(self.high):
            return 0.5 * (self.low + self.high)
        return max(1.0, self.low)

    @property
    def wants(self) -> str:
        """The domain in words."""
        if self.positive:
            domain = "a number > 0"
        elif self.low == 0.0 and self.high == np.inf:
            domain = "a number >= 0"
        elif np.isfinite(self.high):
            domain = f"a number from {self.low:.6g} to {self.high:.6g}"
        else:
            domain = "a finite number"
        units = {"1": "", "rad": " in radians"}.get(self.units, f" in {self.units}")
        return domain + units

    def valid(self, value: Any) -> NDArray[np.bool_]:
        """Whether each value lies in the domain; NaN does not."""
        inside = np.isfinite(value) & (value >= self.low) & (value <= self.high)
        return np.asarray(inside & (value > 0) if self.positive else inside)

    def check(self, value: Any) -> Value:
        """Return the value as it is kept, or raise a `ParameterError`.

        Cells of arrays that lie outside the domain are kept: they give invalid cells.
        """
        kept = numeric(self.name, value, self.units)
        if isinstance(kept, float):
            if not self.valid(kept):
                in_degrees = self.units == "rad" and self.valid(kept * np.pi / 180.0)
                hint = f"if it is in degrees: {kept:.15g} * pk.deg" if in_degrees else ""
                raise bad(self.name, value, self.wants, hint)
            return kept
        if isinstance(kept, np.ndarray):
            return kept
        return self._plain_axis(kept)

    def _plain_axis(self, kept: xr.DataArray) -> Value:
        """Keep a DataArray on the parameter's own dim as the 1-D array that it is."""
        if self.name not in kept.dims:
            return kept
        if kept.ndim > 1:
            wants = f"a dim {self.name!r} only where it is the one dim (it is the axis then)"
            raise bad(self.name, kept, wants, "rename the dim")
        if self.name in kept.coords and not np.array_equal(
            kept.coords[self.name].values, kept.values, equal_nan=True
        ):
            wants = f"a coordinate {self.name!r} that equals its values"
            raise bad(self.name, kept, wants, f"drop it with .drop_vars({self.name!r})")
        if kept.chunks is not None:  # stays lazy
            return kept.drop_vars(self.name, errors="ignore")
        array = np.array(kept.values)
        array.flags.writeable = False
        return array


def attrs_of(*parameters: Parameter) -> dict[str, dict[str, str]]:
    """Attributes of the coordinates or results that are named as these parameters."""
    return {p.name: {"long_name": p.long_name, "units": p.units} for p in parameters}


class Model:
    """Base of the systems: frozen, compared by value, rebuilt from any map that they made."""

    __slots__ = ()

    declared: ClassVar[tuple[Parameter, ...]]
    #: Parameters for which folds are known in closed form, with the function that solves for each.
    critical_values: ClassVar[Mapping[str, Callable[..., Any]]] = {}
    #: The rung of its law, which says what can be computed of it.
    rung: ClassVar[type[Conservative]] = Trigonometric

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """A N, B N, C N and N > 0 of the parameters: the model's law, stated by each."""
        raise NotImplementedError

    @property
    def law(self) -> Conservative:
        """The law, and what follows from it."""
        return self.trigonometric()

    @classmethod
    def trigonometric(cls) -> Trigonometric:
        """The law of all systems of this kind, for those whose law is that of (A, B, C)."""
        declared = ((p.name, p.units, p.least, p.high) for p in cls.declared)
        return make_law(cls.products, tuple(declared))

    def __post_init__(self) -> None:
        """Check the parameters and keep them."""
        for parameter in self.declared:
            value = getattr(self, parameter.name)
            if value is not None or not parameter.optional:
                object.__setattr__(self, parameter.name, parameter.check(value))

    @classmethod
    def formula_inputs(cls) -> tuple[str, ...]:
        """Names of the parameters on which the coefficients depend."""
        return cls.trigonometric().parameters

    def unit_of(self, name: str) -> str | None:
        """Unit of a parameter or state; None where it may be any."""
        from phasekit.labelled.schema import input_attrs

        return input_attrs(self, name).get("units")

    @property
    def definition(self) -> dict[str, str]:
        """What maps store of the system beside its name and parameters."""
        return {}

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters by name, those that are None left out."""
        values = {p.name: getattr(self, p.name) for p in self.declared}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def arguments(self) -> dict[str, Any]:
        """What makes it again, by keyword."""
        return dict(self.parameters)

    @classmethod
    def in_domain(cls, name: str, value: FloatArray) -> FloatArray:
        """Values of a parameter, NaN where they leave its domain."""
        for parameter in cls.declared:
            if parameter.name == name and not (valid := parameter.valid(value)).all():
                return np.where(valid, value, np.nan)
        return value

    @classmethod
    def valid_coefficients(
        cls, parameters: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients from arrays that broadcast, NaN where a parameter leaves its domain."""
        used = {name: parameters[name] for name in cls.formula_inputs()}
        with np.errstate(all="ignore"):
            valid = functools.reduce(
                np.logical_and, [p.valid(used[p.name]) for p in cls.declared if p.name in used]
            )
            A, B, C = cls.trigonometric().coefficients(used)
            if not valid.all():
                A, B, C = (np.where(valid, x, np.nan) for x in (A, B, C))
        return A, B, C

    def coefficients(self) -> Coefficients:
        """Coefficients (A, B, C) of the equation of motion, all in s^-2.

        Returns
        -------
        Coefficients
            Floats, or DataArrays on the parameters' dims where a parameter is an array.
        """
        from phasekit.labelled.grid import combine
        from phasekit.labelled.models import Coefficients

        names = self.formula_inputs()
        used = {name: self.parameters[name] for name in names}

        def abc(*arrays: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            return self.valid_coefficients(dict(zip(names, arrays, strict=True)))

        attrs = attrs_of(*self.declared, *Coefficients.declared)
        results = combine(abc, used, ("A", "B", "C"), attrs)
        if not all(np.isfinite(x) for x in results if isinstance(x, float)):
            got = ", ".join(f"{name}={brief(value)}" for name, value in used.items())
            raise ParameterError(
                f"{type(self).__name__}: got {got}, whose coefficients are {results}; wants "
                "parameters of a size for which A, B and C are finite"
            )
        return Coefficients(*results)

    def reduced(self) -> Reduced:
        """Return the papers' form (lambda, psi, Omega^2); cells with ``A = 0`` become NaN.

        Raises
        ------
        ParameterError
            If ``A = 0`` for a system of scalars, where lambda and psi are infinite.
        """
        from phasekit.labelled.guises import reduce

        return reduce(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled model; its arrays are read-only again."""
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed.

        Raises
        ------
        ParameterError
            If a name is not one of the model's parameters, or a value is unusable.
        """
        names = [parameter.name for parameter in self.declared]
        for name in changes:
            if name not in names:
                raise unknown(f"parameter of {type(self).__name__}", name, names)
        return type(self)(**{**{n: getattr(self, n) for n in names}, **changes})

    @classmethod
    def from_dataset(cls, ds: xr.Dataset) -> Self:
        """Rebuild the model from a map, or from any selection of it.

        Parameters
        ----------
        ds : xarray.Dataset
            A Dataset that phasekit made. Parameters that are scalar coordinates become scalars;
            swept ones that were not selected stay arrays.

        Raises
        ------
        ParameterError
            If the map was made with another model, or a parameter's coordinate is gone.
        """
        from phasekit.labelled.schema import model_name, parameter_values

        name = model_name(ds)
        if name != cls.__name__:
            raise ParameterError(
                f"ds: got a map of {name}, wants one of {cls.__name__}; "
                f"use ds.phasekit.system() or {name}.from_dataset(ds)"
            )
        return cls(**parameter_values(ds, cls.declared))

    def __repr__(self) -> str:
        """Write the parameters, long arrays by their ends."""
        shown = ", ".join(f"{name}={brief(value)}" for name, value in self.parameters.items())
        return f"{type(self).__name__}({shown})"

    def __eq__(self, other: object) -> bool:
        """Whether it is the same model with equal parameters; NaN equals NaN."""
        if type(self) is not type(other) or not isinstance(other, Model):
            return NotImplemented
        return all(same(getattr(self, p.name), getattr(other, p.name)) for p in self.declared)

    def __hash__(self) -> int:
        """Hash of the parameters; a model that holds DataArrays has none."""
        values = (getattr(self, p.name) for p in self.declared)
        # 0.0 is added because -0.0 equals it
        keys = ((v + 0.0).tobytes() if isinstance(v, np.ndarray) else v for v in values)
        return hash((type(self).__name__, *keys))


def model(cls: type[ModelType]) -> type[ModelType]:
    """Class decorator of a model: register its name, refuse wrong argument names readably."""
    cls.__init__ = named_arguments(cls.__name__, cls.__init__)  # type: ignore[method-assign]
    MODELS[cls.__name__] = cls
    return cls


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
