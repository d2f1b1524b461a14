"""Problems from models of reactions in SBML ([SBML]) and Antimony, by libsbml."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from phasekit.errors import ParameterError, warn
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import is_name, symbols_of
from phasekit.laws.grammar import FormulaError
from phasekit.laws.nodes import Nodes
from phasekit.systems.conserved import Row, conserved_sums, dependent_places
from phasekit.systems.waves import period_in_time

#: What Antimony calls the compartment of models without one.
NOWHERE = "default_compartment"
#: What the time is called.
TIME = "time"
AVOGADRO = 6.02214076e23
#: Parts of a model that no flow has, with what they are.
REFUSED = {
    "Events": "events, at which values jump",
    "AlgebraicRules": "algebraic rules",
}


def library(name: str) -> Any:
    """A library of the extra, or a message that says how to get it."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError:
        raise ParameterError(
            f"{name}: got no such library, which reads these models; wants the extra: "
            "pip install 'phasekit[sbml]'"
        ) from None


def read_sbml(path: Any, make: Callable[..., Any]) -> Any:
    """The problem of an SBML file; `make` is `Problem`."""
    try:
        place = Path(path)
        text = place.read_text(encoding="utf-8")
    except (TypeError, ValueError, OSError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise bad("path", path, "the path of an SBML file", why) from None
    return problem_of_sbml(text, place.name, make)


def read_antimony(given: Any, make: Callable[..., Any]) -> Any:
    """The problem of a model in Antimony: a text, or the path of a file."""
    antimony = library("antimony")
    wants = "a model in Antimony, or the path of one"
    if not isinstance(given, (str, Path)) or not str(given).strip():
        raise bad("text", given, wants)
    name, text = "text", str(given)
    if isinstance(given, Path) or not set(text) & set("\n;=>"):
        try:
            name, text = Path(given).name, Path(given).read_text(encoding="utf-8")
        except OSError as error:
            raise bad("text", given, wants, error.strerror or str(error)) from None
    antimony.clearPreviousLoads()
    if antimony.loadAntimonyString(text) < 0:
        raise ParameterError(
            f"{name}: got no Antimony: {' '.join(antimony.getLastError().split())}"
        )
    return problem_of_sbml(antimony.getSBMLString(antimony.getMainModuleName()), name, make)


def problem_of_sbml(text: str, file: str, make: Callable[..., Any]) -> Any:
    """The problem of an SBML document."""
    libsbml = library("libsbml")
    document = libsbml.readSBMLFromString(text)
    if document.getNumErrors(libsbml.LIBSBML_SEV_ERROR) + document.getNumErrors(
        libsbml.LIBSBML_SEV_FATAL
    ):
        serious = (document.getError(i) for i in range(document.getNumErrors()))
        first = next(e for e in serious if e.getSeverity() >= libsbml.LIBSBML_SEV_ERROR)
        raise ParameterError(
            f"{file}, line {first.getLine()}: got no valid SBML: {first.getShortMessage()}"
        )
    model = document.getModel()
    if model is None:
        raise ParameterError(f"{file}: got SBML without a model, wants one")
    properties = libsbml.ConversionProperties()
    properties.addOption("promoteLocalParameters", True)
    if document.convert(properties) != libsbml.LIBSBML_OPERATION_SUCCESS:
        raise ParameterError(f"{file}: got local parameters that cannot be told apart")
    return _Model(libsbml, document.getModel(), file).problem(make)


class _Model:
    """A model, its names and what they stand for."""

    def __init__(self, libsbml: Any, model: Any, file: str) -> None:
        import sympy as sp

        self.sbml, self.model, self.file = libsbml, model, file
        if model.getNumEvents():
            self.refuse(REFUSED["Events"], model.getEvent(0))
        self.assigned: dict[str, Any] = {}
        self.rates: dict[str, Any] = {}
        for rule in self.all(model.getListOfRules()):
            if rule.isAlgebraic():
                self.refuse(REFUSED["AlgebraicRules"], rule)
            (self.assigned if rule.isAssignment() else self.rates)[rule.getVariable()] = rule
        self.initial = {
            one.getSymbol(): one for one in self.all(model.getListOfInitialAssignments())
        }
        self.functions = {
            one.getId(): one for one in self.all(model.getListOfFunctionDefinitions())
        }
        self.compartments = {c.getId(): c for c in self.all(model.getListOfCompartments())}
        self.species = {s.getId(): s for s in self.all(model.getListOfSpecies())}
        for one in self.species.values():
            if one.isSetConversionFactor() or model.isSetConversionFactor():
                self.refuse("a conversion factor", one)
        #: Stoichiometries that formulas may name.
        self.references = {
            part.getId(): part.getStoichiometry()
            for one in self.all(model.getListOfReactions())
            for given in (one.getListOfReactants(), one.getListOfProducts())
            for part in self.all(given)
            if part.isSetId() and part.isSetStoichiometry()
        }
        self.parameters = {p.getId(): p for p in self.all(model.getListOfParameters())}
        for name, one in self.compartments.items():
            holds = any(s.getCompartment() == name for s in self.species.values())
            if holds and (name in self.rates or name in self.assigned):
                self.refuse(f"a compartment {name} whose size varies", one)
        self.names = [*self.compartments, *self.species, *self.parameters]
        self.spelled = {name: name if is_name(name) else f"{name}_" for name in self.names}
        self.symbols: dict[str, Any] = symbols_of(self.spelled.values())
        #: Antimony's compartment of models without one, which is nothing but the number 1.
        place = self.compartments.get(NOWHERE)
        if place is not None and place.getSize() == 1.0 and place.getConstant():
            self.symbols[NOWHERE] = sp.Integer(1)
            self.names.remove(NOWHERE)
        self.time = next(n for n in (TIME, "t", "time_") if n not in self.symbols)
        self.symbols[self.time] = symbols_of([self.time])[self.time]

    def all(self, given: Any) -> Iterable[Any]:
        return [given.get(i) for i in range(given.size())]

    def refuse(self, what: str, where: Any) -> Any:
        line = where.getLine() if where is not None else 0
        place = f"{self.file}, line {line}" if line else self.file
        raise ParameterError(f"{place}: got {what}, wants an ordinary flow")

    # ------------------------------------------------------------------ formulas

    def formula(self, node: Any, what: str, where: Any) -> Any:
        """A tree of MathML as a sympy expression of the model's names."""
        if node is None:
            self.refuse(f"no formula for {what}", where)

        def unknown(name: str, called: bool) -> Exception:
            return FormulaError(f"the unknown {'function' if called else 'symbol'} {name}")

        try:
            return _Tree(self.sbml, Nodes(unknown, self.symbols), self).value(node)
        except FormulaError as error:
            self.refuse(f"{error} in {what}", where)

    def size(self, name: str) -> Any:
        """The symbol of a compartment's size."""
        return self.symbols[self.spelled[name]]

    # ------------------------------------------------------------------ the problem

    def problem(self, make: Callable[..., Any]) -> Any:
        """The problem: states, equations, parameters, starts and conserved totals."""
        import sympy as sp

        reactions = list(self.all(self.model.getListOfReactions()))
        changed = self.reacting(reactions)
        speeds = {}
        for one in reactions:
            law = one.getKineticLaw()
            if law is None or law.getMath() is None:
                self.refuse(f"a reaction {one.getId()} without a rate", one)
            if one.isSetFast() and one.getFast():
                self.refuse(f"a fast reaction {one.getId()}", one)
            speeds[one.getId()] = self.formula(law.getMath(), f"the rate of {one.getId()}", one)
        amounts = {
            name: sp.Add(*(self.exact(n) * speeds[r] for r, n in row.items()))
            for name, row in changed.items()
        }
        rates: dict[str, Any] = {}
        for name in self.names:
            if name in self.rates:
                rule = self.rates[name]
                rates[name] = self.formula(rule.getMath(), f"the rate of {name}", rule)
            elif name in changed:
                rates[name] = amounts[name] / self.held(name)
        assigned = {
            name: self.formula(rule.getMath(), f"the rule of {name}", rule)
            for name, rule in self.assigned.items()
            if name in self.spelled
        }
        settled = self.settled(assigned)
        values = self.starts(settled)
        fixed = [n for n in self.names if n not in rates and n not in assigned]
        parameters = {self.spelled[n]: values[n] for n in fixed}
        start = {self.spelled[n]: values[n] for n in rates}
        observables = {self.spelled[n]: e for n, e in settled.items()}
        replaced = {self.symbols[self.spelled[n]]: e for n, e in settled.items()}
        f = {self.spelled[n]: e.subs(replaced, simultaneous=True) for n, e in rates.items()}
        words: dict[str, dict[str, str]] = {}
        names = [n for n in changed if n not in self.rates]
        sums = conserved_sums([[changed[n].get(r, Fraction(0)) for r in speeds] for n in names])
        self.conserve(names, sums, f, parameters, start, observables, words)
        return self.problem_of(make, f, parameters, start, observables, words)

    def conserve(
        self, names: Sequence[str], sums: Sequence[Row], f: dict[str, Any],
        parameters: dict[str, float], start: dict[str, float], observables: dict[str, Any],
        words: dict[str, dict[str, str]],
    ) -> None:  # fmt: skip
        """Put totals that are conserved in place of as many species."""
        import sympy as sp

        if len(f) <= len(sums):  # a flow needs a state
            sums = sums[: len(f) - 1]
        places = dependent_places(sums)
        known = {self.symbols[n]: v for n, v in {**parameters, **start}.items()}
        amounts = [self.held(n) * self.symbols[self.spelled[n]] for n in names]
        totals = []
        for row in sums:
            parts = [(x, n) for x, n in zip(row, names, strict=True) if x]
            name = next(
                (n for _, s in parts if (n := f"total_{self.spelled[s]}") not in self.symbols),
                f"total_{'_'.join(self.spelled[s] for _, s in parts)}",
            )
            self.symbols[name] = sp.Symbol(name, real=True)
            total = sp.Add(*(self.exact(x) * amounts[names.index(s)] for x, s in parts))
            parameters[name] = float(total.subs(known))
            text = " + ".join(s if x == 1 else f"{x} {s}" for x, s in parts).replace("+ -", "- ")
            words[name] = {"long_name": f"conserved amount {text}"}
            totals.append(self.symbols[name])
        if not places:
            return
        left = [
            total
            - sp.Add(*(self.exact(x) * amounts[j] for j, x in enumerate(row) if j not in places))
            for total, row in zip(totals, sums, strict=True)
        ]
        square = sp.Matrix([[self.exact(row[j]) for j in places] for row in sums])
        solved = square.LUsolve(sp.Matrix(left))
        formulas = {}
        for place, amount in zip(places, solved, strict=True):
            own = self.spelled[names[place]]
            formulas[self.symbols[own]] = sp.expand(amount) / self.held(names[place])
            f.pop(own)
            start.pop(own)
        for target in (f, observables):
            target.update({n: e.subs(formulas, simultaneous=True) for n, e in target.items()})
        observables.update({str(symbol): formula for symbol, formula in formulas.items()})

    def exact(self, x: Fraction) -> Any:
        """A fraction as one of sympy."""
        import sympy as sp

        return sp.Rational(x.numerator, x.denominator)

    def problem_of(
        self, make: Callable[..., Any], f: Mapping[str, Any], parameters: dict[str, float],
        start: Mapping[str, float], observables: Mapping[str, Any], words: Any,
    ) -> Any:  # fmt: skip
        if not f:
            self.refuse("nothing that changes", self.model)
        t = self.symbols[self.time]
        more: dict[str, Any] = {}
        if any(t in e.free_symbols for e in f.values()):
            more["time"] = self.time
            period = period_in_time(f.values(), t)
            values = {self.symbols[n]: v for n, v in parameters.items()}
            if period is not None and 0.0 < float(abs(period.subs(values))) < math.inf:
                more["period"] = period if period.subs(values) > 0 else -period
        else:
            observables = {n: e for n, e in observables.items() if t not in e.free_symbols}
        lost = [n for n, v in {**parameters, **start}.items() if not math.isfinite(v)]
        if lost:
            self.refuse(f"no value for {', '.join(lost)}", self.model)
        problem = make(
            list(f.values()), tuple(f), parameters, start=start, observables=observables, **more
        )
        titles = {
            self.spelled[n]: one.getName()
            for group in (self.species, self.parameters, self.compartments)
            for n, one in group.items()
            if one.getName() and self.spelled[n] in (*problem.state, *parameters)
        }
        for n, text in titles.items():
            words[n] = {"long_name": text}
        return problem.described(words) if words else problem

    def held(self, name: str) -> Any:
        """What a species' value times is its amount: the size of its compartment, or 1."""
        one = self.species[name]
        return 1 if one.getHasOnlySubstanceUnits() else self.size(one.getCompartment())

    def reacting(self, reactions: Sequence[Any]) -> dict[str, dict[str, Fraction]]:
        """Of species that reactions change the stoichiometry by reaction, exact."""
        found: dict[str, dict[str, Fraction]] = {}
        for one in reactions:
            for sign, given in ((-1, one.getListOfReactants()), (1, one.getListOfProducts())):
                for part in self.all(given):
                    name = part.getSpecies()
                    if name not in self.species:
                        self.refuse(f"an unknown species {name} in {one.getId()}", part)
                    species = self.species[name]
                    if part.isSetStoichiometryMath() or part.getId() in (
                        *self.assigned, *self.rates, *self.initial,
                    ):  # fmt: skip
                        self.refuse(f"a computed stoichiometry of {name} in {one.getId()}", part)
                    if species.getBoundaryCondition() or species.getConstant():
                        continue
                    if name in self.assigned or name in self.rates:
                        self.refuse(f"{name} in a reaction and in a rule", part)
                    number = part.getStoichiometry()
                    number = 1.0 if math.isnan(number) else number
                    row = found.setdefault(name, {})
                    exact = Fraction(number).limit_denominator(10**6)
                    row[one.getId()] = row.get(one.getId(), Fraction(0)) + sign * exact
        return found

    def settled(self, assigned: Mapping[str, Any]) -> dict[str, Any]:
        """Assignments with what they use put in."""
        found: dict[str, Any] = dict(assigned)
        by_symbol = {self.symbols[self.spelled[n]]: n for n in found}
        for _ in range(len(found) + 1):
            used = {
                n: {s: found[by_symbol[s]] for s in e.free_symbols if s in by_symbol}
                for n, e in found.items()
            }
            if not any(used.values()):
                return found
            found = {n: e.subs(used[n], simultaneous=True) for n, e in found.items()}
        self.refuse(f"rules of {', '.join(assigned)} that go round in a circle", self.model)
        return {}

    def starts(self, settled: Mapping[str, Any]) -> dict[str, float]:
        """Values of all names at the start."""
        import sympy as sp

        values: dict[str, Any] = {}
        empty: list[str] = []
        for name, one in self.compartments.items():
            if name in self.names:
                values[name] = one.getSize() if one.isSetSize() else 1.0
        for name, one in self.parameters.items():
            values[name] = one.getValue() if one.isSetValue() else math.nan
        formulas = {
            name: self.formula(one.getMath(), f"the start of {name}", one)
            for name, one in self.initial.items()
            if name in self.spelled
        }
        formulas |= settled
        symbols = {name: self.symbols[self.spelled[name]] for name in self.names}
        for name, one in self.species.items():
            size = self.size(one.getCompartment())
            amount = one.getHasOnlySubstanceUnits()
            if one.isSetInitialAmount():
                given = one.getInitialAmount()
                formulas.setdefault(name, sp.Float(given, 17) / (1 if amount else size))
            elif one.isSetInitialConcentration():
                given = one.getInitialConcentration()
                formulas.setdefault(name, sp.Float(given, 17) * (size if amount else 1))
            elif name not in formulas:
                formulas[name] = sp.Integer(0)
                empty.append(name)
        if empty:
            warn(
                f"{self.file}: no initial values of {', '.join(empty)}: they begin at 0",
                RuntimeWarning,
            )
        known = {symbols[n]: sp.Float(v, 17) for n, v in values.items() if n not in formulas}
        known[self.symbols[self.time]] = sp.Integer(0)
        left = dict(formulas)
        while left:
            ready = {n: e for n, e in left.items() if not e.free_symbols - known.keys()}
            if not ready:
                self.refuse(f"starts of {', '.join(left)} that go round in a circle", self.model)
            for name, formula in ready.items():
                value = formula.subs(known)
                known[symbols[name]] = value
                values[name] = float(value) if value.is_real else math.nan
                del left[name]
        return values


class _Tree:
    """MathML as nodes of formulas."""

    def __init__(self, libsbml: Any, build: Nodes, model: _Model) -> None:
        self.build, self.model = build, model
        L = libsbml
        self.compare = {
            L.AST_RELATIONAL_EQ: "==", L.AST_RELATIONAL_NEQ: "!=", L.AST_RELATIONAL_GEQ: ">=",
            L.AST_RELATIONAL_GT: ">", L.AST_RELATIONAL_LEQ: "<=", L.AST_RELATIONAL_LT: "<",
        }  # fmt: skip
        self.join = {L.AST_LOGICAL_AND: "&", L.AST_LOGICAL_OR: "|", L.AST_LOGICAL_NOT: "~"}
        self.constants = {
            L.AST_CONSTANT_PI: "pi", L.AST_CONSTANT_E: "E", L.AST_CONSTANT_TRUE: "True",
            L.AST_CONSTANT_FALSE: "False",
        }  # fmt: skip
        self.refused = {
            L.AST_FUNCTION_DELAY: "a delay", L.AST_FUNCTION_FLOOR: "floor, which jumps",
            L.AST_FUNCTION_CEILING: "ceiling, which jumps", L.AST_FUNCTION_FACTORIAL: "a factorial",
            L.AST_FUNCTION_RATE_OF: "the rate of a value", L.AST_FUNCTION_REM: "rem, which jumps",
            L.AST_FUNCTION_QUOTIENT: "quotient, which jumps",
        }  # fmt: skip
        self.L = L
        #: Values of the arguments within a function.
        self.bound: dict[str, Any] = {}

    def value(self, node: Any) -> Any:
        """A number: a condition is 0 or 1."""
        from sympy import Expr

        found = self.read(node)
        if isinstance(found, Expr):
            return found
        one, zero = self.build.number("1"), self.build.number("0")
        return self.build.call("Piecewise", [(one, found), (zero, self.build.name("True"))])

    def truth(self, node: Any) -> Any:
        """A condition: a number is whether it is other than 0."""
        from sympy import Expr

        found = self.read(node)
        if not isinstance(found, Expr):
            return found
        return self.build.compare("!=", found, self.build.number("0"))

    def read(self, node: Any) -> Any:
        L, build, kind = self.L, self.build, node.getType()
        parts = [node.getChild(i) for i in range(node.getNumChildren())]
        if kind in self.refused:
            raise FormulaError(self.refused[kind])
        if kind == L.AST_RATIONAL:
            return self.over(build.number(str(node.getNumerator())), node.getDenominator())
        if node.isNumber():
            number = node.getInteger() if node.isInteger() else node.getValue()
            return build.number(repr(number))
        if kind == L.AST_NAME_TIME:
            return build.name(self.model.time)
        if kind == L.AST_NAME_AVOGADRO:
            return build.number(repr(AVOGADRO))
        if kind == L.AST_NAME:
            name = node.getName()
            if name in self.bound:
                return self.bound[name]
            if name in self.model.references:
                return build.number(repr(self.model.references[name]))
            if name not in self.model.spelled:
                raise FormulaError(f"the unknown symbol {name}")
            return build.name(self.model.spelled[name])
        if kind in self.constants:
            return build.name(self.constants[kind])
        if kind in self.compare:
            pairs = [
                build.compare(self.compare[kind], self.value(a), self.value(b))
                for a, b in zip(parts, parts[1:], strict=False)
            ]
            return pairs[0] if len(pairs) == 1 else build.join("&", pairs)
        if kind in self.join:
            return build.join(self.join[kind], [self.truth(one) for one in parts])
        if kind == L.AST_FUNCTION_PIECEWISE:
            return self.pieces(parts)
        given = [self.value(one) for one in parts]
        if kind == L.AST_FUNCTION and node.getName() in self.model.functions:
            return self.called(self.model.functions[node.getName()], given)
        return self.arithmetic(node, kind, given)

    def called(self, function: Any, given: Sequence[Any]) -> Any:
        """A function of the model, of values."""
        names = [function.getArgument(i).getName() for i in range(function.getNumArguments())]
        if len(names) != len(given):
            raise FormulaError(f"{function.getId()} with {len(given)} arguments")
        outer, self.bound = self.bound, dict(zip(names, given, strict=True))
        found = self.value(function.getBody())
        self.bound = outer
        return found

    def pieces(self, parts: Sequence[Any]) -> Any:
        pairs = [
            (self.value(parts[i]), self.truth(parts[i + 1])) for i in range(0, len(parts) - 1, 2)
        ]
        if len(parts) % 2:
            pairs.append((self.value(parts[-1]), self.build.name("True")))
        else:
            raise FormulaError("a piecewise formula without 'otherwise'")
        return self.build.call("Piecewise", pairs)

    def over(self, above: Any, below: Any) -> Any:
        below = self.build.number(str(below)) if isinstance(below, int) else below
        return self.build.multiply([above, self.build.power(below, self.build.number("-1"))])

    def arithmetic(self, node: Any, kind: int, given: list[Any]) -> Any:
        L, build = self.L, self.build
        if kind == L.AST_PLUS:
            return build.add(given) if given else build.number("0")
        if kind == L.AST_TIMES:
            return build.multiply(given) if given else build.number("1")
        if kind == L.AST_MINUS:
            minus = build.number("-1")
            if len(given) == 1:
                return build.multiply([minus, given[0]])
            return build.add([given[0], build.multiply([minus, given[1]])])
        if kind == L.AST_DIVIDE:
            return self.over(*given)
        if kind in (L.AST_POWER, L.AST_FUNCTION_POWER):
            return build.power(*given)
        if kind == L.AST_FUNCTION_ROOT:
            degree, base = given if len(given) == 2 else (build.number("2"), given[0])
            return build.power(base, build.power(degree, build.number("-1")))
        if kind == L.AST_FUNCTION_LOG:
            base, x = given if len(given) == 2 else (build.number("10"), given[0])
            return build.call("log", [x, base])
        if kind == L.AST_FUNCTION_LN:
            return build.call("log", given)
        name = {"abs": "Abs", "max": "Max", "min": "Min"}.get(node.getName() or "", node.getName())
        if not name:
            raise FormulaError(f"MathML of the kind {kind}")
        return build.call(str(name), given)
