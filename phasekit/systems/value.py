"""What has declared parameters, as a value: compared, hashed, pickled, written, rebuilt."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import FrozenInstanceError
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self

import numpy as np

from phasekit.docstrings import completed, inherit_sections
from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray, Value, bad, brief, same, unknown
from phasekit.labels.coordinates import STATES
from phasekit.laws.ladder import Lawful
from phasekit.spellings import Guided
from phasekit.systems.identity import parameter_values, refuse_another
from phasekit.systems.parameter import REQUIRED, Parameter
from phasekit.systems.statement import refuse_name
from phasekit.systems.summary import summary

if TYPE_CHECKING:
    import xarray as xr


#: What docstrings of systems and terms say of values that are refused.
UNUSABLE = "ParameterError\n    If a scalar is unusable; inside arrays such cells give NaN."


class Declared(Guided):
    """A value of declared parameters, each a field of its class; it does not change."""

    __slots__ = ()

    declared: ClassVar[tuple[Parameter, ...]] = ()

    def __init_subclass__(cls, *, kw_only: bool = True, **keywords: Any) -> None:
        """Take the fields of the class, and make its call."""
        super().__init_subclass__(**keywords)
        inherit_sections(cls)
        own = {name: one for name, one in vars(cls).items() if isinstance(one, Parameter)}
        for name in own:
            refuse_name(f"parameter of {cls.__name__}", name)
            inherited = getattr(super(cls, cls), name, None)
            if inherited is not None and not isinstance(inherited, Parameter):
                wants = f"another name, because every {cls.kind_of_value} has {name!r}"
                raise bad(f"parameter of {cls.__name__}", name, wants)
        if own:
            cls.declared = tuple({**{p.name: p for p in cls.declared}, **own}.values())
        if cls._states_itself() and not {"__init__", "__new__"} & vars(cls).keys():
            cls.__signature__ = _signature(cls.declared, kw_only)  # type: ignore[attr-defined]
        if own and vars(cls).get("__doc__"):
            words = {parameter.name: parameter.entry for parameter in cls.declared}
            cls.__doc__ = completed(cls, words, raises=UNUSABLE)

    #: What messages call such values.
    kind_of_value: ClassVar[str] = "value"

    @classmethod
    def _states_itself(cls) -> bool:
        """Whether the body of the class says what its values are."""
        return any(isinstance(one, Parameter) for one in vars(cls).values())

    def __init__(self, *args: Any, **parameters: Any) -> None:
        title = type(self).__name__
        signature = getattr(type(self), "__signature__", None) or inspect.signature(type(self))
        for name in parameters:
            if name not in signature.parameters:
                raise unknown(f"parameter of {title}", name, signature.parameters)
        try:
            given = signature.bind(*args, **parameters)
        except TypeError as error:
            names = ", ".join(signature.parameters)
            kinds = {one.kind for one in signature.parameters.values()}
            by_name = kinds == {inspect.Parameter.KEYWORD_ONLY}
            way = "parameters are given by name: " if args and by_name else "its parameters are "
            raise ParameterError(f"{title}: {error}; {way}{names}") from None
        given.apply_defaults()
        for declared in self.declared:
            value = given.arguments[declared.name]
            if value is not None or not declared.optional:
                value = declared.check(value)
            object.__setattr__(self, declared.name, value)
        self.check()

    def check(self) -> None:
        """Refuse parameters that go together badly; each alone has been checked.

        Raises
        ------
        ParameterError
            If they go together badly.

        Examples
        --------
        >>> import phasekit as pk
        >>> class Band(pk.Term):
        ...     low = pk.parameter("s-1", "rate above which the force acts")
        ...     high = pk.parameter("s-1", "rate up to which it grows")
        ...     force = "-Max(0, Min(dphi - low, high - low))"
        ...
        ...     def check(self):
        ...         if self.low >= self.high:
        ...             raise pk.ParameterError(f"low: got {self.low}, wants less than high")
        >>> Band(low=2.0, high=1.0).check()
        Traceback (most recent call last):
        ...
        phasekit.errors.ParameterError: low: got 2.0, wants less than high
        """

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters by name, without those that are None."""
        values = {p.name: getattr(self, p.name) for p in self.declared}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def arguments(self) -> dict[str, Any]:
        """The keyword arguments that rebuild it."""
        return dict(self.parameters)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Refuse to change it, with what to write instead."""
        raise FrozenInstanceError(f"a {type(self).__name__} is frozen; use .replace({name}=...)")

    def __delattr__(self, name: str) -> NoReturn:
        """Refuse to take a part of it away."""
        raise FrozenInstanceError(f"a {type(self).__name__} is frozen; it keeps {name}")

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed.

        Parameters
        ----------
        **changes : float, 1-D array_like or xarray.DataArray
            New values, by the parameters' names.

        Returns
        -------
        Self
            Of the same class; this one stays as it is.

        Raises
        ------
        ParameterError
            If a name is not one of the parameters, or a value is unusable.
        """
        names = [parameter.name for parameter in self.declared]
        for name in changes:
            if name not in names:
                raise unknown(f"parameter of {type(self).__name__}", name, names)
        return type(self)(**{**{n: getattr(self, n) for n in names}, **changes})

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled value; its arrays are read-only again."""
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Write the parameters, long arrays by their ends."""
        shown = ", ".join(f"{name}={brief(value)}" for name, value in self.parameters.items())
        return f"{type(self).__name__}({shown})"

    def __eq__(self, other: object) -> bool:
        """Whether it is of the same class, with equal parameters; NaN equals NaN."""
        if type(self) is not type(other) or not isinstance(other, Declared):
            return NotImplemented
        return all(same(getattr(self, p.name), getattr(other, p.name)) for p in self.declared)

    def __hash__(self) -> int:
        """Hash of the parameters; one that holds DataArrays has none."""
        values = (getattr(self, p.name) for p in self.declared)
        # 0.0 is added because -0.0 equals it
        keys = ((v + 0.0).tobytes() if isinstance(v, np.ndarray) else v for v in values)
        return hash((type(self).__name__, *keys))


