"""A system as a value: its parameters, compared, hashed, pickled and written."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from phasekit.labels.arguments import brief, same
from phasekit.laws.ladder import Lawful
from phasekit.systems.parameter import Parameter
from phasekit.systems.summary import summary


class ModelValue(Lawful):
    """What has declared parameters and does not change."""

    __slots__ = ()

    declared: ClassVar[tuple[Parameter, ...]]

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
