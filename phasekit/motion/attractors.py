"""Where motions end: the search for attractors that suits a law."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.laws.perturbed import PerturbedConservative, forcing_names, modulation_names
from phasekit.motion.attractor import TOO_LONG, TOO_WEAK, Attractors, Search
from phasekit.motion.autonomous import AutonomousSearch
from phasekit.motion.creeping import CreepingSearch
from phasekit.motion.flow import RTOL
from phasekit.motion.free import KEPT, FreeSearch
from phasekit.motion.method import circle, unit_of
from phasekit.motion.overdamped import OverdampedSearch, is_overdamped
from phasekit.motion.pace import is_stiff, pace_of, units_of
from phasekit.motion.strobe import common_period, strobe
from phasekit.motion.strobed import StrobedSearch

__all__ = ["TOO_LONG", "TOO_WEAK", "Attractors", "Search", "StrobedSearch", "find", "find_of"]


#: Distance from the box at which a motion is gone for good, in its widths.
FAR = 1e3


def find(
    law: PerturbedConservative,
    values: Mapping[str, Array],
    leg: float,
    states: Array,
    rtol: float = RTOL,
) -> Search:
    """Return the attractors to which motions from states come, seen once a leg.

    The states, of shape (n, 2), also say how coordinates and rates are measured.
    """
    width, fastest = _extent(law, values, leg, states)
    calm = not _varies(law, values) and min(values["damping"], values["quadratic"]) >= 0.0
    how = law, values, leg, np.array([width, 2.0 * fastest]), rtol
    search: Search = AutonomousSearch(*how) if calm else StrobedSearch(*how)
    if not calm and search.repeats and is_overdamped(law, values, leg, states):
        search = OverdampedSearch(*how)
    search.look(states)
    search.order()
    return search


def find_of(
    law: Equations,
    values: Mapping[str, Array],
    states: Array,
    widths: Array,
    rtol: float = RTOL,
) -> Search:
    """Return the attractors of a flow or map to which motions from states come.

    A forced flow is seen once a period. Widths of the box in which states, of shape (n, states),
    start measure these; 0 where unknown.
    """
    units = units_of(law, values, states, widths)
    middle = 0.5 * (states.min(axis=0) + states.max(axis=0))
    angles = np.array([name in law.periods for name in law.states])
    far = np.where(angles, np.inf, FAR * units)
    bounds = np.stack([middle - far, middle + far])
    period = common_period(law, values)
    if isinstance(law, Map) or period is not None:
        leg = float(law.times if period is None else period)
        kind: type[Search] = StrobedSearch
        if period is not None and is_overdamped(law, values, leg, states):
            kind = OverdampedSearch
        elif period is not None and is_stiff(law, values, leg, states, units):
            kind = CreepingSearch
        search = kind(law, values, leg, units, rtol, bounds=bounds)
        search.kept = KEPT
    else:
        pace = pace_of(law, values, states, units)
        search = FreeSearch(
            law, values, pace.leg, units, rtol, bounds=bounds, fine=pace.fine, stiff=pace.stiff
        )
    search.look(states)
    search.order()
    return search


def _varies(law: PerturbedConservative, values: Mapping[str, Array]) -> bool:
    """Whether anything in the law varies with time."""
    names = [forcing_names(i)[0] for i in range(law.harmonics)]
    names += [modulation_names(name)[0] for name in law.modulated]
    varies = any(float(values[name]) != 0.0 for name in names)
    return varies or bool(law.drifting) or law.prescribed is not None


def _extent(
    law: PerturbedConservative, values: Mapping[str, Array], leg: float, states: Array
) -> tuple[float, float]:
    """Width in the coordinate and greatest rate of states, or of the motions from them."""
    width, fastest = float(np.ptp(states[:, 0])), float(np.abs(states[:, 1]).max())
    if width and fastest:
        return width, fastest
    seen = strobe(law, values, states, leg / 8.0, 17).states.reshape(-1, 2)
    seen = seen[np.isfinite(seen).all(axis=1)]
    if not width and circle(law):
        width = unit_of(law)
    elif not width:
        far = float(np.abs(seen[:, 0]).max(initial=0.0))
        width = max(float(np.ptp(seen[:, 0])) if seen.size else 0.0, 1e-3 * far) or 1.0
    return width, fastest or max(float(np.abs(seen[:, 1]).max(initial=0.0)), width / leg)
