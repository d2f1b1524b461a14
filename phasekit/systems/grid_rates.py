"""Rates of fields on a grid by formulas with derivatives, compiled once for all places."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.fields import refuse_uncompiled
from phasekit.labels.arguments import bad, unknown
from phasekit.laws.formulas import read_formula, symbols_of, take_formula, write_formula
from phasekit.laws.grammar import FormulaError, parse
from phasekit.numerics.pointwise import Pointwise, pointwise
from phasekit.systems.grid import DIRICHLET, NEUMANN, Axis, derivative, operators, orders_of
from phasekit.systems.problem_parts import shorthands


@dataclass(frozen=True)
class Derivative:
    """A derivative in formulas: which, of what, and the name of its values.

    ``parity`` says how its argument is mirrored at the ends of each axis: even, 1, or odd, -1.
    """

    word: str
    argument: Any
    name: str
    parity: tuple[int, ...]


class _Reading:
    """Nodes of formulas in which derivatives of formulas stand."""

    def __init__(self, nodes: Any, reader: Reader) -> None:
        self.nodes, self.reader = nodes, reader

    def __getattr__(self, name: str) -> Any:
        return getattr(self.nodes, name)

    def call(self, name: str, arguments: Sequence[Any]) -> Any:
        """A derivative as a symbol, any other function as it is."""
        if name not in self.reader.words:
            return self.nodes.call(name, arguments)
        if len(arguments) != 1:
            raise FormulaError(f"{name} with {len(arguments)} arguments; it takes 1")
        return self.reader.derivative(name, arguments[0])


class Reader:
    """Reads formulas of fields on a grid; keeps the derivatives in them, inner ones first."""

    def __init__(
        self, axes: tuple[Axis, ...], fields: Sequence[str], sloped: Sequence[set[str]],
        known: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self.axes, self.fields = axes, fields
        self.words, self.known = operators(axes), dict(known)
        self.found: dict[tuple[str, Any], Derivative] = {}
        #: By axis what is odd beyond its ends, what is neither odd nor even, and what is not 0
        #: where fields are.
        self.odd: list[set[str]] = [set() for _ in axes]
        self.neither = [{axis.name} | own for axis, own in zip(axes, sloped, strict=True)]
        self.free: list[set[str]] = [set() for _ in axes]

    def derivative(self, word: str, argument: Any) -> Any:
        """The symbol of a derivative of a formula."""
        key = (word, argument)
        if key not in self.found:
            name = f"{word}({argument})"
            orders = orders_of(self.axes, word)
            parity = tuple(self._parity(k, name, argument, order) for k, order in enumerate(orders))
            self.found[key] = Derivative(word, argument, name, parity)
            self.known.update(symbols_of([name]))  # a formula may hold it from now on
        return self.known[self.found[key].name]

    def _parity(self, k: int, name: str, argument: Any, order: int) -> int:
        """Whether a formula is even or odd at the ends of an axis; keeps what its derivative is."""
        axis, odd = self.axes[k], self.odd[k]
        names = {symbol.name: symbol for symbol in argument.free_symbols}
        bare = argument.is_Symbol and argument.name in self.fields
        parity = 0 if names.keys() & self.neither[k] else 1
        turned = {names[one]: -names[one] for one in names.keys() & odd}
        if parity and turned:
            other = argument.subs(turned, simultaneous=True)
            parity = next((s for s in (1, -1) if not (other - s * argument).expand()), 0)
            parity = 0 if _kinks(argument, tuple(turned)) else parity
        missing = [
            end for end, known in (
                (NEUMANN, parity or bare), (DIRICHLET, not names.keys() & self.free[k]),
            ) if end in axis.boundary and not known
        ]  # fmt: skip
        if order and missing:
            raise FormulaError(
                f"{name}, whose argument has no value beyond the {missing[0]} end of {axis.name}, "
                "or a kink there; write it out, with derivatives of fields alone: "
                "dxx(u) instead of dx(dx(u)), "
                "x*dx(u) + u instead of dx(x*u), u*dxx(u) + dx(u)^2 instead of dx(u*dx(u))"
            )
        if not parity and not (bare and order != 1):
            self.neither[k].add(name)
        elif parity * (-1) ** order < 0:
            odd.add(name)
        if order == 1 or names.keys() & self.free[k]:
            self.free[k].add(name)
        return parity or 1

    def __call__(self, formula: Any, argument: str) -> Any:
        """A formula as an expression of the fields, coordinates, derivatives and parameters."""
        declare = "declare it in parameters"
        if not isinstance(formula, str):
            return take_formula(formula, self.known, argument, declare)
        return read_formula(
            formula, self.known, argument, declare,
            read=lambda text, nodes: parse(text, _Reading(nodes, self)),
        )  # fmt: skip


def _kinks(argument: Any, odd: Sequence[Any]) -> bool:
    """Whether a formula may have a kink, or no value, where what is odd vanishes, at an end."""
    import sympy

    still = dict.fromkeys(odd, 0)
    for part in sympy.preorder_traversal(argument):
        if not part.args or not part.free_symbols.intersection(odd):
            continue
        if part.is_Pow:
            smooth = part.exp.is_number and part.exp.is_integer and part.exp.is_nonnegative
            vanishes = not smooth and part.base.subs(still) == 0
        elif isinstance(part, sympy.Abs | sympy.sign | sympy.log):
            vanishes = part.args[0].subs(still) == 0
        else:
            vanishes = isinstance(part, sympy.Max | sympy.Min | sympy.Piecewise)
        if vanishes:
            return True
    return False


def rates_on_grid(
    f: Any, axes: tuple[Axis, ...], parameters: Sequence[str], definitions: Any, functions: Any
) -> GridRates:
    """The rates of fields by formulas."""
    if not isinstance(f, Mapping) or not f:
        raise bad("f", f, "a mapping from fields to formulas, with a grid")
    fields = tuple(f)
    coordinates = tuple(axis.name for axis in axes)
    words = operators(axes)
    for name in (*coordinates, *parameters, *fields):
        if name in words:
            raise bad("f", name, f"other names than the derivatives {', '.join(words)}")
    for name in coordinates:
        if name in fields or name in parameters:
            raise bad("grid", name, "axes with names that are neither fields nor parameters")
    edges = _edges(axes, fields, parameters)
    symbols = symbols_of([*fields, *coordinates, *parameters])
    known = symbols | shorthands(definitions, functions, symbols, "declare it in parameters")
    reader = Reader(axes, fields, _sloped(axes, fields, edges), known)
    formulas = tuple(reader(f[name], f"f[{name!r}]") for name in fields)
    moving = set(symbols_of([*fields, *(one.name for one in reader.found.values())]).values())
    for formula in (*formulas, *(one.argument for one in reader.found.values())):
        refuse_uncompiled(formula, moving, "f")
    derivatives = tuple(reader.found.values())
    return GridRates(fields, formulas, derivatives, axes, tuple(parameters), edges)


def _edges(
    axes: Sequence[Axis], fields: Sequence[str], parameters: Sequence[str]
) -> tuple[Any, ...]:
    """What fields are at each end, or their slopes: formulas, end by end, in the fields' order."""
    symbols = symbols_of(parameters)
    found = []
    for axis in axes:
        for name in axis.values:
            if name not in fields:
                raise unknown(f"values of the axis {axis.name}: field", name, fields)
        for side in range(len(axis.ends)):
            found += [
                take_formula(
                    axis.values.get(name, (0, 0))[side], symbols, f"values[{name!r}]",
                    "declare it in parameters",
                )
                for name in fields
            ]  # fmt: skip
    return tuple(found)


