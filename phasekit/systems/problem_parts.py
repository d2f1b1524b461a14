"""What a `Problem` is made of, checked: names, values, formulas, its right-hand side, its curve."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import CompiledField, PythonField
from phasekit.bifurcation.continuation.fields import Field, SymbolicField, refuse_uncompiled
from phasekit.bifurcation.continuation.large.field import DENSE, SparseField, as_columns
from phasekit.errors import ParameterError
from phasekit.inputs import is_whole
from phasekit.labels.arguments import (
    Value,
    bad,
    brief,
    check_names,
    list_names,
    number,
    numeric,
    pair,
    unknown,
)
from phasekit.labels.units import si_unit
from phasekit.laws.formulas import (
    NAME,
    is_name,
    keyword_hint,
    symbols_of,
    take_formula,
    write_formula,
)
from phasekit.laws.kept_formulas import kept_or_read
from phasekit.numerics.patterns import pattern_of
from phasekit.systems.identity import parameter_values, refuse_another
from phasekit.systems.parameter import Parameter
from phasekit.systems.smooth import refuse_jumps


def by_name(given: Any) -> Any:
    """What is given by names, where these may be sympy's symbols: the keys of a mapping too."""
    if getattr(given, "is_Symbol", False):
        return given.name
    if isinstance(given, Mapping):
        return {by_name(name): value for name, value in given.items()}
    symbols = hasattr(given, "free_symbols") and hasattr(given, "__len__")  # of sympy's own
    return list(map(by_name, given)) if isinstance(given, (list, tuple)) or symbols else given


def names_of(argument: str, given: Any) -> tuple[str, ...]:
    """Names that can be states or parameters."""
    try:
        names = tuple(given)
    except TypeError:
        raise bad(argument, given, "names") from None
    for name in names:
        if not is_name(name):
            raise bad(
                argument, name,
                f"names that are Python identifiers and no keywords, of at most {NAME} letters",
                keyword_hint(name),
            )  # fmt: skip
    if not names:
        raise bad(argument, given, "at least one name")
    if len(set(names)) < len(names):
        raise bad(argument, given, "names that differ")
    return names


def is_blocks(state: Any) -> bool:
    """Whether an argument says of states how many there are."""
    if is_whole(state):
        return True
    pairs = isinstance(state, (list, tuple)) and len(state) > 0
    return bool(pairs) and all(
        isinstance(one, (list, tuple)) and len(one) == 2 and is_whole(one[1]) for one in state
    )


def values_of(argument: str, given: Any) -> dict[str, float]:
    """Names with finite numbers."""
    return {
        name: number(f"{argument}[{name!r}]", value, "a number, finite", None)
        for name, value in _named(argument, given)
    }


def arrays_of(argument: str, given: Any) -> dict[str, Value]:
    """Names with finite numbers, 1-D arrays or DataArrays."""
    kept = {
        name: numeric(f"{argument}[{name!r}]", value, None)
        for name, value in _named(argument, given)
    }
    for name, value in kept.items():
        if isinstance(value, xr.DataArray):
            unit = si_unit(getattr(given[name], "attrs", {}).get("units"))
            kept[name] = value if unit is None else value.assign_attrs(units=unit)
    return kept


def _named(argument: str, given: Any) -> Iterable[tuple[str, Any]]:
    if not isinstance(given, Mapping):
        raise bad(argument, given, "a mapping from names to numbers")
    if given:
        names_of(argument, given)
    return given.items()


