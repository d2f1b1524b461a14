"""A potential that falls by a constant a turn: V - N x on a circle, V periodic and N a torque.

Its force lives on the circle, its energy on the line. So its equilibria are those of the circle,
and stand in the turn of the states and in one to either side. There orbits and separatrices are
those of a potential on a line. A libration lies within a turn of its state. What runs was turned
back once, where the potential rises; seen from as many turns before, it lies within a turn of
there as well. On a line a torque is a part of the potential, and nothing is repeated.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from phasekit.arrays import Array, Flags, Ints
from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.laws.formulas import symbols_of
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.differences import Ground, survey
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.separatrices import Separatrices, numbered, saddles_of, separatrices
from phasekit.phase.numerical.systems import Systems

#: Turns in which equilibria stand: that of the states, and one to either side.
SPAN = np.array([-1, 0, 1])
#: Rounding of the energy, as part of what a turn changes it by, that hides on which turn it is.
HIDDEN = 1e-3
_EPS = float(np.finfo(float).eps)


@functools.lru_cache(maxsize=128)
def torqued(formula: Formula) -> Formula:
    """A potential less torque times coordinate, with the torque as its last parameter."""
    name = "torque"
    while name == formula.coordinate:
        name += "_"
    expression, coefficients = formula.expression, formula.coefficients
    if expression is not None:
        symbols = symbols_of((formula.coordinate, name))
        expression = expression - symbols[name] * symbols[formula.coordinate]

    def pushed(parameters: tuple[Any, ...]) -> list[Any]:
        first, *rest = coefficients(*parameters[:-1]) if coefficients else (0.0,)
        return [first - parameters[-1], *rest]

    return replace(
        formula,
        text=f"{formula.text} - {name}*{formula.coordinate}",
        names=(*formula.names, name),
        expression=expression,
        values=lambda x, *p: formula.values(x, *p[:-1]) - p[-1] * x,
        slopes=lambda x, *p: formula.slopes(x, *p[:-1]) - p[-1],
        bends=lambda x, *p: formula.bends(x, *p[:-1]),
        coefficients=None if coefficients is None else lambda *p: pushed(p),
    )


@functools.lru_cache(maxsize=128)
def unrolled(formula: Formula) -> Formula:
    """The same under a torque on the line, over as many turns as `SPAN` has."""
    found = torqued(formula)
    if formula.period is None:
        return found
    reach = 0.5 * len(SPAN) * formula.period
    return replace(found, period=None, interval=(-reach, reach))


@dataclass(frozen=True, eq=False)
class Turns(Ground):
    """Systems under torques on the line, with the equilibria of some turns.

    Columns of the ground have a label, the place of the equilibrium in its turn, and the number of
    that turn. `own` are the columns of the turn of the states by label; `rise` and `hidden` are
    energies of equilibria of one turn above each other, and what rounding hides of them.
    """

    period: float | None
    torque: Array
    label: Ints
    turn: Ints
    own: Ints
    rise: Array
    hidden: Array
    #: Whether labels are those of closed forms: center, saddle, center, saddle.
    named: bool

    @classmethod
    def from_formula(
        cls, formula: Formula, own: list[Array], torque: Array, points: Equilibria,
        rise: tuple[Array, Array] | None = None, *, named: bool = False,
    ) -> Turns:  # fmt: skip
        """Lay out systems whose equilibria are found, with their rises if these are known."""
        turns, most = SPAN if formula.period else SPAN[1:2], points.phi.shape[1]
        if formula.period is not None:
            points, label, turn = repeated(points, torque, formula.period)
        else:
            label = np.broadcast_to(np.arange(most), points.phi.shape)
            turn = np.zeros_like(label)
        found = survey(Systems(unrolled(formula), (*own, torque), torque.size), points)
        columns = np.argsort(label + turns.size * max(most, 1) * (turn != 0), axis=1)[:, :most]
        energy = np.take_along_axis(points.energy, columns, axis=1)
        if rise is None:
            size = np.max(np.abs(points.energy), axis=1, initial=0.0, where=points.kind > 0)
            hidden = 8.0 * _EPS * size[:, None, None] * (1.0 - np.eye(most))
            rise = energy[:, :, None] - energy[:, None, :], hidden
        return cls(
            **vars(found), period=formula.period, torque=torque, label=label, turn=turn,
            own=columns, rise=rise[0], hidden=rise[1], named=named,
        )  # fmt: skip

    def take(self, rows: Ints) -> Turns:
        """The systems of some rows, which may repeat."""
        names = ("torque", "label", "turn", "own", "rise", "hidden")
        few: dict[str, Any] = {name: getattr(self, name)[rows] for name in names}
        few.update(vars(Ground.take(self, rows)))
        return Turns(**few, period=self.period, named=self.named)

    @property
    def circle(self) -> float | None:
        """Length of the circle of the force."""
        return self.period

    @property
    def fall(self) -> Array:
        """What each potential falls by in a turn; 0 on a line."""
        return self.torque * (self.period or 0.0)

    def above(self, column: Ints) -> Array:
        """Energy of one equilibrium of each system above all; 0 where rounding hides it."""
        rows = np.arange(column.size)
        if not self.label.shape[1]:
            return self.points.energy
        label, turn = self.label[rows, column], self.turn[rows, column]
        fall = self.fall[:, None] * (self.turn - turn[:, None])
        rise = self.rise[rows[:, None], label[:, None], self.label] + fall
        hidden = self.hidden[rows[:, None], label[:, None], self.label]
        return np.where(np.abs(rise) <= hidden, 0.0, rise)

    def columns_of(self, numbers: Sequence[int]) -> list[Ints]:
        """Columns of equilibria by their labels: all in one turn, or the last ones one before."""
        few = np.array(sorted(numbers), np.intp)
        ways = range(len(few) if self.period is not None else 1)
        place = np.arange(len(few))
        return [self._columns(few, np.where(place >= len(few) - way, -1, 0)) for way in ways]

    def _columns(self, label: Ints, turn: Any) -> Ints:
        """Columns of labels in turns, one a label; -1 where there is none."""
        same = (self.label[:, None, :] == label[:, None]) & (self.turn[:, None, :] == turn[:, None])
        same &= self.points.kind[:, None, :] > 0
        return np.where(same.any(axis=2), same.argmax(axis=2), -1)

    def place_error(self, column: Ints) -> Array:
        """How far rounding of V' may have moved one equilibrium of each system."""
        known = self.points.phi_error[np.arange(column.size), column]
        return Ground.place_error(self, column) + np.where(self.named, known, 0.0)

    def home(self, x: Array) -> tuple[Array, Array]:
        """Coordinates in the turn of the states, and what has been taken away."""
        if self.period is None:
            return x, np.zeros(x.shape)
        far = self.period * np.round(x / self.period)
        turns = np.where(np.abs(x) <= 0.5 * self.period, 0.0, far)
        return x - turns, turns

    def center(self, number: int | None) -> tuple[Ints, Flags]:
        """Column of the center of a number, or of the lowest; whether it is there."""
        usable = self._own(self.points.kind) == EquilibriumKind.CENTER
        if self.named:
            return self._column(np.full(len(usable), 2 * (number or 0)), usable)
        if number is not None:
            return self._column(np.full(len(usable), number), usable)
        return self._column(self._lowest(usable), usable)

    def saddle(self, number: int | Ints | None) -> tuple[Ints, Flags]:
        """Column of the saddle of a number among the saddles, or of the lowest."""
        usable = np.zeros(self.points.phi.shape, dtype=bool)
        usable[self.saddles] = True
        usable = self._own(usable)
        if self.named and number is None:
            return self._column(np.where(usable[:, 1], 1, 3), usable)
        if self.named:
            label = 2 * np.asarray(number) + 1
            return self._column(np.broadcast_to(label, len(usable)), usable)
        if number is None:
            return self._column(self._lowest(usable), usable)
        nth = usable & (np.cumsum(usable, axis=1) == number + 1)
        return self._column(np.argmax(nth, axis=1) if nth.size else np.zeros(len(nth), int), nth)

    @functools.cached_property
    def saddles(self) -> tuple[Ints, Ints]:
        """Rows and columns of the saddles in the turn of the states."""
        if self.named:  # what merges is none
            rows, columns = np.nonzero(self.points.kind == EquilibriumKind.SADDLE)
        else:
            rows, columns = saddles_of(self)
        keep = self.turn[rows, columns] == 0
        return rows[keep], columns[keep]

    def separatrices(self, *, measured: bool = True) -> Separatrices:
        """Separatrices of these saddles, if measured with their areas."""
        rows, columns = self.saddles
        if not self.named:
            placed = numbered(rows, columns)
            return separatrices(self, measured=measured, placed=placed)
        # Next to folds rounding of N moves the saddles: areas are given with that error.
        placed = rows, columns, self.label[rows, columns] // 2, 2
        return separatrices(self, measured=measured, placed=placed, worst=1.0)

    def _own(self, values: Any) -> Any:
        return np.take_along_axis(values, self.own, axis=1)

    def _lowest(self, usable: Flags) -> Ints:
        energy = np.where(usable, self._own(self.points.energy), np.inf)
        return np.argmin(energy, axis=1) if usable.size else np.zeros(len(usable), np.intp)

    def _column(self, label: Ints, usable: Flags) -> tuple[Ints, Flags]:
        rows, there = np.arange(len(usable)), label < usable.shape[1]
        if not there.any():
            return np.zeros(rows.shape, np.intp), there
        label = np.where(there, label, 0)
        return self.own[rows, label], there & usable[rows, label]


