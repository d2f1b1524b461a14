"""The law of a base with terms: damping, torque, drive and noise added to a potential."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.laws.ladder import PERTURBED, Conservative, Law, Routhian, Standing, Trait, is_turn
from phasekit.laws.terms import (
    Drift,
    Forcing,
    Instant,
    Modulation,
    Own,
    Prescribed,
    Rate,
    Term,
    drift_name,
    forcing_names,
    modulation_names,
)
from phasekit.laws.trigonometric import Trigonometric

#: Equations of the motion, of a potential and at a constant momentum.
_MOTION = ("motion_phi", "motion_dphi")
_MOVED = "phi'' + V'(phi; p(t)) = -d phi' - q |phi'| phi' + N + F(t)"
_MOVED_AT_MOMENTUM = "M phi'' + M' phi'^2/2 + V_p' = M22 (-d phi' - q |phi'| phi' + N + F(t))"

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
#: Units of what is an energy or an action where that is not per unit of inertia.
_IN_JOULES = {
    "melnikov_mean": "J",
    "melnikov_amplitude": "J",
    "turnstile_area": "kg m2 s-1",
    "capture_flux": "J",
}
#: Equations of what has a part of the torque in its energy, at a constant momentum.
_ROUTH = {
    "potential": _AMENDED,
    "potential_gradient": "V' - p^2 M11'/(2 M11^2) - M22 torque",
    "energy_integral": f"h = (M22 - M12^2/M11) phi'^2/2 + {_AMENDED}",
    "phase_velocity": f"phi' = sqrt(2 (h - ({_AMENDED}))/(M22 - M12^2/M11))",
}
#: The same in any potential.
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
_V = "-B cos(phi) + (A/2) cos(phi)^2 - C sin(phi) - torque phi"
#: The same in the potential of (A, B, C).
_TRIGONOMETRIC = {
    "potential": f"V = {_V}",
    "potential_gradient": "V' = B sin(phi) - A sin(phi) cos(phi) - C cos(phi) - torque",
    "energy_integral": f"h = phi'^2/2 + ({_V})",
    "orbit_energy": f"h = phi'^2/2 + ({_V})",
    "phase_velocity": "phi' = sqrt(2 (h - V(phi) + torque phi))",
    "motion_phi": "phi'' = -V'(phi) + torque",
    "motion_dphi": "phi'' = -V'(phi) + torque",
}


def words_of(base: Law, traits: Trait, unit: str, row: tuple[str, str, str]) -> dict[str, str]:
    """What is said of a row, its name, units and long name, of a base with terms.

    The unit is that of the amplitude of the first harmonic.
    """
    name, units, long_name = row
    words = dict(base.words(name, units, long_name))
    at_momentum = isinstance(base, Routhian)
    if Trait.TORQUED in traits:
        rest = _STEADY if at_momentum else _STANDING
        words |= {"equation": rest[name]} if name in rest else {}
    if name in _MOTION:
        words["equation"] = _MOVED_AT_MOMENTUM if at_momentum else _MOVED
    if at_momentum:
        words |= {"units": _IN_JOULES[name]} if name in _IN_JOULES else {}
    elif name in ("chaos_threshold", "chaos_threshold_error") and unit != units:
        words["units"] = unit
    if traits not in Trait.TORQUED:
        return words
    if at_momentum:
        return words | ({"equation": _ROUTH[name]} if name in _ROUTH else {})
    equations = {**_LEVELS, **_of_base(base, words)}
    words |= {"equation": equations[name]} if name in equations else {}
    told = words.get("long_name", long_name)
    return words | (
        {"long_name": f"{told}, infinite where it runs"} if "NaN for a rotation" in told else {}
    )


def _of_base(base: Law, words: dict[str, str]) -> dict[str, str]:
    """Equations under a torque alone that depend on the potential and its circle."""
    if base.labels_fixed:
        return _TRIGONOMETRIC
    x, period = base.coordinate, base.period  # type: ignore[attr-defined]
    turn = "2 pi" if is_turn(period) else f"{period:g}" if period is not None else ""
    return {
        "potential": f"{words.get('equation', 'V')} - torque {x}",
        "potential_gradient": "V' - torque",
        "energy_integral": f"h = {x}'^2/2 + V - torque {x}",
        "phase_velocity": f"{x}' = sqrt(2 (h - V + torque {x}))",
        "energy_per_turn": f"{turn} torque" if turn else "no turn on a line",
        "gain_per_turn": f"{turn} |torque|" if turn else "no turn on a line",
    }


__all__ = [
    "OWN", "PerturbedConservative", "PerturbedLaw", "drift_name", "forcing_names",
    "modulation_names",
]  # fmt: skip

#: Parameters of the terms that every perturbed law has, in their order among the values.
OWN = ("damping", "quadratic", "torque", "kT")


@dataclass(frozen=True)
class PerturbedLaw(Law):
    """One degree of freedom in a potential, or at constant momenta, and the terms added to it.

    At constant momenta, where the inertia M depends on the coordinate, terms are per unit of the
    inertia M0 with all other coordinates held: ``M(x) x'' + M'(x) x'^2/2 + V'(x) = M0 (terms)``;
    energies are in J.
    """

    #: The law without the terms.
    base: Conservative | Routhian
    #: All parameters, in the order of the values.
    names: tuple[str, ...]
    #: Those of the base, as its law takes them.
    inputs: tuple[str, ...]
    #: What is added.
    terms: tuple[Term, ...]
    #: The angular velocity of the frame, where the base has one.
    rate: Rate | None = None
    #: Unit of the amplitude of the first harmonic, of the forcing or else of a modulation.
    unit: str = "s-2"
    #: What the terms bring in where their values are not zero.
    traits: Trait = field(default=PERTURBED, compare=False)

    @property
    def standing(self) -> Standing:
        """The rung of the base, and the traits of the terms."""
        return Standing(type(self.base), self.traits)

    @property
    def called(self) -> str:  # type: ignore[override]
        """What messages call a system with such a law."""
        return self.standing.called

    @property
    def may_be_incomplete(self) -> bool:
        """Whether equilibria of the base may be missed."""
        return self.base.may_be_incomplete

    def check_searchable(self) -> None:
        """Refuse where equilibria of the base cannot all be found."""
        self.base.check_searchable()

    def words(self, name: str, units: str, long_name: str) -> Mapping[str, str]:
        """What is said of a quantity: as of the base, but for what the terms have a part in."""
        return words_of(self.base, self.traits, self.unit, (name, units, long_name))

    # ------------------------------------------------------------------ terms

    def _terms(self, kind: type[Term]) -> tuple[Any, ...]:
        return tuple(term for term in self.terms if isinstance(term, kind))

    @property
    def harmonics(self) -> int:
        """Number of harmonics of the forcing."""
        return len(self._terms(Forcing))

    @property
    def modulated(self) -> tuple[str, ...]:
        """Parameters of the base that harmonics are added to."""
        return tuple(term.varies for term in self._terms(Modulation))

    @property
    def drifting(self) -> tuple[str, ...]:
        """Parameters of the base that drift."""
        return tuple(term.varies for term in self._terms(Drift))

    @property
    def prescribed(self) -> Any:
        """The function or table of time that a parameter is, or None."""
        return next((term.function for term in self._terms(Prescribed)), None)

    @property
    def own(self) -> tuple[Own, ...]:
        """Terms of one's own."""
        return self._terms(Own)

    @property
    def states(self) -> tuple[str, ...]:
        """States of the terms, beside coordinate and rate."""
        return tuple(name for term in self.terms for name in term.states)

    def frequencies(self) -> list[Any] | None:
        """What varies in time by its angular frequency: formulas of the parameters.

        None where something varies that has no period.
        """
        import sympy as sp

        from phasekit.laws.formulas import symbols_of

        found: list[Any] = []
        for term in self.terms:
            if isinstance(term, (Drift, Prescribed)):
                return None
            if isinstance(term, (Forcing, Modulation)):
                found.append(symbols_of(term.names[1:2])[term.names[1]])
            elif isinstance(term, Own) and Trait.DRIVEN in term.trait:
                if term.period is None:
                    return None
                found.append(2 * sp.pi / term.period)
        return found

    def own_frequencies(self, values: Mapping[str, Any]) -> list[Any]:
        """Angular frequencies of terms of one's own that vary with time; NaN without a period."""
        driven, found = [t for t in self.own if Trait.DRIVEN in t.trait], list[Any]()
        if not driven:
            return found
        import sympy as sp

        from phasekit.laws.formulas import symbols_of

        of = symbols_of(self.names)
        for term in driven:
            if term.period is None:
                found.append(np.array(np.nan))
                continue
            used = [name for name in self.names if of[name] in term.period.free_symbols]
            function = sp.lambdify([of[name] for name in used], 2 * sp.pi / term.period, "numpy")
            found.append(np.asarray(function(*(values[name] for name in used)), float))
        return found

    @property
    def varying(self) -> frozenset[str]:
        """Parameters of the base that vary with time."""
        return frozenset(term.varies for term in self.terms if term.varies is not None)

    def parameter_at(self, name: str, at: Instant) -> Any:
        """A parameter of the base as a formula of the time, where it varies."""
        value = at.parameter(name)
        for term in self.terms:
            if term.varies == name:
                value = term.moved(value, at)
        return value

    def force(self, at: Instant, kinds: tuple[type[Term], ...] = (Term,)) -> Any:
        """The sum of the forces of terms of some kinds, per unit of inertia, as a formula."""
        moving = replace(
            at,
            parameter=lambda n: self.parameter_at(n, at) if n in self.inputs else at.parameter(n),
        )
        return sum(
            term.force(moving if isinstance(term, Own) else at)
            for term in self.terms
            if isinstance(term, kinds)
        )

    def euler_formula(self, at: Instant, parts: tuple[str, ...]) -> Any:
        """The torque of the change of the frame's angular velocity, its parts by names."""
        import sympy as sp

        if self.rate is None:
            return 0
        change = sum(term.change(at) for term in self.terms if term.varies == self.rate.parameter)
        if change == 0:
            return 0
        if others := self.varying - {self.rate.parameter}:
            raise ParameterError(
                f"modulation, drift: got {', '.join(sorted(others))} beside {self.rate.parameter}, "
                f"wants {self.rate.parameter} alone or not at all: its change is a torque that "
                "depends on the others, which is not integrated"
            )
        still, sine, cosine = map(at.parameter, parts)
        return (still + sine * sp.sin(at.x) + cosine * sp.cos(at.x)) * change

    # ------------------------------------------------------------------ values

    def values(self, *arrays: Any) -> dict[str, Any]:
        """Values by name, as arrays; NaN where they leave their domain."""
        values = {n: np.asarray(x, float) for n, x in zip(self.names, arrays, strict=True)}
        domains: Mapping[str, tuple[float, float]] = getattr(self.base, "domains", {})
        least = {n: math.ulp(0.0) for n in self.names if n.endswith("_frequency")}
        bounds = {**domains, **{n: (low, math.inf) for n, low in least.items()}}
        bounds["kT"] = (0.0, math.inf)
        for term in self._terms(Own):
            bounds |= {name: (low, high) for name, low, high in term.domains}
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
        return [self.harmonic(values, term.names) for term in self._terms(Forcing)]

    def euler(self, values: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """(E0, Es, Ec) of the torque ``(E0 + Es sin phi + Ec cos phi) omega'(t)``."""
        if self.rate is None:
            return (0.0, 0.0, 0.0)
        with np.errstate(all="ignore"):  # where there is no inertia
            return self.rate.euler(values)

    def coefficients(self, values: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """A, B and C of a trigonometric base."""
        return self._trigonometric.coefficients({name: values[name] for name in self.inputs})

    def derivatives(self, values: Mapping[str, Any], parameter: str) -> tuple[Any, Any, Any]:
        """Derivatives of A, B and C by a parameter, to rounding: of a complex step."""
        used = {name: np.asarray(values[name], complex) for name in self.inputs}
        step = 1e-100
        used[parameter] = used[parameter] + 1j * step
        *products, scale = self._trigonometric(used)
        dA, dB, dC = (np.imag(np.asarray(product / scale)) / step for product in products)
        return dA, dB, dC

    @property
    def _trigonometric(self) -> Trigonometric:
        assert isinstance(self.base, Trigonometric)
        return self.base


#: The name by which modules of motions know it.
PerturbedConservative = PerturbedLaw
