"""Families of orbits in any potential: which wells there are, and which of them join where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.errors import EquilibriumKind, OrbitKind, ParameterError
from phasekit.labelled.orbits import orbits
from phasekit.labelled.phase_space import equilibria
from phasekit.labels.arguments import FloatArray, bad
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.phase.numerical.constants import constant, reduced
from phasekit.phase.numerical.formula import Formula
from phasekit.systems.system import System, single
from phasekit.table.quantities import ROWS

#: Energies approach a separatrix as this power of the level: periods grow with their logarithm.
CLUSTER = 4
#: Energies of equilibria that differ by less, relative to the largest of them, are one.
SAME = 16.0 * float(np.finfo(float).eps)
QUANTITIES = ("period", "frequency", "action", "period_error", "action_error")

#: The centers that an orbit goes round, by their numbers; none for a rotation.
Wells = tuple[int, ...]


@dataclass(frozen=True)
class _Wall:
    """A saddle, by its number among the saddles, and the side on which the orbits are."""

    saddle: int
    side: str


@dataclass
class _Family:
    """Orbits round some wells, above their deepest center: from one energy to another."""

    wells: Wells
    low: float
    high: float
    open: bool = False  # no separatrix ends it
    floor: _Wall | None = None  # the saddle at its lowest energy, if it goes over that
    wall: _Wall | None = None  # a saddle at its highest energy

    @property
    def label(self) -> str:
        if not self.wells:
            return "rotation"
        return f"well{'s' * (len(self.wells) > 1)}_{'_'.join(map(str, self.wells))}"

    def rises(self, bottom: float, level: FloatArray) -> FloatArray:
        """Energies above the deepest center, close to each other next to separatrices."""
        begin, height = self.low - bottom, self.high - self.low
        if len(self.wells) == 1 and self.open:  # begins at its center
            return begin + height * level**2
        above, below = self.gaps(level)
        return begin + np.where(np.isnan(below), above, height + below)

    def gaps(self, level: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energies above the lowest and below the highest, NaN where the other one is nearer."""
        height, nothing = self.high - self.low, np.full(level.shape, np.nan)
        up, down = level**CLUSTER, (1.0 - level) ** CLUSTER
        if self.open:
            return height * up, nothing
        if len(self.wells) == 1:
            return nothing, -height * down
        both = 2.0 ** (CLUSTER - 1)
        near = level < 0.5
        return (
            np.where(near, height * both * up, np.nan),
            np.where(near, np.nan, -height * both * down),
        )


def families_of_any(system: System, n: int, energy_max: float | None) -> xr.Dataset:
    """Orbits of each family of one system, which has a law of any potential."""
    single(system)
    whole, (system, base) = system, _reduced(system)
    energy_max = None if energy_max is None else energy_max - base
    points = equilibria(system)
    phi, energy = points.phi.values, points.energy.values
    centers = [int(k) for k in np.flatnonzero(points.kind.values == EquilibriumKind.CENTER)]
    if not centers:
        raise bad("system", system, "a system with a center; without one nothing oscillates")
    drop = fall_per_turn(system)
    # Under a torque what bounds a well may be a saddle of the next turn.
    marks = (energy[:, None] + drop * np.array([-1.0, 0.0, 1.0])) if drop else energy[:, None]
    barriers = marks[points.kind.values != EquilibriumKind.CENTER]
    barriers = barriers[np.isfinite(barriers)]
    bottom = float(energy[centers].min())
    top = float(barriers.max()) if barriers.size else bottom
    if energy_max is None:
        energy_max = 2.0 * top - bottom
        if not top > bottom:
            raise ParameterError(
                "energy_max: got nothing, wants the largest energy of the orbits, because no "
                "saddle bounds them"
            )
    found = _families(system, points, marks, centers, float(energy_max))
    if not found:
        raise bad("energy_max", base + energy_max, "an energy below which orbits are closed")
    level = (np.arange(n) + 0.5) / n
    deepest = [
        min(f.wells) if drop else min(f.wells or centers, key=lambda k: energy[k]) for f in found
    ]
    rises = [f.rises(energy[k], level) for f, k in zip(found, deepest, strict=True)]
    levels = [base + (energy[k] + rise) for k, rise in zip(deepest, rises, strict=True)]
    shape = (len(found), n)
    data = {"energy_level": np.concatenate([*levels, []])}
    found_, attrs = _orbits(system, found, phi[deepest], rises, level)
    data.update(found_)
    coords = {
        "family": variable(
            ("family",), np.array([f.label for f in found], LABEL_DTYPE),
            {"long_name": "family of orbits, by the numbers of its centers"},
        ),
        "level": variable(("level",), level, input_attrs(whole, "level")),
        **{k: variable((), v, input_attrs(whole, k)) for k, v in whole.parameters.items()},
    }  # fmt: skip
    attrs["energy_level"] = ROWS["energy_level"].attrs
    variables = {
        name: variable(("family", "level"), values.reshape(shape), attrs[name])
        for name, values in data.items()
    }
    return xr.Dataset(variables, coords, dataset_attrs(whole))


