"""What damping and drive of a system may be: checks of the arguments, and their parameters."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labels.arguments import Value, bad, describe, reals, unknown
from phasekit.laws import terms as laws
from phasekit.laws.ladder import Conservative, Routhian, Trait
from phasekit.laws.perturbed import drift_name, forcing_names, modulation_names
from phasekit.systems.harmonic import Harmonic
from phasekit.systems.parameter import Parameter
from phasekit.systems.system import System, as_system
from phasekit.systems.term import Term, law_of, term_of

OWN = (
    Parameter(name="damping", units="s-1", long_name="linear damping"),
    Parameter(name="quadratic", units="1", long_name="quadratic damping"),
    Parameter(name="torque", units="s-2", long_name="constant torque per unit of inertia"),
    Parameter(
        name="kT", units="s-2", long_name="thermal energy per unit of inertia, of noise", low=0.0
    ),
)
#: What these are where they are negative.
DRIVES = {
    "damping": "linear driving (negative damping)",
    "quadratic": "quadratic driving (negative damping)",
}


def base_of(system: Any) -> System:
    """Return the system that is perturbed."""
    found = as_system(system)
    wants = "a system in a potential: a disk, an analogue, a pk.Potential, a pk.FreeGyroRotor"
    if found.standing.traits is not None:
        raise bad("system", found, wants, "it is perturbed already; use .replace(...)")
    if not issubclass(found.rung, (Conservative, Routhian)):
        raise bad("system", found, wants, "damping and forces of equations are parts of formulas")
    return found


def refuse_varying(base: System, **arguments: Any) -> None:
    """Refuse to vary parameters of a system that is perturbed at a constant momentum."""
    if not issubclass(base.rung, Routhian):
        return
    for name, value in arguments.items():
        if value is not None and not (isinstance(value, Mapping) and not value):
            hint = (
                "what is perturbed is the motion at a momentum that stays, of which omega1 follows;"
                " rotor.simulate(..., torque1=...) takes torques on the support"
            )
            raise bad(name, value, f"nothing, of a {type(base).__name__}", hint)


def own_terms(terms: Any, base: System) -> tuple[tuple[Term, ...], tuple[laws.Own, ...]]:
    """Terms of one's own, as they are and in the law of a system."""
    several = terms if isinstance(terms, (list, tuple)) else () if terms is None else (terms,)
    taken: set[str] = set()
    for one in several:
        if not isinstance(one, Term):
            raise bad("terms", one, "a pk.Term(...), or a list of them")
        for name in (*(p.name for p in one.declared), *one.states):
            if name in taken:
                raise bad("terms", name, "names that differ from term to term")
            taken.add(name)
    kept = tuple(several)
    return kept, tuple(law_of(one, base, f"terms[{i}]") for i, one in enumerate(kept))


def traits_of(own: Mapping[str, Any], driven: bool, terms: Sequence[laws.Own]) -> Trait:
    """What terms bring in, for all values: those of numbers that are zero bring in nothing."""
    found = Trait.DRIVEN if driven else Trait(0)
    for one in terms:
        found |= one.trait
    for term in laws.STANDARD:
        (name,) = term.names
        if not (isinstance(own[name], float) and own[name] == 0.0):
            found |= term.trait
    # Noise is that of the damping.
    return found if Trait.DAMPED in found else found & ~Trait.NOISY


def terms_of(
    harmonics: int, modulated: Any, drifting: Any, prescribed: Any, own: Sequence[laws.Own]
) -> tuple[laws.Term, ...]:
    """All terms, in the order in which their forces are added."""
    terms = [*laws.STANDARD, *(laws.Forcing(forcing_names(i)) for i in range(harmonics))]
    if prescribed is not None:
        terms.append(laws.Prescribed((), "omega1", prescribed))
    terms += [laws.Modulation(modulation_names(name), name) for name in modulated]
    terms += [laws.Drift((drift_name(name),), name) for name in drifting]
    return (*terms, *own)


