"""Laws with damping and drive: what is added to a potential, by name.

``x'' + V'(x; p(t)) = -d x' - q |x'| x' + N + sum F cos(nu t + phase) + E(x) omega'(t)``, with
parameters ``p(t) = p + P cos(nu t + phase)`` or ``p + rate t``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from phasekit.laws.ladder import Conservative, Law, Routhian, is_turn
from phasekit.laws.trigonometric import Trigonometric

#: What every perturbed law has beside the parameters of its potential.
OWN = ("damping", "quadratic", "torque", "kT")
#: The fields of a harmonic.
HARMONIC = ("amplitude", "frequency", "phase")


def forcing_names(number: int) -> tuple[str, ...]:
    """Names of the parameters of the harmonic of a number, from 0, of the forcing."""
    prefix = "forcing" if number == 0 else f"forcing{number + 1}"
    return tuple(f"{prefix}_{part}" for part in HARMONIC)


def modulation_names(parameter: str) -> tuple[str, ...]:
    """Names of the parameters of the harmonic of a modulated parameter."""
    return tuple(f"modulation_{parameter}_{part}" for part in HARMONIC)


def drift_name(parameter: str) -> str:
    """Name of the rate at which a parameter drifts."""
    return f"drift_{parameter}"


@dataclass(frozen=True)
class Rate:
    """A parameter that is an angular velocity of the frame, and the torque of its change.

    Attributes
    ----------
    parameter : str
        Its name.
    euler : callable
        Of the parameters by name: (E0, Es, Ec) of ``E = E0 + Es sin phi + Ec cos phi``.
    """

    parameter: str
    euler: Callable[[Mapping[str, Any]], tuple[Any, Any, Any]]
    #: The class that states it, and under which name.
    stated: tuple[type, str] | None = field(default=None, init=False, compare=False, repr=False)

    def __set_name__(self, owner: type, name: str) -> None:
        """Remember which class states it."""
        object.__setattr__(self, "stated", (owner, name))

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel by the name of the class, whose function may be a lambda."""
        if self.stated is not None:
            return getattr, self.stated
        return Rate, (self.parameter, self.euler)


@dataclass(frozen=True)
class PerturbedConservative(Law):
    """One degree of freedom in a potential, damped and driven.

    Attributes
    ----------
    base : Conservative
        The law of the potential.
    names : tuple of str
        All parameters, in the order of the values.
    inputs : tuple of str
        Those of the potential, as its law takes them.
    harmonics : int
        Number of harmonics of the forcing.
    modulated, drifting : tuple of str
        Parameters of the potential that vary.
    rate : Rate, optional
        The angular velocity of the frame, where the potential has one.
    prescribed : Any
        That angular velocity as a function or a table of time.
    unit : str
        Unit of the amplitude of the first harmonic, of the forcing or else of a modulation.
    torqued : bool
        Whether there is a constant torque, of which equations then tell.
    """

    called: ClassVar[str] = "a perturbed system, pk.Perturbed(system, damping=..., forcing=...)"

    base: Conservative | Routhian
    names: tuple[str, ...]
    inputs: tuple[str, ...]
    harmonics: int = 0
    modulated: tuple[str, ...] = ()
    drifting: tuple[str, ...] = ()
    rate: Rate | None = None
    prescribed: Any = field(default=None, compare=False)
    unit: str = "s-2"
    torqued: bool = field(default=True, compare=False)

    @property
    def may_be_incomplete(self) -> bool:
        """Whether equilibria of the potential may be missed."""
        return self.base.may_be_incomplete

    def check_searchable(self) -> None:
        """Refuse where equilibria of the potential cannot all be found."""
        self.base.check_searchable()

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity: as of the potential, but that the torque has a part in it."""
        words = dict(self.base.words(name, units, long_name))
        if self.torqued and name in _STANDING:
            words["equation"] = _STANDING[name]
        if name == "chaos_threshold" and self.unit != units:
            words["units"] = self.unit
        if name in _MOTION:
            words["equation"] = "phi'' + V'(phi; p(t)) = -d phi' - q |phi'| phi' + N + F(t)"
        return words

    def values(self, *arrays: Any) -> dict[str, Any]:
        """Values by name, as arrays; NaN where they leave their domain."""
        values = {n: np.asarray(x, float) for n, x in zip(self.names, arrays, strict=True)}
        domains: Mapping[str, tuple[float, float]] = getattr(self.base, "domains", {})
        least = {n: math.ulp(0.0) for n in self.names if n.endswith("_frequency")}
        bounds = {**domains, **{n: (low, math.inf) for n, low in least.items()}}
        bounds["kT"] = (0.0, math.inf)
        for name, (low, high) in bounds.items():
            if name in values:
                x = values[name]
                inside = np.isfinite(x) & (x >= low) & (x <= high)
                values[name] = x if inside.all() else np.where(inside, x, np.nan)
        return values

    def harmonic(self, values: Mapping[str, Any], names: tuple[str, ...]) -> tuple[Any, Any, Any]:
        """Amplitude, frequency and phase of a harmonic."""
        amplitude, frequency, phase = (values[name] for name in names)
        return amplitude, frequency, phase

    def forcing(self, values: Mapping[str, Any]) -> list[tuple[Any, Any, Any]]:
        """The harmonics of the forcing."""
        return [self.harmonic(values, forcing_names(i)) for i in range(self.harmonics)]

    def euler(self, values: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """(E0, Es, Ec) of the torque ``(E0 + Es sin phi + Ec cos phi) omega'(t)``."""
        return (0.0, 0.0, 0.0) if self.rate is None else self.rate.euler(values)


