"""A potential and an inertia by formulas of one coordinate on a circle: M(x) x'^2/2 + V(x)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, warn
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Routhian, Routhians
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula, make_formula
from phasekit.phase.numerical.turns import torqued

#: Places at which an inertia is tried.
TRIED = 64
#: Equations of what an inertia is in.
_EQUATIONS = {
    "natural_frequency": "sqrt(V''/M)",
    "exponent": "sqrt(-V''/M)",
    "energy_integral": "M phi'^2/2 + V",
    "phase_velocity": "sqrt(2 (h - V)/M)",
    "saddle_exponent": "sqrt(-V''/M)",
    "winding_area": "int M phi' dphi",
    "lobe_area": "oint M phi' dphi",
    "orbit_energy": "h = M phi'^2/2 + V",
    "period": "oint dphi/phi'",
    "action": "oint M phi' dphi/(2 pi)",
    "motion_phi": "M phi'' + M' phi'^2/2 + V' = 0",
    "motion_dphi": "M phi'' + M' phi'^2/2 + V' = 0",
    "kind": "sign of V''",
    "phi": "V' = 0",
    "energy": "V",
    "curvature": "V''",
    "potential": "V",
    "potential_gradient": "V'",
    "potential_curvature": "V''",
    "n_equilibria": "zeros of V'",
    "saddle_energy": "h_s = V(phi_s)",
    "turning_phi": "V(phi_t) = h_s",
    "phi_min": "V(phi_min) = h",
    "phi_max": "V(phi_max) = h",
}


class Rests(NamedTuple):
    """Equilibria on the last axis, by coordinate; NaN beyond the last."""

    phi: Array
    kind: npt.NDArray[np.int8]
    energy: Array
    curvature: Array
    natural_frequency: Array
    exponent: Array
    n_equilibria: npt.NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class Inertial(Routhians):
    """Such systems by their parameters: the formulas of V and M, of the same names."""

    formula: Formula
    mass: Formula

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as text; the functions are made anew."""
        f = self.formula
        return inertial, (f.text, self.mass.text, f.coordinate, f.names, f.period)

    @property
    def coordinate(self) -> str:  # type: ignore[override]
        """Name of the coordinate."""
        return self.formula.coordinate

    @property
    def period(self) -> float:  # type: ignore[override]
        """Length of its circle."""
        assert self.formula.period is not None
        return self.formula.period

    @property
    def names(self) -> tuple[str, ...]:  # type: ignore[override]
        """All parameters."""
        return self.formula.names

    constants = names

    def values(self, *arrays: Any) -> dict[str, Any]:
        """Values of the parameters by name."""
        return {n: np.asarray(x, float) for n, x in zip(self.names, arrays, strict=True)}

    def constants_of(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The parameters themselves."""
        return {name: values[name] for name in self.names}

    def with_values(self, values: Mapping[str, Any]) -> AtValues:
        """The systems of some values."""
        return AtValues(self, tuple(values[name] for name in self.names))

    def alone(self, constants: tuple[float, ...]) -> AtValues:
        """The system of some values in the order of the names."""
        return AtValues(self, constants[: len(self.names)])

    def resting(self, values: Mapping[str, Any], torque: Any = None) -> Rests:
        """All equilibria, under a constant torque; a warning where more may be."""
        formula, given = self.formula, [values[name] for name in self.names]
        if torque is not None:
            formula, given = torqued(formula), [*given, torque]
        found: Equilibria = functions.equilibria(formula, *given)
        if not np.all(found.complete | (found.n_equilibria < 0)):
            warn(
                f"equilibria: it is not proved that there are no others, of "
                f"{int(np.sum(~found.complete))} of {found.complete.size} systems",
                RuntimeWarning,
            )  # fmt: skip
        one = self.with_values({name: np.asarray(values[name])[..., None] for name in self.names})
        with np.errstate(all="ignore"):
            rate = 1.0 / np.sqrt(one.inertia(found.phi)[0])
        usable = np.broadcast_to(self.least(values)[1] > 0.0, found.n_equilibria.shape)
        there = usable[..., None]
        phi, energy, curvature, frequency, exponent = (
            np.where(there, column, np.nan)
            for column in (
                found.phi, found.energy, found.curvature, found.natural_frequency * rate,
                found.exponent * rate,
            )
        )  # fmt: skip
        kind = np.where(there, found.kind, np.int8(EquilibriumKind.NOT_COMPUTED))
        count = np.where(usable, found.n_equilibria, np.int16(-1))
        return Rests(phi, kind, energy, curvature, frequency, exponent, count)

    def least(self, values: Mapping[str, Any]) -> tuple[Array, Array]:
        """Where the inertia is least, among places spread over the circle, and its value there."""
        places = self.period * np.arange(TRIED) / TRIED
        own = [np.asarray(values[name], float)[..., None] for name in self.names]
        with np.errstate(all="ignore"):
            found = self.mass.values(places, *own)
        shape = np.broadcast_shapes(places.shape, *(x.shape for x in own))
        found = np.broadcast_to(found, shape)
        return places[np.argmin(found, axis=-1)], np.min(found, axis=-1)

    def resting_formula(self, symbols: Mapping[str, Any]) -> Any:
        """V, of parameters as symbols: a function with the equilibria as its stationary points."""
        return _in_symbols(self.formula, symbols)

    def acceleration_formula(self, symbols: Mapping[str, Any], rate: Any, push: Any) -> Any:
        """The acceleration, of parameters as symbols: (push - V' - M' x'^2/2)/M."""
        x = symbols[self.coordinate]
        V, M = _in_symbols(self.formula, symbols), _in_symbols(self.mass, symbols)
        return (push - V.diff(x) - M.diff(x) * rate**2 / 2) / M

    def words(self, name: str, units: str, long_name: str) -> dict[str, str]:
        """The formulas as the source; units are those of V, which is per unit of M."""
        words = {"units": units, "long_name": long_name}
        words |= self.formula.words(name, units, long_name)
        words["source"] = f"V = {self.formula.text}; M = {self.mass.text}"
        if name in _EQUATIONS:
            words["equation"] = _EQUATIONS[name]
        return words


def _in_symbols(formula: Formula, symbols: Mapping[str, Any]) -> Any:
    own = symbols_of((formula.coordinate, *formula.names))
    return formula.expression.xreplace({own[name]: symbols[name] for name in own})


@dataclass(frozen=True, eq=False)
class AtValues(Routhian):
    """The systems of some values, which may be arrays."""

    law: Inertial
    parameters: tuple[Any, ...]
    momentum = None
    own_inertia = 1.0

    @property
    def coordinate(self) -> str:  # type: ignore[override]
        """Name of the coordinate."""
        return self.law.coordinate

    @property
    def period(self) -> float:  # type: ignore[override]
        """Length of its circle."""
        return self.law.period

    def potential(self, x: Any) -> tuple[Any, Any, Any]:
        """V and its first two derivatives."""
        f, own = self.law.formula, self.parameters
        return f.values(x, *own), f.slopes(x, *own), f.bends(x, *own)

    def inertia(self, x: Any) -> tuple[Any, Any]:
        """M and its derivative."""
        mass, own = self.law.mass, self.parameters
        return mass.values(x, *own), mass.slopes(x, *own)

    def equilibria(self) -> Rests:
        """All equilibria that there are, of one system."""
        values = dict(zip(self.law.names, self.parameters, strict=True))
        found = self.law.resting(values)
        there = np.isfinite(found.phi)
        columns = {name: getattr(found, name)[there] for name in Rests._fields[:-1]}
        return found._replace(**columns)


def inertial(
    potential: Any, inertia: Any, coordinate: str, names: tuple[str, ...], period: float
) -> Inertial:
    """The law of a potential and an inertia by their formulas."""
    V, M = (make_formula(text, coordinate, names, period, None) for text in (potential, inertia))
    return Inertial(V, M)