class Drive:
    """Harmonics and rates of a system, checked, with the parameters that they are.

    >>> import phasekit as pk
    >>> Drive(pk.Pendulum(length=1.0), None, None, {"length": 0.01}).declared[0].units
    'm s-1'
    """

    def __init__(self, base: System, forcing: Any, modulation: Any, drift: Any) -> None:
        self.declared: list[Parameter] = []
        units = {p.name: p.units for p in base.declared}
        self.forcing = tuple(
            self._harmonic(
                one,
                forcing_names(i),
                "s-2",
                "the forcing" if i == 0 else f"harmonic {i + 1} of the forcing",
            )
            for i, one in enumerate(_harmonics(forcing))
        )
        self.modulation = {
            name: self._harmonic(
                _harmonic(f"modulation: {name}", one),
                modulation_names(name),
                units[name],
                f"the modulation of {name}",
            )
            for name, one in _by_parameter("modulation", modulation, base)
        }
        self.drift: dict[str, Value] = {}
        for name, rate in _by_parameter("drift", drift, base):
            one = Parameter(
                name=drift_name(name),
                units=per_second(units[name]),
                long_name=f"rate at which {name} drifts",
            )
            self.drift[name] = one.check(rate)
            self.declared.append(one)

    def _harmonic(
        self, harmonic: Harmonic, names: Sequence[str], units: str, words: str
    ) -> Harmonic:
        amplitude, frequency, phase = (
            Parameter(name=names[0], units=units, long_name=f"amplitude of {words}"),
            Parameter(
                name=names[1],
                units="s-1",
                long_name=f"angular frequency of {words}",
                positive=True,
            ),
            Parameter(name=names[2], units="rad", long_name=f"phase of {words} at t = 0"),
        )
        self.declared += [amplitude, frequency, phase]
        checked: list[Any] = [
            p.check(x) for p, x in zip((amplitude, frequency, phase), harmonic.values, strict=True)
        ]
        return Harmonic(*checked)


def _harmonics(forcing: Any) -> tuple[Harmonic, ...]:
    if forcing is None:
        return ()
    several = forcing if isinstance(forcing, (list, tuple)) else [forcing]
    return tuple(_harmonic("forcing", one) for one in several)


def _harmonic(argument: str, harmonic: Any) -> Harmonic:
    if not isinstance(harmonic, Harmonic):
        wants = "a pk.Harmonic(amplitude, frequency, phase)"
        raise bad(argument, harmonic, wants + (", or a list of them" * (argument == "forcing")))
    return harmonic


def _by_parameter(argument: str, given: Any, base: System) -> list[tuple[str, Any]]:
    """Return what is given by parameter of the equation of motion."""
    if given is None:
        return []
    if not isinstance(given, Mapping):
        raise bad(argument, given, "a mapping of names of the system's parameters")
    names = list(base.formula_inputs())
    for name in given:
        if name not in names:
            raise unknown(f"{argument}: parameter of the equation of motion", name, names)
    return list(given.items())


def per_second(units: str) -> str:
    """Return the unit of a rate, as the table spells it.

    >>> per_second("m s-2"), per_second("rad"), per_second("1"), per_second("kg")
    ('m s-3', 's-1', 's-1', 'kg s-1')
    """
    parts = [part for part in units.split() if part not in ("1", "rad")]
    power = next((int(part[1:]) for part in parts if part[:2] == "s-"), 0)
    return " ".join([part for part in parts if part[:2] != "s-"] + [f"s{power - 1}"])


def with_words(parameter: Parameter, value: Value) -> Parameter:
    """Return a parameter; one of damping that drives is called so."""
    words = DRIVES.get(parameter.name)
    if words is None or not isinstance(value, float) or value >= 0.0:
        return parameter
    return dataclasses.replace(parameter, long_name=words)


def refuse_taken(base: System, declared: Sequence[Parameter]) -> None:
    """Refuse a system with parameters that are named as those of damping and drive."""
    own = {p.name for p in base.declared}
    for parameter in declared:
        if parameter.name in own:
            raise ParameterError(
                f"system: got a parameter named {parameter.name!r}, wants another name, because "
                f"pk.Perturbed has {parameter.name!r}"
            )


def is_number_like(value: Any) -> bool:
    """Whether a value of omega1 is one of the disk's parameter, and no function of time."""
    if isinstance(value, tuple):
        return len(value) != 2 or np.ndim(value[0]) == 0
    return value is not None and not callable(value)