def repeated(points: Equilibria, torque: Array, period: float) -> tuple[Equilibria, Ints, Ints]:
    """Equilibria of a circle in as many turns as `SPAN` has, from left to right.

    Besides their places in their turns, and the numbers of these.
    """
    rows, width = points.phi.shape
    turn, label = (x.reshape(-1) for x in np.meshgrid(SPAN, np.arange(width), indexing="ij"))
    listed = {}
    for name, field in points._asdict().items():
        if field.ndim == 2 and name != "gaps":
            listed[name] = field[:, label]
    listed["phi"] = listed["phi"] + period * turn
    listed["energy"] = listed["energy"] - (period * turn) * torque[:, None]
    order = np.argsort(listed["phi"], axis=1)
    found = {name: np.take_along_axis(field, order, axis=1) for name, field in listed.items()}
    return points._replace(**found), label[order], turn[order]


def followed(turns: Turns, states: rounds.States, v: Array) -> rounds.Orbits:
    """Orbits of states; what runs round a circle is followed back to where it was turned."""
    if turns.period is None:
        return rounds.orbits_of(turns, states, v)
    torque, period = turns.torque, turns.period
    side = -np.sign(torque)
    turn = period * np.abs(torque)
    way = side[:, None] * (turns.points.phi - states.x[:, None])
    ahead = (way > 0.0) & (way <= period)
    with np.errstate(all="ignore"):
        rise = np.where(ahead, states.kinetic[:, None] - states.excess, -np.inf)
        highest = np.maximum(np.max(rise, axis=1, initial=-np.inf), turn)
        back = np.maximum(np.ceil((states.kinetic - highest) / turn), 0.0)
        back = np.where(np.isfinite(back), back, 0.0)
        kinetic = np.clip(states.kinetic - turn * back, 0.0, highest)
        kinetic = np.where(back > 0.0, kinetic, states.kinetic)
        lost = np.where(back > 0.0, 4.0 * _EPS * states.kinetic, 0.0)[:, None]
        blur = states.blur + lost
        moved = states._replace(
            turns=states.turns + side * period * back,
            kinetic=kinetic,
            excess=states.excess - (states.kinetic - kinetic)[:, None],
            blur=blur,
            error=states.error + lost,
        )
        found = rounds.orbits_of(turns, moved, v)
    kind = found.orbit_kind
    # Whether it comes to rest at a saddle of some turn is hidden by rounding where turns are.
    hidden = (back > 0.0) & (np.fmax.reduce(blur, axis=1, initial=0.0) > HIDDEN * turn)
    runs = (kind == OrbitKind.UNBOUNDED) | ((back > 0.0) & (kind == OrbitKind.LIBRATION)) | hidden
    unknown = {
        name: np.where(runs, np.nan, getattr(found, name))
        for name in ("period", "frequency", "action", "period_error", "action_error")
    }
    low = np.where(runs & (torque < 0.0), -np.inf, found.phi_min)
    high = np.where(runs & (torque > 0.0), np.inf, found.phi_max)
    kind = np.where(runs, OrbitKind.RUNNING, kind).astype(np.int8)
    return found._replace(
        orbit_kind=kind, phi_min=low, phi_max=high, amplitude=0.5 * (high - low), **unknown
    )
