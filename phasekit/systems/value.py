"""A system as a value: its parameters, compared, hashed, pickled, written, rebuilt from a map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from phasekit.labels.arguments import FloatArray, brief, same
from phasekit.labels.coordinates import STATES
from phasekit.laws.ladder import Lawful
from phasekit.systems.identity import parameter_values, refuse_another
from phasekit.systems.parameter import Parameter
from phasekit.systems.summary import summary

if TYPE_CHECKING:
    import xarray as xr


class ModelValue(Lawful):
    """What has declared parameters and does not change."""

    __slots__ = ()

    declared: ClassVar[tuple[Parameter, ...]]
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
    def definition(self) -> dict[str, str]:
        """What maps store of the system beside its name and parameters."""
        return {}

    @property
    def arguments(self) -> dict[str, Any]:
        """The keyword arguments that rebuild it."""
        return dict(self.parameters)

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
        System

        Raises
        ------
        ParameterError
            If the map was made with another model, or a parameter's coordinate is gone.
        """
        refuse_another(ds, cls.__name__)
        return cls(**parameter_values(ds, cls.declared))

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled model; its arrays are read-only again."""
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Write the parameters, long arrays by their ends."""
        shown = ", ".join(f"{name}={brief(value)}" for name, value in self.parameters.items())
        return f"{type(self).__name__}({shown})"

    def __str__(self) -> str:
        """Say what it is: parameters in everyday units, equilibria, the nearest folds."""
        return str(summary(self))

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """Say so in IPython, where the representation alone would be meant for programs."""
        printer.text(str(self))

    def _repr_html_(self) -> str:
        """Say so in a notebook."""
        return summary(self).html

    def __eq__(self, other: object) -> bool:
        """Whether it is the same model with equal parameters; NaN equals NaN."""
        if type(self) is not type(other) or not isinstance(other, ModelValue):
            return NotImplemented
        return all(same(getattr(self, p.name), getattr(other, p.name)) for p in self.declared)

    def __hash__(self) -> int:
        """Hash of the parameters; a model that holds DataArrays has none."""
        values = (getattr(self, p.name) for p in self.declared)
        # 0.0 is added because -0.0 equals it
        keys = ((v + 0.0).tobytes() if isinstance(v, np.ndarray) else v for v in values)
        return hash((type(self).__name__, *keys))
