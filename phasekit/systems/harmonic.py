"""One harmonic of a torque or of a parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from phasekit.labels.arguments import NumberLike, Value, brief, named_arguments, numeric, same
from phasekit.pickles import Stamped
from phasekit.systems.parameter import Parameter

_PARTS = (
    Parameter(name="amplitude", units="1", long_name="amplitude"),
    Parameter(name="frequency", units="s-1", long_name="angular frequency", positive=True),
    Parameter(name="phase", units="rad", long_name="phase at t = 0"),
)


@dataclass(frozen=True, eq=False, repr=False)
class Harmonic(Stamped):
    """``amplitude cos(frequency t + phase)``: a torque, or what is added to a parameter.

    Parameters
    ----------
    amplitude : float, 1-D array_like or xarray.DataArray
        Amplitude, of any sign: of a torque per unit of inertia in s^-2, of a modulated parameter
        in the parameter's own unit.
    frequency : float or array_like
        Angular frequency in s^-1, > 0.
    phase : float or array_like, default 0.0
        Phase at ``t = 0``, in rad.

    Raises
    ------
    ParameterError
        If a value is unusable.

    Notes
    -----
    Of a `Perturbed` system it is one term of ``sum F_j cos(nu_j t + alpha_j)`` on the right-hand
    side, or of ``p(t) = p + F cos(nu t + alpha)`` ([GuckenheimerHolmes1983] section 4.5).

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.Harmonic(0.3, 2.0)
    Harmonic(amplitude=0.3, frequency=2.0)
    >>> pk.Harmonic(0.3, 2.0) == pk.Harmonic(0.3, frequency=2.0, phase=0.0)
    True
    >>> pk.Harmonic(0.3, 0.0)
    Traceback (most recent call last):
    phasekit.errors.ParameterError: frequency: got 0.0, wants a number > 0 in s-1
    """

    amplitude: NumberLike
    frequency: NumberLike
    phase: NumberLike = 0.0

    def __post_init__(self) -> None:
        """Check the values and keep them."""
        for part in _PARTS:
            value = getattr(self, part.name)
            if part.name == "amplitude":  # in whatever unit its parameter has
                value = numeric("amplitude", value, None)
                if isinstance(value, xr.DataArray):
                    value.attrs.pop("units", None)
            object.__setattr__(self, part.name, part.check(value))

    @property
    def values(self) -> tuple[Value, Value, Value]:
        """Amplitude, frequency and phase."""
        kept: Any = self
        values: tuple[Value, Value, Value] = (kept.amplitude, kept.frequency, kept.phase)
        return values

    def __repr__(self) -> str:
        """Write the values, a phase of zero left out."""
        shown = [f"{p.name}={brief(v)}" for p, v in zip(_PARTS, self.values, strict=True)]
        without = isinstance(self.phase, float) and self.phase == 0.0
        return f"Harmonic({', '.join(shown[:2] if without else shown)})"

    def __eq__(self, other: object) -> bool:
        """Whether amplitude, frequency and phase are equal; NaN equals NaN."""
        if not isinstance(other, Harmonic):
            return NotImplemented
        return all(same(x, y) for x, y in zip(self.values, other.values, strict=True))

    def __hash__(self) -> int:
        """Hash of the values; a harmonic that holds DataArrays has none."""
        keys = ((v + 0.0).tobytes() if isinstance(v, np.ndarray) else v for v in self.values)
        return hash(("Harmonic", *keys))

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled harmonic; its arrays are read-only again."""
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)


Harmonic.__init__ = named_arguments("Harmonic", Harmonic.__init__)  # type: ignore[method-assign]