def _sloped(
    axes: Sequence[Axis], fields: Sequence[str], edges: Sequence[Any]
) -> list[set[str]]:  # fmt: skip
    """By axis the fields with a slope at an end that is not 0."""
    found: list[set[str]] = []
    rest = iter(edges)
    for axis in axes:
        found.append(set())
        for kind in axis.boundary if axis.ends else ():
            slopes = dict(zip(fields, rest, strict=False))
            found[-1] |= {name for name in fields if kind == NEUMANN and slopes[name] != 0}
    return found


@dataclass(frozen=True)
class GridRates:
    """The rates of all fields at all places: called as f(x, **parameters)."""

    #: Names of the fields, each of which has a state at each place.
    fields: tuple[str, ...]
    #: Their rates, of the fields, the coordinates, the names of derivatives and the parameters.
    formulas: tuple[Any, ...]
    #: The derivatives, inner ones first.
    derivatives: tuple[Derivative, ...]
    #: The grid.
    axes: tuple[Axis, ...]
    #: Names of the parameters.
    parameters: tuple[str, ...]
    #: Values, or slopes, of the fields at each end of the axes.
    edges: tuple[Any, ...]

    @property
    def __name__(self) -> str:
        """The formulas, where a problem is written."""
        return ", ".join(
            f"{name}' = {formula}" for name, formula in zip(self.fields, self.formulas, strict=True)
        )

    @property
    def count(self) -> int:
        """How many places there are."""
        return int(np.prod([axis.n for axis in self.axes]))

    @property
    def coordinates(self) -> dict[str, Array]:
        """The coordinates of the places, axis by axis."""
        return {axis.name: axis.coordinates for axis in self.axes}

    @property
    def state(self) -> list[tuple[str, int]]:
        """The fields, and how many states each has."""
        return [(name, self.count) for name in self.fields]

    def stated(self) -> dict[str, str]:
        """The formulas as text that can be read again, derivatives written out."""
        written: dict[Any, Any] = {}
        for one in self.derivatives:  # inner ones first
            text = f"{one.word}({write_formula(one.argument.xreplace(written))})"
            (own,), (made,) = (symbols_of([name]).values() for name in (one.name, text))
            written[own] = made
        return {
            name: write_formula(formula.xreplace(written))
            for name, formula in zip(self.fields, self.formulas, strict=True)
        }

    def __call__(self, x: Array, **values: Any) -> Array:
        """The rates, field by field; of many states at once, the columns of x."""
        x = np.asarray(x, float)
        if any(np.ndim(value) for value in values.values()):
            given = [np.broadcast_to(value, x.shape[1]) for value in values.values()]
            each = (dict(zip(values, one, strict=True)) for one in zip(*given, strict=True))
            return np.stack([self(y, **v) for y, v in zip(x.T, each, strict=True)], axis=1)
        work = workings(self)
        many = x.reshape(len(x), -1)
        points, par = work.points(many, values)
        found = work.formulas(points[: self.count].reshape(-1, points.shape[-1]), par)
        ordered = found.reshape(self.count, many.shape[1], -1).transpose(2, 0, 1)
        return np.ascontiguousarray(ordered).reshape(x.shape)


