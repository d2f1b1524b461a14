"""A system with damping and drive: what is added to a potential, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, NoReturn, Self

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labels.arguments import (
    NumberLike,
    Value,
    brief,
    describe,
    named_arguments,
    same,
    unknown,
)
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Flow, Law, Standing, Trait
from phasekit.laws.perturbed import OWN, PerturbedLaw, drift_name, forcing_names, modulation_names
from phasekit.laws.terms import Own
from phasekit.spellings import refused
from phasekit.systems import perturbed_parts as parts
from phasekit.systems.as_equations import equations_in_results
from phasekit.systems.bases import named_model
from phasekit.systems.harmonic import Harmonic
from phasekit.systems.identity import MODEL, parameter_values, refuse_another
from phasekit.systems.parameter import Parameter
from phasekit.systems.system import MODELS, System
from phasekit.systems.term import Term


class Perturbed(System):
    """A system with damping and drive.

    ``phi'' + V'(phi; p(t)) = -damping phi' - quadratic |phi'| phi' + torque
    + sum F cos(nu t + phase)``, all per unit of inertia, where V is the potential of the system.

    Parameters
    ----------
    system : system
        Any system in a potential: a disk, an analogue, a `Potential`; or a `FreeGyroRotor`, at the
        momentum that it keeps.
    damping : float, 1-D array_like or xarray.DataArray, default 0.0
        Linear damping in s^-1; negative: it drives the motion.
    quadratic : float or array_like, default 0.0
        Quadratic ("turbulent") damping, a pure number; negative: it drives the motion.
    torque : float or array_like, default 0.0
        Constant torque in s^-2.
    forcing : Harmonic or sequence of Harmonic, optional
        Torque that varies with time, in s^-2: a harmonic or the sum of several.
    modulation : mapping of str to Harmonic, optional
        Parameters of the system that vary, ``p(t) = p + amplitude cos(frequency t + phase)``, the
        amplitude in the unit of the parameter.
    drift : mapping of str to float or array_like, optional
        Parameters of the system that change slowly, ``p(t) = p + rate t``, by their rates.
    omega1 : callable or (times, values), optional
        The angular velocity omega1 of a disk's support as a function of time, or as a table, in s
        and s^-1.
    kT : float or array_like, default 0.0
        Thermal energy in s^-2 of the white noise ``sqrt(2 damping kT) xi(t)``, >= 0.
    terms : Term or sequence of Term, optional
        Forces of one's own, per unit of inertia: formulas or functions of time and state, with
        parameters, and states, of their own.

    Attributes
    ----------
    system : System
    damping, quadratic, torque, kT : Value
    forcing : tuple of Harmonic
    modulation, drift : dict
        By the name of the parameter.
    omega1 : callable, (times, values) or None
    terms : tuple of Term

    Raises
    ------
    ParameterError
        If the system is none in a potential or at a momentum, or perturbed already, or an argument
        is unusable.

    Notes
    -----
    All values are parameters and sweep like those of the system: ``damping``, ``quadratic``,
    ``torque``, ``kT``; ``forcing_amplitude``, ``forcing_frequency`` and ``forcing_phase``, of
    further harmonics ``forcing2_amplitude`` and so on; ``modulation_<p>_amplitude`` ... and
    ``drift_<p>`` of a parameter p.

    Where the angular velocity omega1 of a disk's support varies, its change is felt as the torque
    ``-omega1' kappa cos phi``, ``kappa = (r^2 + 4 e^2) sin beta cos beta/N``, which replacing
    omega1 by omega1(t) in [Veljovic2015] (12) would lose; likewise the Euler force of a
    `ParticleOnCircle`.

    Of a `FreeGyroRotor` damping and drive act about the disk's shaft alone, between disk and
    support, per unit of the inertia M22 about it: the momentum p about the vertical stays, while
    the support's speed ``(p - M12 phi')/M11`` changes, and phi moves by itself, exactly, as
    ``M phi'' + M' phi'^2/2 + V_p' = M22 (-damping phi' - quadratic |phi'| phi' + torque + ...)``
    with ``M = M22 - M12^2/M11`` and the amended potential ``V_p = V + p^2/(2 M11)``. Energies are
    in J. Modulation, drift and a prescribed omega1 would change the momentum and are refused.

    Examples
    --------
    >>> import phasekit as pk
    >>> pendulum = pk.Pendulum(length=1.0, g=1.0)
    >>> damped = pk.Perturbed(pendulum, damping=0.1, forcing=pk.Harmonic(0.5, 2.0))
    >>> damped
    Perturbed(Pendulum(length=1.0, g=1.0), damping=0.1, forcing=Harmonic(amplitude=0.5,
    frequency=2.0))
    >>> damped.replace(damping=-0.1, forcing_amplitude=0.0).damping
    -0.1
    >>> list(damped.parameters)[-3:]
    ['forcing_amplitude', 'forcing_frequency', 'forcing_phase']
    """

    declared: ClassVar[tuple[Parameter, ...]] = ()
    rung: ClassVar[type[Law]] = Flow

    system: System
    damping: Value
    quadratic: Value
    torque: Value
    kT: Value
    forcing: tuple[Harmonic, ...]
    modulation: Mapping[str, Harmonic]
    drift: Mapping[str, Value]
    omega1: Any
    terms: tuple[Term, ...]
    traits: Trait
    _own: tuple[Own, ...]

    def __init__(
        self,
        system: Any,
        *,
        damping: NumberLike = 0.0,
        quadratic: NumberLike = 0.0,
        torque: NumberLike = 0.0,
        forcing: Harmonic | Sequence[Harmonic] | None = None,
        modulation: Mapping[str, Harmonic] | None = None,
        drift: Mapping[str, NumberLike] | None = None,
        omega1: Callable[[float], float] | tuple[Any, Any] | None = None,
        kT: NumberLike = 0.0,
        terms: Term | Sequence[Term] | None = None,
    ) -> None:
        base = parts.base_of(system)
        parts.refuse_varying(base, modulation=modulation, drift=drift, omega1=omega1)
        given = {"damping": damping, "quadratic": quadratic, "torque": torque, "kT": kT}
        own = {p.name: p.check(given[p.name]) for p in parts.OWN}
        drive = parts.Drive(base, forcing, modulation, drift)
        kept, laws = parts.own_terms(terms, base)
        declared = [parts.with_words(p, own[p.name]) for p in parts.OWN] + drive.declared
        declared += [p for term in kept for p in term.declared]
        parts.refuse_taken(base, declared)
        varying = {*drive.modulation, *drive.drift}
        values = {
            "system": base,
            **own,
            "forcing": drive.forcing,
            "modulation": MappingProxyType(drive.modulation),
            "drift": MappingProxyType(drive.drift),
            "omega1": parts.prescribed(omega1, base, varying),
            "declared": (*base.declared, *declared),
            "terms": kept,
            "traits": parts.traits_of(own, bool(drive.declared) or omega1 is not None, laws),
            "_own": laws,
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Refuse: a system does not change."""
        raise AttributeError(f"a Perturbed is frozen; use .replace({name}=...)")

    def __getattr__(self, name: str) -> Any:
        """Return the value of a parameter."""
        if not name.startswith("_") and "omega1" in self.__dict__:
            values = self.parameters
            if name in values:
                return values[name]
        return refused(self, name)

    @property
    def coordinate(self) -> str:
        """Name of the coordinate."""
        return self.system.coordinate or "phi"

    @property
    def parameters(self) -> dict[str, Value]:
        """All parameters by name: those of the system, and those of damping and drive."""
        values: dict[str, Value] = dict(self.system.parameters)
        values.update({name: getattr(self, name) for name in OWN})
        for i, harmonic in enumerate(self.forcing):
            values.update(zip(forcing_names(i), harmonic.values, strict=True))
        for name, harmonic in self.modulation.items():
            values.update(zip(modulation_names(name), harmonic.values, strict=True))
        values.update({drift_name(name): rate for name, rate in self.drift.items()})
        for term in self.terms:
            values.update(term.parameters)
        return values

    @property
    def standing(self) -> Standing:
        """Where its law stands: the rung of the system's, and the traits of the terms."""
        return Standing(self.system.rung, self.traits)

    @property
    def law(self) -> PerturbedLaw:
        """The law of the system, and the terms that are added to it."""
        base: Any = self.system.law_of_parameters
        known = self.system.parameters
        return PerturbedLaw(
            base=base,
            names=tuple(self.parameters),
            inputs=tuple(name for name in self.system.formula_inputs() if name in known),
            terms=parts.terms_of(
                len(self.forcing), self.modulation, self.drift, self.omega1, self._own
            ),
            rate=self.system.frame_rate,
            unit=self._driven_unit(),
            traits=self.traits,
        )

    def equations(self) -> Equations:
        """The law as first-order equations of phi, dphi and the states of its terms.

        Returns
        -------
        Equations
            Formulas, or a function where a term is one.

        Raises
        ------
        ParameterError
            If a force jumps, or omega1 is prescribed beside a force that is no formula.
        """
        return equations_in_results(self)

    def _driven_unit(self) -> str:
        modulated = [p.units for p in self.system.declared if p.name in list(self.modulation)[:1]]
        return modulated[0] if modulated and not self.forcing else "s-2"

    def formula_inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the parameters of the potential."""
        return self.system.formula_inputs()

    def unit_of(self, name: str) -> str | None:
        """Unit of a parameter or state; None where it may be any."""
        units = {p.name: p.units for p in self.declared if p not in self.system.declared}
        return units.get(name) or self.system.unit_of(name)

    def coefficients(self) -> Any:
        """Coefficients (A, B, C) of the potential, in s^-2, without damping and drive."""
        return self.system.coefficients()

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed, or system, forcing, modulation, ...

        Parameters
        ----------
        **changes
            New values by name: of parameters, and of the arguments of the class.
        """
        made = {name: changes.pop(name, value) for name, value in self.arguments.items()
                if name != "omega1"}  # fmt: skip
        base = parts.base_of(made.pop("system"))
        if "omega1" in changes and not parts.is_number_like(changes["omega1"]):
            made["omega1"] = changes.pop("omega1")
        else:
            made["omega1"] = self.omega1
        valid = [*base.parameters, *(p.name for p in base.declared), *self.parameters]
        for name in changes:
            if name not in valid:
                raise unknown("parameter of Perturbed", name, [*valid, *self.arguments])
        own = parts.parameters_of_drive(made, changes)
        if changes:
            base = base.replace(**changes)
        return type(self)(base, **own)

    @property
    def arguments(self) -> dict[str, Any]:
        """The keyword arguments that rebuild it."""
        names = ("system", *OWN, "forcing", "modulation", "drift", "omega1", "terms")
        own = {name: getattr(self, name) for name in names}
        return {**own, "modulation": dict(self.modulation), "drift": dict(self.drift)}

    @property
    def definition(self) -> dict[str, str]:
        """What maps store beside the parameters' values."""
        prescribed = {} if self.omega1 is None else {"phasekit_prescribed": "omega1"}
        return {
            **prescribed,
            **self.system.definition,
            "phasekit_perturbed": type(self.system).__name__,
            "phasekit_forcing": str(len(self.forcing)),
            "phasekit_modulation": " ".join(self.modulation),
            "phasekit_drift": " ".join(self.drift),
            **({"phasekit_terms": parts.stored(self.terms)} if self.terms else {}),
        }

    @classmethod
    def from_dataset(cls, ds: xr.Dataset) -> Self:
        """Rebuild the system from a map, or from any selection of it.

        Raises
        ------
        ParameterError
            If the map was made with another model, a parameter's coordinate is gone, or the
            attributes that hold what is perturbed are damaged.
        """
        refuse_another(ds, cls.__name__)
        if "phasekit_prescribed" in ds.attrs:
            raise ParameterError(
                "ds: got results of a system whose omega1 is a function or table of time, which "
                "is not stored with them; make the system again: pk.Perturbed(disk, omega1=...)"
            )
        name, number, modulated, drifting = (
            parts.attribute(ds, key) for key in ("perturbed", "forcing", "modulation", "drift")
        )
        base = named_model("ds", name).from_dataset(ds.assign_attrs({MODEL: name}))

        def read(*names: str) -> list[Any]:
            wanted = [Parameter(name=one, units="1", long_name=one) for one in names]
            return list(parameter_values(ds, wanted).values())

        return cls(
            base,
            **dict(zip(OWN, read(*OWN), strict=True)),
            forcing=[Harmonic(*read(*forcing_names(i))) for i in range(int(number))],
            modulation={p: Harmonic(*read(*modulation_names(p))) for p in modulated.split()},
            drift={p: read(drift_name(p))[0] for p in drifting.split()},
            terms=parts.restored(ds, lambda names: dict(zip(names, read(*names), strict=True))),
        )

    def __reduce__(self) -> Any:
        """Pickle what it was made from."""
        return _rebuild, (self.arguments,)

    def __repr__(self) -> str:
        """Write the system, and what is not zero; negative damping is named as driving."""
        shown = [repr(self.system)]
        for name in OWN:
            value = getattr(self, name)
            if not (isinstance(value, float) and value == 0.0):
                negative = name in parts.DRIVES and isinstance(value, float) and value < 0.0
                shown.append(f"{name}={brief(value)}{' (driving)' if negative else ''}")
        if self.forcing:
            one = len(self.forcing) == 1
            shown.append(f"forcing={self.forcing[0] if one else list(self.forcing)!r}")
        if self.modulation:
            shown.append(f"modulation={dict(self.modulation)!r}")
        if self.drift:
            rates = ", ".join(f"{name!r}: {brief(rate)}" for name, rate in self.drift.items())
            shown.append(f"drift={{{rates}}}")
        if self.omega1 is not None:
            shown.append(f"omega1={describe(self.omega1)}")
        if self.terms:
            shown.append(f"terms={list(self.terms)!r}")
        return f"Perturbed({', '.join(shown)})"

    def __eq__(self, other: object) -> bool:
        """Whether system, damping and drive are equal; NaN equals NaN."""
        if not isinstance(other, Perturbed):
            return NotImplemented
        mine, theirs = self.parameters, other.parameters
        return (
            self.system == other.system
            and list(mine) == list(theirs)
            and all(same(mine[name], theirs[name]) for name in mine)
            and parts.same_prescribed(self.omega1, other.omega1)
            and self.terms == other.terms
        )

    def __hash__(self) -> int:
        """Hash of system, damping and drive; one that holds DataArrays has none."""
        own = list(self.parameters.items())[len(self.system.parameters) :]
        keys = ((k, (v + 0.0).tobytes() if isinstance(v, np.ndarray) else v) for k, v in own)
        return hash(("Perturbed", self.system, *keys))


Perturbed.__init__ = named_arguments("Perturbed", Perturbed.__init__)  # type: ignore[method-assign]
MODELS["Perturbed"] = Perturbed


def _rebuild(arguments: dict[str, Any]) -> Perturbed:
    return Perturbed(**arguments)