@dataclass(frozen=True)
class TiltedConservative(PerturbedConservative):
    """The same under a constant torque alone, which keeps an energy."""

    called: ClassVar[str] = "a system under a constant torque alone, pk.Perturbed(system, torque=)"

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity: the torque has a part in the energy."""
        words = dict(super().words(name, units, long_name))
        x = self.base.coordinate
        tilted = {
            "potential": f"{words.get('equation', 'V')} - torque {x}",
            "potential_gradient": "V' - torque",
            "energy_integral": f"h = {x}'^2/2 + V - torque {x}",
            "phase_velocity": f"{x}' = sqrt(2 (h - V + torque {x}))",
            **_turns(self.base.period),
        }
        return words | _tilted_words(name, words.get("long_name", long_name), tilted)


@dataclass(frozen=True)
class PerturbedRouthian(PerturbedConservative):
    """The same at constant momenta, where the inertia depends on the coordinate.

    ``M(x) x'' + M'(x) x'^2/2 + V'(x) = M0 (-d x' - q |x'| x' + N + sum F cos(nu t + phase))``,
    M0 being the inertia with all other coordinates held; energies are in J.
    """

    base: Routhian

    called: ClassVar[str] = "a perturbed system at a constant momentum"

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity: energies are no longer per unit of inertia."""
        words = dict(self.base.words(name, units, long_name))
        if self.torqued and name in _STEADY:
            words["equation"] = _STEADY[name]
        if name in _MOTION:
            words["equation"] = (
                "M phi'' + M' phi'^2/2 + V_p' = M22 (-d phi' - q |phi'| phi' + N + F(t))"
            )
        if name in _IN_JOULES:
            words["units"] = _IN_JOULES[name]
        return words