def _signature(declared: Iterable[Parameter], kw_only: bool) -> inspect.Signature:
    """The call that makes a value; parameters by name alone, where order would mean nothing."""
    kind: Any = inspect.Parameter
    how = kind.KEYWORD_ONLY if kw_only else kind.POSITIONAL_OR_KEYWORD
    return inspect.Signature(
        [
            kind(p.name, how, default=kind.empty if p.default is REQUIRED else p.default)
            for p in declared
        ]
    )


class ModelValue(Declared, Lawful):
    """A system as a value: known by its name in files, written for people."""

    __slots__ = ()

    #: Units of states where they are not those of a system per unit of inertia.
    own_units: ClassVar[Mapping[str, str]] = {}

    def unit_of(self, name: str) -> str | None:
        """Unit of a parameter or state; None where it may be any.

        Parameters
        ----------
        name : str
            The parameter or state.

        Returns
        -------
        str or None
        """
        units = {p.name: p.units for p in self.declared}
        return units.get(name) or self.own_units.get(name) or STATES.get(name, (None,))[0]

    @property
    def coordinate(self) -> str | None:
        """Name of the coordinate, where the system has one that results call phi."""
        return None

    def equations(self) -> Any:
        """The law as first-order equations, where it is a base with terms.

        Returns
        -------
        Equations or None

        Examples
        --------
        >>> import phasekit as pk
        >>> pendulum = pk.Pendulum(length=1.0, g=1.0)
        >>> pendulum.equations() is None
        True
        >>> pk.Perturbed(pendulum, damping=0.1).equations().states
        ('phi', 'dphi')
        """
        return None

    @property
    def definition(self) -> dict[str, str]:
        """What maps store of the system beside its name and parameters."""
        return {}

    @classmethod
    def in_domain(cls, name: str, value: FloatArray) -> FloatArray:
        """Values of a parameter, NaN where they leave its domain.

        Parameters
        ----------
        name : str
            The parameter.
        value : ndarray
            Values in its unit, of any shape.

        Returns
        -------
        ndarray
        """
        for parameter in cls.declared:
            if parameter.name == name and not (valid := parameter.valid(value)).all():
                return np.where(valid, value, np.nan)
        return value

    @classmethod
    def from_dataset(cls, ds: xr.Dataset) -> Self:
        """Rebuild the model from a map, or from any selection of it.

        Parameters
        ----------
        ds : xarray.Dataset
            A Dataset that phasekit made. Parameters that are scalar coordinates become scalars;
            swept ones that were not selected stay arrays.

        Returns
        -------
        Self

        Raises
        ------
        ParameterError
            If the map was made with another model, or a parameter's coordinate is gone.
        """
        refuse_another(ds, cls.__name__)
        return cls(**parameter_values(ds, cls.declared))

    def __str__(self) -> str:
        """Say what it is: parameters in everyday units, equilibria, the nearest folds."""
        return str(summary(self))

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """Say so in IPython, where the representation alone would be meant for programs."""
        printer.text(str(self))

    def _repr_html_(self) -> str:
        """Say so in a notebook."""
        return summary(self).html