def _reduced(system: System) -> tuple[System, float]:
    """A system without the constant part of its potential, and that part."""
    law = system.law
    formula = getattr(law, "base", law)
    if not isinstance(formula, Formula):
        return system, 0.0
    base = float(constant(formula, [system.parameters[name] for name in formula.names]))
    if not base:
        return system, 0.0
    expression = reduced(formula).expression
    if formula is law:
        return system.replace(expression=expression), base
    own: Any = system
    return own.replace(system=own.system.replace(expression=expression)), base


def _orbits(
    system: System,
    families: list[_Family],
    starts: FloatArray,
    rises: list[FloatArray],
    level: FloatArray,
) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """Quantities of the orbits of families in a row, and their attributes.

    By their energies above a saddle, which keep the digits next to it, where there is one; else
    from their centers.
    """
    groups: dict[_Wall | None, list[tuple[npt.NDArray[np.intp], FloatArray]]] = {}
    for number, (family, rise) in enumerate(zip(families, rises, strict=True)):
        parts = [
            (wall, np.flatnonzero(np.isfinite(gap)), gap)
            for wall, gap in zip((family.floor, family.wall), family.gaps(level), strict=True)
        ]
        if any(wall is None and some.size for wall, some, _ in parts):
            parts = [(None, np.arange(level.size), rise)]
        for wall, some, gap in parts:
            if some.size:
                groups.setdefault(wall, []).append((number * level.size + some, gap[some]))
    found = {name: np.full(len(families) * level.size, np.nan) for name in QUANTITIES}
    attrs: dict[str, Any] = {}
    for wall, members in groups.items():
        rows, values = (np.concatenate(part) for part in zip(*members, strict=True))
        if wall is None:
            orbit = orbits(system, starts[rows // level.size], np.sqrt(2.0 * values))
        else:
            orbit = orbits(system, gap=values, saddle=wall.saddle, side=wall.side)
        for name in QUANTITIES:
            found[name][rows] = orbit[name].values
            attrs[name] = orbit[name].attrs
    return found, attrs


def fall_per_turn(system: System) -> float:
    """What the potential of a system falls by in a turn under a torque; 0 on a line."""
    period = getattr(getattr(system, "system", None), "period", None)
    return float(system.parameters.get("torque", 0.0)) * period if period else 0.0


def _families(
    system: System,
    points: xr.Dataset,
    heights: FloatArray,
    centers: list[int],
    top: float,
) -> list[_Family]:
    """The families below an energy, from the lowest to the highest.

    Between two energies of equilibria nothing changes: there one orbit tells for each center
    which wells it shares. Under a torque a family is seen from its center of the least number,
    for from others its energies differ by those of turns.
    """
    phi, energy = points.phi.values, points.energy.values
    marks = np.unique(heights[np.isfinite(heights) & (heights < top)])
    scale = float(np.abs(marks).max(initial=0.0))
    marks = marks[np.diff(marks, prepend=-np.inf) > SAME * scale]
    edges = np.append(marks, top)
    found: dict[Wells, _Family] = {}
    walls = _Walls.from_system(system, points, SAME * scale)
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        middle = 0.5 * (low + high)
        here = [k for k in centers if energy[k] <= low + SAME * scale]
        if not here:
            continue
        orbit = orbits(system, phi[here], np.sqrt(2.0 * (middle - energy[here])))
        sharing = [_wells(orbit.isel(point=i), phi, here, centers) for i in range(len(here))]
        if heights.shape[1] > 1:
            pairs = zip(sharing, here, strict=True)
            sharing = [w if w and min(w) == k else None for w, k in pairs]
        for wells in set(sharing) - {None}:
            arc = orbit.isel(point=sharing.index(wells))
            if wells not in found:
                found[wells] = _Family(wells, float(low), float(high))
                found[wells].floor = walls.floor(arc, float(low))
            family = found[wells]
            family.high, family.open = float(high), high == top
            family.wall = walls.wall(arc, float(high))
    return sorted(found.values(), key=lambda f: (f.low, len(f.wells), f.wells))


@dataclass(frozen=True)
class _Walls:
    """Saddles in this turn and those next to it, in the order of their places."""

    number: npt.NDArray[np.intp]
    place: FloatArray
    energy: FloatArray
    same: float

    @classmethod
    def from_system(cls, system: System, points: xr.Dataset, same: float) -> _Walls:
        """The saddles of a system; energies that differ by less than `same` are one.

        None where equilibria are degenerate, for of these only some count as saddles.
        """
        kind = points.kind.values
        saddle = (kind == EquilibriumKind.SADDLE) & ~np.any(kind == EquilibriumKind.DEGENERATE)
        place, energy = points.phi.values[saddle], points.energy.values[saddle]
        number = np.arange(place.size)
        period = getattr(getattr(system, "system", system), "period", None)
        turns = np.arange(-2.0, 3.0)[:, None] if period else np.zeros((1, 1))
        place = (place[number] + turns * (period or 0.0)).ravel()
        energy = (energy[number] - turns * fall_per_turn(system)).ravel()
        order = np.argsort(place)
        number = np.tile(number, turns.size)
        return cls(number[order], place[order], energy[order], same)

    def wall(self, arc: xr.Dataset, energy: float) -> _Wall | None:
        """A saddle of an energy next to an arc."""
        last = int(np.searchsorted(self.place, arc.phi_min.item())) - 1
        first = int(np.searchsorted(self.place, arc.phi_max.item()))
        for k, side in ((first, "left"), (last, "right")):
            if 0 <= k < self.place.size and abs(self.energy[k] - energy) <= self.same:
                return _Wall(int(self.number[k]), side)
        return None

    def floor(self, arc: xr.Dataset, energy: float) -> _Wall | None:
        """A saddle of an energy under an arc, or under a rotation, which has no ends."""
        low, high = arc.phi_min.item(), arc.phi_max.item()
        inside = ~((self.place <= low) | (self.place >= high))
        level = np.flatnonzero(inside & (np.abs(self.energy - energy) <= self.same))
        return _Wall(int(self.number[level[0]]), "right") if level.size else None


def _wells(orbit: xr.Dataset, phi: FloatArray, here: list[int], every: list[int]) -> Any:
    """The centers that an orbit goes round; None where it goes round none for ever.

    On a circle these may be deeper in another turn than in their own.
    """
    kind = orbit.orbit_kind.item()
    if kind == OrbitKind.ROTATION:
        return ()
    if kind != OrbitKind.LIBRATION:
        return None
    low, high = orbit.phi_min.item(), orbit.phi_max.item()
    period = orbit.attrs.get("phasekit_period", "None")
    centers = here if period == "None" else every
    places = [phi[k] for k in centers]
    if period != "None":
        turn = float(period)
        places = [low + (place - low) % turn for place in places]
    return tuple(k for k, place in zip(centers, places, strict=True) if low < place < high)