@dataclass(frozen=True)
class GridSlopes:
    """The derivatives of rates on a grid by all states, a sparse matrix."""

    rates: GridRates

    def __call__(self, x: Array, **values: float) -> Any:
        """The derivatives at a state."""
        return workings(self.rates).slopes(x, values)


@functools.lru_cache(maxsize=16)
def workings(rates: GridRates) -> Workings:
    """What rates on a grid are computed with: made once, as it takes no part in copies."""
    return Workings(rates)


class Workings:
    """Compiled formulas and matrices of rates on a grid."""

    def __init__(self, rates: GridRates) -> None:
        self.rates, axes, fields = rates, rates.axes, rates.fields
        self.local = (*fields, *(axis.name for axis in axes))
        names = (*self.local, *(one.name for one in rates.derivatives))
        self.formulas = pointwise(rates.formulas, names, rates.parameters)
        self.edges = pointwise(rates.edges, (), rates.parameters)
        self.matrices = [derivative(axes, one.word, one.parity) for one in rates.derivatives]
        self.sources: list[Pointwise] = [
            pointwise((one.argument,), names[: len(self.local) + k], rates.parameters)
            for k, one in enumerate(rates.derivatives)
        ]
        self.place, self.end, self.sloped = self._places()
        self.flat = [self._flat(one.argument) for one in rates.derivatives]
        self._structure()

    def _places(self) -> tuple[Array, Any, Any]:
        """Coordinates of all places and of those beyond ends; the ends of these, and their kind."""
        axes, parts = self.rates.axes, []
        mesh = np.meshgrid(*(axis.coordinates for axis in axes), indexing="ij")
        parts.append(np.stack([one.ravel() for one in mesh], axis=1))
        end, sloped, number = [], [], 0
        for k, axis in enumerate(axes):
            for side, at in enumerate(axis.ends):
                given = [one.coordinates if j != k else [at] for j, one in enumerate(axes)]
                mesh = np.meshgrid(*given, indexing="ij")
                parts.append(np.stack([one.ravel() for one in mesh], axis=1))
                end.append(np.full(len(parts[-1]), number))
                sloped.append(np.full(len(parts[-1]), axis.boundary[side] == NEUMANN))
                number += 1
        whole = [np.zeros(0, int)], [np.zeros(0, bool)]
        return (
            np.concatenate(parts), np.concatenate([*whole[0], *end]).astype(int),
            np.concatenate([*whole[1], *sloped]).astype(bool),
        )  # fmt: skip

    def _flat(self, argument: Any) -> int:
        """Which field an argument is; -1 if it is none."""
        fields = self.rates.fields
        own = argument.is_Symbol and argument.name in fields
        return fields.index(argument.name) if own else -1

    def points(self, x: Array, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Fields, coordinates and derivatives at all places and, as far as known, beyond ends.

        Of states that are the columns of x: shape (places, states, values).
        """
        rates = self.rates
        par = np.array([values[name] for name in rates.parameters], float)
        count, wide, first = rates.count, len(self.place), len(self.local)
        many, fields = x.shape[1], len(rates.fields)
        out = np.zeros((wide, many, first + len(rates.derivatives)))
        out[:count, :, :fields] = x.reshape(fields, count, many).transpose(1, 2, 0)
        out[:, :, fields:first] = self.place[:, None]
        if wide > count:
            edges = self.edges(np.zeros((1, 0)), par).reshape(-1, fields)
            out[count:, :, :fields] = edges[self.end][:, None]
        for k, (matrix, source, flat) in enumerate(
            zip(self.matrices, self.sources, self.flat, strict=True)
        ):
            if flat >= 0:
                given = out[:, :, flat]
            else:
                inner = out[:, :, : first + k].reshape(wide * many, -1)
                given = source(inner, par).reshape(wide, many)
                given[count:][self.sloped] = 0.0
            out[:count, :, first + k] = matrix @ given
        return out, par

    def _structure(self) -> None:
        """Where the slopes of formulas enter the matrix of derivatives.

        A derivative that is linear in the fields is a constant matrix; others are multiplied anew.
        """
        from scipy.sparse import csr_array

        rates = self.rates
        fields, count, first = len(rates.fields), rates.count, len(self.local)
        self.constant: list[Any] = []  # of derivatives by all states
        for k, one in enumerate(rates.derivatives):
            source = self.sources[k]
            matrix = self.matrices[k][:, :count]
            by = [j for j in source.columns if j < fields or first <= j < first + k]
            linear = _linear(one.argument, rates, k)
            inner = all(j < fields or self.constant[j - first] is not None for j in by)
            if not (linear and inner):
                self.constant.append(None)
                continue
            slopes = source.slopes(np.zeros((1, source.width)), np.zeros(len(rates.parameters)))[0]
            total = csr_array((count, fields * count))
            for slope, j in zip(slopes, source.columns, strict=True):
                if j < fields:
                    total = total + slope * self._of_field(matrix, j)
                elif first <= j < first + k:
                    total = total + slope * (matrix @ self.constant[j - first])
            self.constant.append(total.tocsr())
        rows, columns, factors, slope, cell = [], [], [], [], []
        self.rest: list[tuple[int, int, int]] = []  # slopes by derivatives that are not linear
        for s, (i, j) in enumerate(zip(self.formulas.rows, self.formulas.columns, strict=True)):
            if fields <= j < first or j >= first + len(rates.derivatives):
                continue
            if j < fields:
                own = np.arange(count)
                rows.append(i * count + own)
                columns.append(j * count + own)
                factors.append(np.ones(count))
            elif self.constant[j - first] is None:
                self.rest.append((s, i, j - first))
                continue
            else:
                entries = self.constant[j - first].tocoo()
                own = entries.row
                rows.append(i * count + own)
                columns.append(entries.col)
                factors.append(entries.data)
            cell.append(own)
            slope.append(np.full(len(own), s))
        states = fields * count
        row, column, self.factors, self.slope, self.cell = (
            np.concatenate(one) if one else np.zeros(0, int)
            for one in (rows, columns, factors, slope, cell)
        )
        order = np.lexsort((row, column))
        row, column = row[order], column[order]
        self.factors, self.slope, self.cell = (
            one[order] for one in (self.factors, self.slope, self.cell)
        )
        new = np.ones(len(row), bool)
        new[1:] = (row[1:] != row[:-1]) | (column[1:] != column[:-1])
        self.begin = np.flatnonzero(new)
        self.indices = row[self.begin].astype(np.int32)
        self.indptr = np.searchsorted(column[self.begin], np.arange(states + 1)).astype(np.int32)

    def _of_field(self, matrix: Any, field: int) -> Any:
        """A matrix of one field's states as one of all states."""
        from scipy.sparse import csr_array

        count = self.rates.count
        return csr_array(
            (matrix.data, matrix.indices + field * count, matrix.indptr),
            shape=(count, len(self.rates.fields) * count),
        )

    def slopes(self, x: Array, values: Mapping[str, float]) -> Any:
        """The derivatives of the rates by the states, by columns."""
        from scipy.sparse import csc_array, diags_array, vstack

        rates = self.rates
        fields, count = len(rates.fields), rates.count
        points, par = self.points(np.reshape(x, (-1, 1)), values)
        points = points[:, 0]
        slopes = self.formulas.slopes(points[:count], par)
        data = self.factors * slopes[self.cell, self.slope]
        summed = np.add.reduceat(data, self.begin) if len(data) else data
        found = csc_array(
            (summed, self.indices, self.indptr), shape=(fields * count, fields * count)
        )
        if not self.rest:
            return found
        moved = self._moved(points, par)
        more = []
        for i in range(fields):
            total = csc_array((count, fields * count))
            for s, row, k in self.rest:
                if row == i:
                    total = total + diags_array(slopes[:, s]) @ moved[k]
            more.append(total)
        return (found + vstack(more)).tocsc()

    def _moved(self, points: Array, par: Array) -> list[Any]:
        """The derivatives of all derivatives by the states, at a point."""
        from scipy.sparse import csr_array, diags_array

        rates = self.rates
        fields, count, first = len(rates.fields), rates.count, len(self.local)
        found: list[Any] = []
        for k, source in enumerate(self.sources):
            if self.constant[k] is not None:
                found.append(self.constant[k])
                continue
            matrix = self.matrices[k][:, :count]
            slopes = source.slopes(points[:count, : first + k], par)
            total = csr_array((count, fields * count))
            for s, j in enumerate(source.columns):
                part = matrix @ diags_array(slopes[:, s])
                if j < fields:
                    total = total + self._of_field(part.tocsr(), j)
                elif first <= j < first + k:
                    total = total + part @ found[j - first]
            found.append(total)
        return found


def _linear(argument: Any, rates: GridRates, k: int) -> bool:
    """Whether the slopes of a formula by fields and earlier derivatives are numbers."""
    names = {*rates.fields, *(one.name for one in rates.derivatives[:k])}
    moving = [symbol for symbol in argument.free_symbols if symbol.name in names]
    return all(argument.diff(symbol).is_number for symbol in moving)