def window_of(argument: str, window: Any, states: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Ranges of states by name."""
    if window is None:
        return {}
    if not isinstance(window, Mapping):
        raise bad(argument, window, "a mapping of states to (low, high)")
    kept = {}
    for name, ends in window.items():
        if name not in states:
            raise unknown(f"{argument}: state", name, states)
        wants = "two finite numbers (low, high), low < high"
        low, high = pair(f"{argument}[{name!r}]", ends, wants)
        if not low < high:
            raise bad(f"{argument}[{name!r}]", ends, wants)
        kept[name] = (low, high)
    return kept


def start_of(start: Any, states: Sequence[str]) -> dict[str, float]:
    """States at the start by name, of some or all states."""
    if start is None:
        return {}
    values = values_of("start", start)
    for name in values:
        if name not in states:
            raise unknown("start: state", name, states)
    return values


def observables_of(
    observables: Any, states: Sequence[str], names: Sequence[str], definitions: Any, functions: Any
) -> dict[str, Any]:
    """Formulas of states, parameters and time by name, that motions have values of."""
    if observables is None:
        return {}
    if not isinstance(observables, Mapping):
        raise bad("observables", observables, "a mapping from names to formulas")
    if not observables:
        return {}
    for name in names_of("observables", observables):
        if name in states or name in names:
            raise bad("observables", name, "a name that is neither a state nor a parameter")
    given = expressions_of(
        observables.values(), [*states, *names], "observables", states, definitions, functions
    )
    return dict(zip(observables, given, strict=True))


def noise_of(noise: Any, states: Sequence[str], parameters: Iterable[str]) -> dict[str, Any]:
    """Amplitudes of the noise of states, as formulas of the parameters."""
    if noise is None:
        return {}
    if not isinstance(noise, Mapping):
        raise bad("noise", noise, "a mapping from states to amplitudes")
    symbols = symbols_of(parameters)
    declare = "noise is additive: its amplitude is a number or a formula of the parameters"
    kept = {}
    for name, amplitude in noise.items():
        if name not in states:
            raise unknown("noise: state", name, states)
        kept[name] = take_formula(amplitude, symbols, f"noise[{name!r}]", declare)
    return kept


class OfInstance:
    """An attribute that each instance has of its own, and its class by default."""

    def __init__(self, function: Callable[[Any], Any], default: Any) -> None:
        self.function, self.default = function, default

    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the instance's, or the default."""
        return self.default if instance is None else self.function(instance)


def declared_of(problem: Any) -> tuple[Parameter, ...]:
    """The parameters of a problem with their units and meaning, where these are known."""
    found = []
    for name, value in problem.parameters.items():
        words = {**getattr(value, "attrs", {}), **problem.words.get(name, {})}
        units, long_name = words.get("units") or "1", words.get("long_name") or f"parameter {name}"
        found.append(Parameter(name=name, units=units, long_name=long_name))
    return tuple(found)


def refuse_arrays(problem: Any) -> Any:
    """Return a problem whose parameters are numbers; refuse any other."""
    for name, value in problem.parameters.items():
        if not isinstance(value, float):
            raise bad(
                f"parameters[{name!r}]", brief(value), "a number, to follow one system",
                f"use .replace({name}=...) for one of them",
            )  # fmt: skip
    return problem


def refuse_aperiodic(law: Any, given: Any = None) -> None:
    """Refuse a right-hand side, of what was given, that depends on time and has no period."""
    if law.time is not None and law.period is None:
        hint = f"pk.Problem(..., time={str(law.time)!r}, period=...) says one"
        raise bad(
            "problem",
            law if given is None else given,
            "an f with a period in time, or without time",
            hint,
        )


#: The attribute of maps that holds the equations.
DEFINITION = "phasekit_problem"


def problem_of_dataset(kind: Any, ds: Any) -> Any:
    """The problem of a Dataset that it made."""
    refuse_another(ds, "Problem")
    text = ds.attrs.get(DEFINITION, "")
    try:
        spec = json.loads(text)
        names = spec["parameters"]
    except (TypeError, ValueError, KeyError):
        raise ParameterError(
            f"ds: got a damaged attribute {DEFINITION!r}, wants the one that phasekit wrote"
        ) from None
    if spec.get("f") is None:
        raise ParameterError(
            "ds: got a map of a problem whose f is a function, wants one of formulas: a map holds "
            "no code; make the problem again"
        )
    declared = [Parameter(name=name, units="1", long_name=name) for name in names]
    values = parameter_values(ds, declared)
    made = kind.from_specification({**spec, "parameters": dict.fromkeys(names, 1.0)})
    return made.replace(**{name: values[name] for name in names})


def angles_of(periods: Any, states: Sequence[str]) -> dict[str, float]:
    """The periods of the states that are angles."""
    if periods is None:
        return {}
    angles = values_of("periods", periods)
    for name, value in angles.items():
        if name not in states:
            raise unknown("periods: state", name, states)
        if not value > 0.0:
            raise bad(f"periods[{name!r}]", value, "a number > 0")
    return angles


def clock_of(time: Any, period: Any, states: Sequence[str], values: Mapping[str, float]) -> Any:
    """The period of a forced right-hand side as a formula of the parameters; None without one."""
    if time is None and period is None:
        return None
    if time is None:
        raise bad("time", time, "the name of time in f, beside its period")
    names_of("time", (time,))
    if time in states or time in values:
        raise bad("time", time, "a name that is neither a state nor a parameter")
    if period is None:
        return None
    symbols = symbols_of(values)
    if isinstance(period, str) or hasattr(period, "free_symbols"):
        formula = take_formula(period, symbols, "period", "declare it in parameters")
    else:
        import sympy

        formula = sympy.Float(number("period", period, "a number > 0, or a formula", None), 17)
    refuse_uncompiled(formula, set(symbols.values()), "period")
    try:
        length = float(formula.subs({symbols[k]: v for k, v in values.items()}))
    except (TypeError, ValueError):
        length = float("nan")
    if not 0.0 < length < float("inf"):
        raise bad("period", period, "a positive number at the parameters", f"it is {length} there")
    return formula


def refuse_of_maps(**given: Any) -> None:
    """Refuse what makes no sense of a map."""
    for name, value in given.items():
        if value is not None:
            raise bad(name, value, "nothing with map=True: a map has no time and no energy")


def refuse_of_fields(**given: Any) -> None:
    """Refuse what is not answered of fields of states."""
    for name, value in given.items():
        if value:
            raise bad(name, value, "nothing with a number of states: give them names, or leave it")


def shorthands(
    definitions: Any, functions: Any, symbols: Mapping[str, Any], declare: str
) -> dict[str, Any]:
    """What names stand for in formulas: formulas, each by those before it, and functions."""
    import sympy

    from phasekit.laws.nodes import FUNCTIONS

    known = dict(symbols)
    for argument, given in (("functions", functions), ("definitions", definitions)):
        if given is not None and not isinstance(given, Mapping):
            raise bad(argument, given, "a mapping from names to formulas")
        for form, formula in (given or {}).items():
            where, variables = f"{argument}[{form!r}]", dict[str, Any]()
            name = form
            if argument == "functions":
                match = re.fullmatch(r"\s*(\w+)\s*\(([\w\s,]*)\)\s*", str(form))
                if match is None:
                    raise bad(argument, form, "forms such as 's(x)' or 'g(x, y)'")
                name = match[1]
                variables = symbols_of(names_of(where, [v.strip() for v in match[2].split(",")]))
            names_of(where, (name,))
            if name in known or name in FUNCTIONS:
                raise bad(argument, name, "a name that is not taken")
            found = take_formula(formula, {**known, **variables}, where, declare)
            known[name] = sympy.Lambda(tuple(variables.values()), found) if variables else found
    return {name: value for name, value in known.items() if name not in symbols}


def expressions_of(
    given: Iterable[Any], names: Sequence[str], argument: str, states: Sequence[str],
    definitions: Any = None, functions: Any = None,
) -> list[Any]:  # fmt: skip
    """Formulas as sympy expressions of real symbols, that there is machine code for."""
    symbols = symbols_of(names)
    declare = "declare it in state, parameters or time"
    known: Mapping[str, Any] = symbols
    if definitions is not None or functions is not None:
        known = symbols | shorthands(definitions, functions, symbols, declare)
    found = [take_formula(one, known, argument, declare) for one in given]
    moving = {symbols[name] for name in states}
    for expression in found:
        refuse_uncompiled(expression, moving, argument)
    return found


def make_field(
    f: Any, jac: Any, states: tuple[str, ...], names: tuple[str, ...],
    *, discrete: bool = False, definitions: Any = None, functions: Any = None,
    sparse: bool = False, later: bool = False,
) -> tuple[Field, Any]:  # fmt: skip
    """The right-hand side in the form that the stepping code takes, and f as it is kept.

    Of a map the field is f(x) - x, whose zeros are the fixed points. Formulas may be read `later`.
    """
    if sparse:
        for argument, value in (("definitions", definitions), ("functions", functions)):
            if value is not None:
                raise bad(argument, value, "None beside an f that is no formula")
        return sparse_field(f, jac, states, names), f
    if isinstance(f, Mapping):
        for name in f:
            if name not in states:
                raise unknown("f: state", name, states)
        missing = [name for name in states if name not in f]
        if missing:
            raise bad("f", list(f), f"a formula for {', '.join(missing)} as well")
        f = [f[name] for name in states]
    is_one = isinstance(f, str) or hasattr(f, "free_symbols")
    if is_one or (isinstance(f, (list, tuple)) or (hasattr(f, "tolist") and np.ndim(f) > 0)):
        if jac is not None:
            raise bad("jac", jac, "None with formulas, whose derivatives are exact")
        given = [f] if is_one and not hasattr(f, "tolist") else list(f)
        if len(given) != len(states):
            raise bad("f", given, f"{len(states)} formulas, one for each of {list_names(states)}")

        def read() -> tuple[Any, ...]:
            named, more = [*states, *names], (definitions, functions)
            return tuple(expressions_of(given, named, "f", states, *more))

        if later:
            found = kept_or_read(given, (states, names), (definitions, functions), read)
            return SymbolicField(found, states, names), found
        expressions = read()
        if discrete:
            symbols = symbols_of(states)
            moved = tuple(e - symbols[s] for e, s in zip(expressions, states, strict=True))
            return SymbolicField(moved, states, names), expressions
        return SymbolicField(expressions, states, names), expressions
    for argument, value in (("definitions", definitions), ("functions", functions)):
        if value is not None:
            raise bad(argument, value, "None beside an f that is no formula")
    if not callable(f):
        raise bad(
            "f", f, "a function f(x, **parameters), formulas as strings, or sympy expressions"
        )
    inner = getattr(f, "py_func", None)
    if inner is not None and hasattr(f, "signatures"):
        arguments = list(inspect.signature(inner).parameters)[1:]
        if sorted(arguments) != sorted(names):
            raise bad("parameters", list(names), f"the arguments of f after the state: {arguments}")
        if jac is not None:
            raise bad("jac", jac, "None with a compiled f, whose derivatives are compiled as well")
        return CompiledField(f, arguments, states, names, less=discrete), f
    check_call("f", f, names)
    if jac is not None:
        check_call("jac", jac, names)
    return PythonField(f, jac, states, names, less=discrete), f


def sparse_field(f: Any, jac: Any, states: tuple[str, ...], names: tuple[str, ...]) -> SparseField:
    """A right-hand side of fields of states, its derivatives checked as far as they can be now."""
    n = len(states)
    if not callable(f):
        raise bad("f", f, "a function f(x, **parameters) of all states in x")
    check_call("f", f, names)
    if jac is None and n > DENSE:
        raise bad(
            "jac", None,
            f"of more than {DENSE} states a sparse matrix: a function that returns one, or a "
            "pattern of booleans that says which derivatives are not zero",
        )  # fmt: skip
    if callable(jac) and not hasattr(jac, "matmat"):
        check_call("jac", jac, names)
    elif jac is not None and pattern_of(jac, n) is None:
        as_columns("jac", jac, n)
    return SparseField(f, jac, states, names)


def check_call(argument: str, function: Any, names: Sequence[str]) -> None:
    """Refuse a function that cannot be called as f(x, **parameters)."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(np.zeros(1), **dict.fromkeys(names, 0.0))
    except TypeError as error:
        call = ", ".join(["x", *(f"{name}=..." for name in names)])
        raise ParameterError(
            f"{argument}: got a function with the arguments {signature}, wants one to be called "
            f"as {argument}({call}) with all states in x and parameters by their names: {error}"
        ) from None


def written(problem: Any) -> str:
    """The equations of a problem, if they are formulas, and its parameters."""
    if problem.system is not None:
        x = problem.state[0]
        return f"{x}' = -V'({x}) of {problem.system!r}"
    arrow = " -> " if problem.map else "' = "
    if problem.kind == "symbolic":
        equations = ", ".join(
            f"{name}{arrow}{formula}"
            for name, formula in zip(problem.state, problem.f, strict=True)
        )
        if len(equations) > 200:
            equations = equations[:200] + " ..."
    else:
        name = getattr(problem.f, "__name__", "f")
        fields = [f"{block.name}: {block.size}" for block in problem.blocks]
        states = ", ".join(fields) or list_names(problem.state)
        equations = f"({states}){arrow}{name}(x, **parameters), {problem.kind}"
        if hasattr(problem.f, "formulas"):
            equations = f"{name}; {states}"
    notes = [f"applied {problem.times} times"] * (problem.times > 1)
    notes += [f"{name}={brief(value)}" for name, value in problem.parameters.items()]
    notes += [f"{name} modulo {value:.6g}" for name, value in problem.periods.items()]
    if problem.time is not None:
        known = problem.period is not None
        notes.append(f"{problem.time} modulo {problem.period}" if known else f"time {problem.time}")
    notes += [f"noise {amplitude} in {name}" for name, amplitude in problem.noise.items()]
    notes += ["conservative"] * problem.conservative
    return f"{equations}{'; ' if notes else ''}{', '.join(notes)}"


def specified(problem: Any, values: bool = True) -> dict[str, Any]:
    """What is needed to make a problem again, as plain values; f is None if it is code.

    Without values of the parameters their names stand alone.
    """
    on_grid = hasattr(problem.f, "stated")
    formulas: Any = [write_formula(e) for e in problem.f] if problem.kind == "symbolic" else None
    spec: dict[str, Any] = {
        "f": problem.f.stated() if on_grid else formulas,
        "state": states_stated(problem),
        "parameters": dict(problem.parameters) if values else list(problem.parameters),
        "periods": dict(problem.periods),
        "conservative": problem.conservative,
    }
    if on_grid:
        spec["grid"] = [axis.stated() for axis in problem.f.axes]
    if problem.time is not None:
        known = problem.period is not None
        spec.update(time=problem.time, period=write_formula(problem.period) if known else None)
    if problem.map:
        spec["map"] = True
    if problem.window:
        spec["window"] = {name: list(ends) for name, ends in problem.window.items()}
    if problem.start:
        spec["start"] = dict(problem.start)
    if problem.observables:
        spec["observables"] = {n: write_formula(e) for n, e in problem.observables.items()}
    if problem.noise:
        spec["noise"] = {n: write_formula(e) for n, e in problem.noise.items()}
    if problem.times > 1:
        spec["times"] = problem.times
    if problem.words:
        spec["words"] = {name: dict(words) for name, words in problem.words.items()}
    if problem.system is not None:
        spec["system"] = type(problem.system).__name__
        spec["system_parameters"] = problem.system.arguments
    return spec


def in_window(problem: Any, window: Mapping[str, tuple[float, float]]) -> Any:
    """A copy of a problem that looks into another window."""
    copy = problem.replace()
    copy._set("window", MappingProxyType(window_of("window", window, problem.state)))
    return copy


def states_stated(problem: Any) -> list[Any]:
    """The states by name, or fields of states with their numbers, as plain values."""
    return [[block.name, block.size] for block in problem.blocks] or list(problem.state)


def words_checked(words: Any, names: Sequence[str]) -> Mapping[str, Mapping[str, str]]:
    """What states and parameters are called, and their units."""
    wants = "a mapping of names to {'long_name': ..., 'units': ...}"
    if not isinstance(words, Mapping):
        raise bad("words", words, wants)
    kept = {}
    for name, given in words.items():
        if name not in names:
            raise unknown("words: name", name, names)
        known = isinstance(given, Mapping) and set(given) <= {"long_name", "units"}
        if not known or not all(isinstance(text, str) for text in given.values()):
            raise bad(f"words[{name!r}]", given, wants)
        kept[name] = MappingProxyType(dict(given))
    return MappingProxyType(kept)


def jet_of(field: Field, par: Array, x: Array) -> tuple[Array, Array]:
    """The value of a right-hand side and its derivatives by the states, at one state."""
    from phasekit.bifurcation.continuation.curve import Curve
    from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
    from phasekit.bifurcation.continuation.options import DEFAULTS

    n = len(x)
    infinite = np.full(n, np.inf)
    curve = Curve(
        field, EQUILIBRIUM, par, (), np.maximum(np.abs(x), 1e-3), np.zeros(n), -infinite, infinite,
        DEFAULTS,
    )  # fmt: skip
    return curve.evaluate(x)


def equilibrium_curve(problem: Any, parameter: str, span: tuple[float, float], options: Any) -> Any:
    """The `Curve` of equilibria in one parameter, its states not yet scaled."""
    from phasekit.bifurcation.continuation.curve import Curve
    from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM

    if problem.time is not None:
        raise bad(
            "problem", problem, "one whose f does not depend on time, for equilibria",
            "follow periodic orbits: pk.continuation(..., orbit=pk.periodic_orbit(problem, x0))",
        )  # fmt: skip
    refuse_jumps(problem, (parameter,))
    n = len(problem.state)
    check_names((*problem.state, parameter))
    names = list(problem.parameters)
    for name in (*options.bounds, *options.scales):
        if name not in problem.state and name not in names:
            raise unknown("bounds and scales: state", name, [*problem.state, *names])
    bounds = [options.bounds.get(name, (-np.inf, np.inf)) for name in problem.state]
    low, high = span
    return Curve(
        field=problem.field,
        kind=EQUILIBRIUM,
        par=np.array(list(problem.parameters.values())),
        active=(names.index(parameter),),
        scale=np.append(np.ones(n), high - low),
        period=np.array([*(problem.periods.get(name, 0.0) for name in problem.state), 0.0]),
        low=np.array([*(pair[0] for pair in bounds), low]),
        high=np.array([*(pair[1] for pair in bounds), high]),
        options=options,
        conservative=problem.conservative,
        discrete=problem.map,
    )
