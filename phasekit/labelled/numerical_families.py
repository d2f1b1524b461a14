"""Families of orbits in any potential: which wells there are, and which of them join where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.errors import EquilibriumKind, OrbitKind, ParameterError
from phasekit.labelled.orbits import orbits
from phasekit.labelled.phase_space import equilibria
from phasekit.labels.arguments import FloatArray, bad
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.systems.as_system import single
from phasekit.systems.system import Model
from phasekit.table.quantities import ROWS

#: Energies approach a separatrix as this power of the level: periods grow with their logarithm.
CLUSTER = 4
#: Energies of equilibria that differ by less, relative to the largest of them, are one.
SAME = 16.0 * float(np.finfo(float).eps)

#: The centers that an orbit goes round, by their numbers; none for a rotation.
Wells = tuple[int, ...]


@dataclass
class _Family:
    """Orbits round some wells, above their deepest center: from one energy to another."""

    wells: Wells
    low: float
    high: float
    open: bool = False  # no separatrix ends it

    @property
    def label(self) -> str:
        if not self.wells:
            return "rotation"
        return f"well{'s' * (len(self.wells) > 1)}_{'_'.join(map(str, self.wells))}"

    def rises(self, bottom: float, level: FloatArray) -> FloatArray:
        """Energies above the deepest center, close to each other next to separatrices."""
        begin, height = self.low - bottom, self.high - self.low
        up, down = level**CLUSTER, (1.0 - level) ** CLUSTER
        if len(self.wells) == 1:  # begins at its center
            return begin + height * (level**2 if self.open else 1.0 - down)
        if self.open:
            return begin + height * up
        both = 2.0 ** (CLUSTER - 1)
        return begin + height * np.where(level < 0.5, both * up, 1.0 - both * down)


def families_of_any(system: Model, n: int, energy_max: float | None) -> xr.Dataset:
    """Orbits of each family of one system, which has a law of any potential."""
    single(system)
    points = equilibria(system)
    phi, energy = points.phi.values, points.energy.values
    centers = [int(k) for k in np.flatnonzero(points.kind.values == EquilibriumKind.CENTER)]
    if not centers:
        raise bad("system", system, "a system with a center, for without one nothing oscillates")
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
                "energy_max: got nothing, wants the energy up to which orbits are taken, for no "
                "saddle bounds them"
            )
    found = _families(system, phi, energy, marks, centers, float(energy_max))
    level = (np.arange(n) + 0.5) / n
    deepest = [
        min(f.wells) if drop else min(f.wells or centers, key=lambda k: energy[k]) for f in found
    ]
    rises = [f.rises(energy[k], level) for f, k in zip(found, deepest, strict=True)]
    start = np.repeat(phi[deepest], n)
    orbit = orbits(system, start, np.sqrt(2.0 * np.concatenate([*rises, []])))
    levels = [energy[k] + rise for k, rise in zip(deepest, rises, strict=True)]
    shape = (len(found), n)
    data = {"energy_level": np.concatenate([*levels, []])}
    for name in ("period", "frequency", "action", "period_error", "action_error"):
        data[name] = orbit[name].values
    coords = {
        "family": variable(
            ("family",), np.array([f.label for f in found], LABEL_DTYPE),
            {"long_name": "family of orbits, by the numbers of its centers"},
        ),
        "level": variable(("level",), level, input_attrs(system, "level")),
        **{k: variable((), v, input_attrs(system, k)) for k, v in system.parameters.items()},
    }  # fmt: skip
    attrs = {name: orbit[name].attrs for name in data if name in orbit}
    attrs["energy_level"] = ROWS["energy_level"].attrs
    variables = {
        name: variable(("family", "level"), values.reshape(shape), attrs[name])
        for name, values in data.items()
    }
    return xr.Dataset(variables, coords, dataset_attrs(system))


def fall_per_turn(system: Model) -> float:
    """What the potential of a system falls by in a turn under a torque; 0 on a line."""
    period = getattr(getattr(system, "system", None), "period", None)
    return float(system.parameters.get("torque", 0.0)) * period if period else 0.0


def _families(
    system: Model,
    phi: FloatArray,
    energy: FloatArray,
    heights: FloatArray,
    centers: list[int],
    top: float,
) -> list[_Family]:
    """The families below an energy, from the lowest to the highest.

    Between two energies of equilibria nothing changes: there one orbit tells for each center
    which wells it shares. Under a torque a family is seen from its center of the least number,
    for from others its energies differ by those of turns.
    """
    marks = np.unique(heights[np.isfinite(heights) & (heights < top)])
    scale = float(np.abs(marks).max(initial=0.0))
    marks = marks[np.diff(marks, prepend=-np.inf) > SAME * scale]
    edges = np.append(marks, top)
    found: dict[Wells, _Family] = {}
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
            family = found.setdefault(wells, _Family(wells, float(low), float(high)))
            family.high, family.open = float(high), high == top
    return sorted(found.values(), key=lambda f: (f.low, len(f.wells), f.wells))


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