@dataclass(frozen=True)
class TiltedRouthian(PerturbedRouthian):
    """The same under a constant torque alone, which keeps an energy."""

    called: ClassVar[str] = "a system under a constant torque alone, pk.Perturbed(system, torque=)"

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity: the torque has a part in the energy."""
        words = dict(super().words(name, units, long_name))
        return words | ({"equation": _ROUTH[name]} if name in _ROUTH else {})


#: Equations of the equilibria under a torque, of a potential and at a constant momentum.
_STANDING = {
    "phi": "V'(phi) = torque",
    "energy": "V(phi) - torque phi",
    "n_equilibria": "changes of sign of V' - torque between the zeros of V''",
}
_AMENDED = "V + p^2/(2 M11) - M22 torque phi"
_STEADY = {
    "phi": "V' = p^2 M11'/(2 M11^2) + M22 torque",
    "energy": _AMENDED,
    "n_equilibria": "zeros of M11^2 (V' - M22 torque) - p^2 M11'/2",
}
#: Equations of what has a part of the torque in its energy.
_ROUTH = {
    "potential": _AMENDED,
    "potential_gradient": "V' - p^2 M11'/(2 M11^2) - M22 torque",
    "energy_integral": f"h = (M22 - M12^2/M11) phi'^2/2 + {_AMENDED}",
    "phase_velocity": f"phi' = sqrt(2 (h - ({_AMENDED}))/(M22 - M12^2/M11))",
}
_LEVELS = {
    "topology": "by what the separatrices of all saddles do",
    "figure_eight": "V - torque phi = h_s on both sides of a saddle, before a saddle as high",
    "saddle_phi": "V'(phi_s) = torque, V''(phi_s) < 0",
    "saddle_energy": "h_s = V(phi_s) - torque phi_s",
    "loop": "where V - torque phi = h_s again on either side of the saddle",
    "turning_phi": "V(phi_t) - torque phi_t = h_s",
    "orbit_kind": "sign of h - h_s; equilibrium: phi' = 0 and V'(phi) = torque",
    "orbit_energy": "h = phi'^2/2 + V(phi) - torque phi",
    "phi_min": "V(phi_min) - torque phi_min = h",
    "phi_max": "V(phi_max) - torque phi_max = h",
}


def _turns(period: float | None) -> dict[str, str]:
    """Equations of what a turn gains."""
    if period is None:
        return {"energy_per_turn": "no turn on a line", "gain_per_turn": "no turn on a line"}
    turn = "2 pi" if is_turn(period) else f"{period:g}"
    return {"energy_per_turn": f"{turn} torque", "gain_per_turn": f"{turn} |torque|"}


def _tilted_words(name: str, long_name: str, own: Mapping[str, str]) -> dict[str, str]:
    """Equation and long name of a quantity under a torque alone, beside what a law says itself."""
    equations = {**_LEVELS, **own}
    words = {"equation": equations[name]} if name in equations else {}
    if "NaN for a rotation" in long_name:
        words["long_name"] = f"{long_name}, infinite where it runs"
    return words


_MOTION = ("motion_phi", "motion_dphi")
#: Units of what is an energy or an action where that is not per unit of inertia.
_IN_JOULES = {
    "melnikov_mean": "J",
    "melnikov_amplitude": "J",
    "turnstile_area": "kg m2 s-1",
    "capture_flux": "J",
}


@dataclass(frozen=True)
class PerturbedTrigonometric(PerturbedConservative):
    """The same in the potential of (A, B, C)."""

    base: Trigonometric

    called: ClassVar[str] = (
        "a perturbed system with coefficients (A, B, C), pk.Perturbed(system, damping=...)"
    )
    labels_fixed: ClassVar[bool] = True
    default: ClassVar[Mapping[str, str]] = Trigonometric.default

    def coefficients(self, values: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """A, B and C."""
        return self.base.coefficients({name: values[name] for name in self.inputs})

    def derivatives(self, values: Mapping[str, Any], parameter: str) -> tuple[Any, Any, Any]:
        """Derivatives of A, B and C by a parameter, to rounding: of a complex step."""
        used = {name: np.asarray(values[name], complex) for name in self.inputs}
        step = 1e-100
        used[parameter] = used[parameter] + 1j * step
        *products, scale = self.base(used)
        dA, dB, dC = (np.imag(np.asarray(product / scale)) / step for product in products)
        return dA, dB, dC


@dataclass(frozen=True)
class TiltedTrigonometric(PerturbedTrigonometric):
    """The same under a constant torque alone, which keeps an energy."""

    called: ClassVar[str] = (
        "a system with coefficients (A, B, C) under a constant torque alone, "
        "pk.Perturbed(system, torque=)"
    )

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity: the torque has a part in the energy."""
        words = dict(super().words(name, units, long_name))
        return words | _tilted_words(name, words.get("long_name", long_name), TILTED)


_V = "-B cos(phi) + (A/2) cos(phi)^2 - C sin(phi) - torque phi"
#: Equations that the torque changes, by quantity.
TILTED = {
    "potential": f"V = {_V}",
    "potential_gradient": "V' = B sin(phi) - A sin(phi) cos(phi) - C cos(phi) - torque",
    "energy_integral": f"h = phi'^2/2 + ({_V})",
    "orbit_energy": f"h = phi'^2/2 + ({_V})",
    "phase_velocity": "phi' = sqrt(2 (h - V(phi) + torque phi))",
    "motion_phi": "phi'' = -V'(phi) + torque",
    "motion_dphi": "phi'' = -V'(phi) + torque",
}