def prescribed(omega1: Any, base: System, varying: set[str]) -> Any:
    """Return omega1 as a function of time, or as a table of two read-only arrays."""
    if omega1 is None:
        return None
    wants = "a function of time, or a table (times, values)"
    if "omega1" not in {p.name for p in base.declared}:
        raise bad("omega1", omega1, f"None for a {type(base).__name__}, which has no omega1")
    if "omega1" in varying:
        raise bad("omega1", omega1, "one law: omega1= or its modulation or drift")
    if callable(omega1):
        return omega1
    if not isinstance(omega1, tuple) or len(omega1) != 2:
        raise bad("omega1", omega1, wants)
    times, values = (reals("omega1", column, wants).astype(np.float64) for column in omega1)
    if times.ndim != 1 or times.shape != values.shape or times.size < 2:
        raise bad("omega1", omega1, "two 1-D arrays of equal length, 2 or more: (times, values)")
    if not (np.isfinite(times).all() and np.isfinite(values).all() and (np.diff(times) > 0).all()):
        raise bad("omega1", omega1, "finite values at times that increase")
    for column in (times, values):
        column.flags.writeable = False
    return times, values


def same_prescribed(left: Any, right: Any) -> bool:
    """Whether two functions or tables of time are equal."""
    if isinstance(left, tuple) and isinstance(right, tuple):
        return all(np.array_equal(x, y) for x, y in zip(left, right, strict=True))
    return not isinstance(left, tuple) and not isinstance(right, tuple) and bool(left == right)


def parameters_of_drive(arguments: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `Perturbed` with changed parameters, which are taken out."""

    def harmonic(old: Any, names: Sequence[str]) -> Any:
        if not isinstance(old, Harmonic) or changes.keys().isdisjoint(names):
            return old
        return Harmonic(*(changes.pop(n, x) for n, x in zip(names, old.values, strict=True)))

    forcing, modulation, drift = (arguments[n] for n in ("forcing", "modulation", "drift"))
    if isinstance(forcing, Harmonic):
        forcing = (forcing,)
    if isinstance(forcing, (list, tuple)):
        forcing = [harmonic(one, forcing_names(i)) for i, one in enumerate(forcing)]
    if isinstance(modulation, Mapping):
        modulation = {k: harmonic(one, modulation_names(k)) for k, one in modulation.items()}
    if isinstance(drift, Mapping):
        drift = {k: changes.pop(drift_name(k), rate) for k, rate in drift.items()}
    terms = arguments["terms"]
    terms = [terms] if isinstance(terms, Term) else terms
    if isinstance(terms, (list, tuple)):
        terms = [changed(one, changes) for one in terms]
    varied = {"forcing": forcing, "modulation": modulation, "drift": drift}
    return {**arguments, **varied, "terms": terms}


def changed(term: Any, changes: dict[str, Any]) -> Any:
    """A term with those of the changes that are its own, which are taken out."""
    names = [p.name for p in term.declared if p.name in changes] if isinstance(term, Term) else []
    return term.replace(**{name: changes.pop(name) for name in names}) if names else term


def attribute(ds: xr.Dataset, name: str) -> str:
    """Return an attribute that a map of a perturbed system has."""
    value = ds.attrs.get(f"phasekit_{name}")
    if not isinstance(value, str):
        raise ParameterError(
            f"ds: attribute phasekit_{name}: got {describe(value)}, wants the string that phasekit "
            "stored there; the Dataset is damaged: make the map again"
        )
    return value


def stored(terms: Sequence[Term]) -> str:
    """What maps hold of terms of one's own, beside their parameters' values."""
    return json.dumps([term.specification for term in terms])


def restored(ds: xr.Dataset, read: Callable[[Sequence[str]], dict[str, Any]]) -> list[Term]:
    """The terms of one's own of a map."""
    if "phasekit_terms" not in ds.attrs:
        return []
    try:
        found = json.loads(attribute(ds, "terms"))
        names = [[] if one is None else one["parameters"] for one in found]
    except (TypeError, ValueError, KeyError):
        raise ParameterError(
            "ds: got a damaged attribute 'phasekit_terms', wants the one that phasekit wrote"
        ) from None
    if None in found:
        raise ParameterError(
            "ds: got results of a system with a term that is a function, of which a map holds no "
            "code; make the system again: pk.Perturbed(system, terms=...)"
        )
    return [term_of(one, read(own)) for one, own in zip(found, names, strict=True)]
