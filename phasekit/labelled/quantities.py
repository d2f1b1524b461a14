"""The table of quantities: what phasekit computes on a map, one row each.

Labelled functions, sweeps, the attributes of stored maps and the reference pages all follow from
this table. A new quantity is a row in `QUANTITIES` and a line in `PASSES` that names the array
function which computes it; nothing else has to change.

In derived units the radian is 1 and left out: angles are in rad, rates in s-1, energies (per unit
of inertia about the shaft) in s-2, areas of the phase plane and actions in s-1.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, TypeAlias

import numpy as np

from phasekit.errors import (
    EquilibriumKind,
    Loop,
    OrbitFamily,
    OrbitKind,
    ParameterError,
    Topology,
)
from phasekit.labelled.arguments import bad, unknown

#: Labels of a dim, names or numbers, and its long name.
Labels: TypeAlias = tuple[Sequence[Any], str]

#: Label coordinates: dim -> (labels, long_name).
LABELS: dict[str, Labels] = {
    "equilibrium": (
        ("lower_center", "lower_saddle", "upper_center", "upper_saddle"),
        "branch of equilibria",
    ),
    "saddle": (("lower", "upper"), "saddle, by its energy"),
    "side": (("left", "right"), "side of the saddle"),
    "fold": (("minus", "plus"), "fold with A < 0, fold with A > 0"),
    "family": (("lower_well", "upper_well", "outer", "rotation"), "family of orbits"),
}

#: States, which quantities may need beside the parameters: name -> (units, long_name).
STATES: dict[str, tuple[str, str]] = {
    "state_phi": ("rad", "angle of the state"),
    "state_dphi": ("s-1", "angular velocity of the state"),
    "state_energy": ("s-2", "energy of the state"),
    "state_gap": ("s-2", "energy of the state above the saddle"),
    "state_excess": ("s-2", "energy of the state above the center"),
    "state_action": ("s-1", "action of the state"),
    "state_angle": ("rad", "angle variable of the state"),
    "state_family": ("1", "family of the state's orbit, a code of OrbitFamily"),
    "time": ("s", "time"),
    "level": ("1", "place of the orbit in its family, by energy from 0 to 1"),
}

#: States whose bare arrays make an axis, where those of the others pair on the dim `point`.
AXES = ("time", "level")

FROM_ENERGY = "[Veljovic2015] (14), corrected coefficients"
FROM_MOTION = "[Veljovic2015] (12), corrected coefficients"
ACTION_ANGLE = f"{FROM_ENERGY}; [LandauLifshitz1976] section 50"
SMALL = f"expansion of {FROM_MOTION}; [LandauLifshitz1976] section 28"


@dataclass(frozen=True, slots=True)
class Quantity:
    """One row: a variable of a labelled result."""

    name: str
    group: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    equation: str
    source: str
    flags: type[IntEnum] | None = None
    #: Labels of the row's dims where they are not those of the table.
    labels: Mapping[str, Labels] | None = field(default=None, compare=False)

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the variable, as they stand in every Dataset."""
        attrs: dict[str, Any] = {
            "long_name": self.long_name,
            "units": self.units,
            "equation": self.equation,
            "source": self.source,
        }
        if self.flags is not None:
            attrs["flag_values"] = np.array([flag.value for flag in self.flags], dtype=np.int8)
            attrs["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return attrs

    @property
    def label_shape(self) -> tuple[int, ...]:
        """Lengths of the label dims."""
        return tuple(len(self.labels_of(dim)[0]) for dim in self.dims)

    def labels_of(self, dim: str) -> Labels:
        """Labels of a dim, with its long name."""
        return (self.labels or LABELS)[dim]

    @property
    def cell_bytes(self) -> int:
        """Bytes that one cell of a map takes."""
        return int(np.prod(self.label_shape, dtype=int)) * np.dtype(self.dtype).itemsize


@dataclass(frozen=True, slots=True)
class Pass:
    """One call of an array function, which computes whole groups at once.

    `inputs` are coefficients (A, B, C), parameters, states, or quantities of other groups; those
    come with their label axes last. The function returns one result a group, each a NamedTuple
    whose fields are named as the quantities; a lone result may be a bare array or tuple.
    """

    function: str | Callable[..., Any]  # "module:name", imported when it is first needed
    inputs: tuple[str, ...]
    groups: tuple[str, ...]

    def call(self, *arrays: Any) -> dict[str, Any]:
        """Return the arrays by the names of the quantities."""
        function = self.function
        if isinstance(function, str):
            module, _, name = function.partition(":")
            function = getattr(importlib.import_module(module), name)
        result = function(*arrays)
        results = result if len(self.groups) > 1 else (result,)
        named: dict[str, Any] = {}
        for group, part in zip(self.groups, results, strict=True):
            if hasattr(part, "_asdict"):
                named.update(part._asdict())
            else:
                names = [row.name for row in ROWS.values() if row.group == group]
                named.update(zip(names, part if isinstance(part, tuple) else (part,), strict=True))
        return named


_BRANCHES = ("equilibrium",)
_SADDLES = ("saddle",)
_SIDES = ("saddle", "side")

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("potential", "potential", (), "float64", "s-2", "potential",
             "V = -B cos(phi) + (A/2) cos(phi)^2 - C sin(phi)",
             "[Veljovic2015] (15) plus Omega^2/2, corrected coefficients"),
    Quantity("potential_gradient", "potential_gradient", (), "float64", "s-2",
             "gradient of the potential",
             "V' = B sin(phi) - A sin(phi) cos(phi) - C cos(phi)", FROM_MOTION),
    Quantity("potential_curvature", "potential_curvature", (), "float64", "s-2",
             "curvature of the potential",
             "V'' = B cos(phi) - A cos(2 phi) + C sin(phi)", "derivative of " + FROM_MOTION),
    Quantity("energy_integral", "energy_integral", (), "float64", "s-2", "energy integral",
             "h = phi'^2/2 + V(phi)", FROM_ENERGY),
    Quantity("phase_velocity", "phase_velocity", (), "float64", "s-1",
             "angular velocity at given energy, NaN where the energy is too low",
             "phi' = sqrt(2 (h - V(phi)))", FROM_ENERGY),
    Quantity("phi", "equilibria", _BRANCHES, "float64", "rad", "angle of the equilibrium",
             "V'(phi) = 0", FROM_MOTION),
    Quantity("kind", "equilibria", _BRANCHES, "int8", "1", "kind of the equilibrium",
             "center: V'' > 0, saddle: V'' < 0, degenerate: V'' = 0", FROM_MOTION,
             EquilibriumKind),
    Quantity("energy", "equilibria", _BRANCHES, "float64", "s-2",
             "potential at the equilibrium", "V(phi)", FROM_ENERGY),
    Quantity("curvature", "equilibria", _BRANCHES, "float64", "s-2",
             "curvature of the potential at the equilibrium",
             "V''(phi) = B cos(phi) - A cos(2 phi) + C sin(phi)", FROM_MOTION),
    Quantity("natural_frequency", "equilibria", _BRANCHES, "float64", "s-1",
             "angular frequency of small oscillations about the center", "sqrt(V''(phi))",
             FROM_MOTION),
    Quantity("exponent", "equilibria", _BRANCHES, "float64", "s-1",
             "exponent of the saddle", "k = sqrt(-V''(phi))", FROM_MOTION),
    Quantity("n_equilibria", "equilibria", (), "int8", "1",
             "number of distinct equilibria, -1 where the system is not valid",
             "sign of Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2", FROM_MOTION),
    Quantity("fold_margin", "equilibria", (), "float64", "1",
             "distance from the fold, > 0 where four equilibria exist",
             "1 - (|B/A|^(2/3) + |C/A|^(2/3))^(3/2)", FROM_MOTION),
    Quantity("topology", "separatrices", (), "int8", "1", "topology of the separatrices",
             "by the number of saddles and the order of their energies", FROM_ENERGY, Topology),
    Quantity("figure_eight", "separatrices", (), "bool", "1",
             "whether a separatrix has the shape of a figure-eight (the trigger of coupled "
             "singularities: center, saddle, center)",
             "Delta < 0 and the saddles' energies differ", FROM_ENERGY),
    Quantity("saddle_phi", "separatrices", _SADDLES, "float64", "rad", "angle of the saddle",
             "V'(phi_s) = 0, V''(phi_s) < 0", FROM_MOTION),
    Quantity("saddle_energy", "separatrices", _SADDLES, "float64", "s-2",
             "energy of the separatrix", "h_s = V(phi_s)", FROM_ENERGY),
    Quantity("saddle_exponent", "separatrices", _SADDLES, "float64", "s-1",
             "exponent of the saddle", "k = sqrt(-V''(phi_s))", FROM_MOTION),
    Quantity("loop", "separatrices", _SADDLES, "int8", "1",
             "what the separatrix of the saddle does",
             "sign of D = (A^2/4) sin(2 phi_s)^2 + (B cos(phi_s) + C sin(phi_s)) k^2",
             FROM_ENERGY, Loop),
    Quantity("winding_area", "separatrices", _SADDLES, "float64", "s-1",
             "area under one branch of the winding separatrix",
             "integral of |phi'| over 2 pi at h = h_s", FROM_ENERGY),
    Quantity("turning_offset", "separatrices", _SIDES, "float64", "rad",
             "signed angle from the saddle to the turning point, or to the partner saddle",
             "phi_t - phi_s", FROM_ENERGY),
    Quantity("turning_phi", "separatrices", _SIDES, "float64", "rad",
             "angle of the turning point of the separatrix, or of the partner saddle",
             "phi_t = -phi_s +- arccos(cos(2 phi_s) - 2 k^2/A)", FROM_ENERGY),
    Quantity("lobe_area", "separatrices", _SIDES, "float64", "s-1",
             "area inside the separatrix on one side of the saddle",
             "closed integral of phi' over the lobe at h = h_s", FROM_ENERGY),
    Quantity("orbit_kind", "orbits", (), "int8", "1", "kind of the orbit",
             "sign of h - V(phi_s); equilibrium: phi' = 0 and V'(phi) = 0", FROM_ENERGY,
             OrbitKind),
    Quantity("orbit_energy", "orbits", (), "float64", "s-2", "energy of the orbit",
             "h = phi'^2/2 + V(phi)", FROM_ENERGY),
    Quantity("period", "orbits", (), "float64", "s",
             "time of one round, infinite on a separatrix",
             "T = closed integral of dphi/phi' (rotation: over 2 pi)", FROM_ENERGY),
    Quantity("frequency", "orbits", (), "float64", "s-1", "angular frequency of the orbit",
             "2 pi/T", FROM_ENERGY),
    Quantity("action", "orbits", (), "float64", "s-1",
             "area inside the orbit, or under one turn of a rotation, over 2 pi",
             "J = (1/2 pi) closed integral of phi' dphi (rotation: over 2 pi)", ACTION_ANGLE),
    Quantity("phi_min", "orbits", (), "float64", "rad",
             "least angle of the orbit, NaN for a rotation", "V(phi_min) = h", FROM_ENERGY),
    Quantity("phi_max", "orbits", (), "float64", "rad",
             "greatest angle of the orbit, NaN for a rotation", "V(phi_max) = h", FROM_ENERGY),
    Quantity("orbit_family", "action_angle", (), "int8", "1", "family of the orbit",
             "by the centers that a libration goes round, or the sign of phi' of a rotation",
             FROM_ENERGY, OrbitFamily),
    Quantity("angle", "action_angle", (), "float64", "rad",
             "angle variable: 0 at phi_max, of a rotation at the lower center",
             "theta' = 2 pi/T, in [0, 2 pi)", ACTION_ANGLE),
    Quantity("twist", "action_angle", (), "float64", "1",
             "change of the frequency with the action", "d(2 pi/T)/dJ", ACTION_ANGLE),
    Quantity("phi_of_angle", "state_of", (), "float64", "rad",
             "angle at given action and angle variable",
             "phi after the time theta T/(2 pi) from theta = 0", ACTION_ANGLE),
    Quantity("dphi_of_angle", "state_of", (), "float64", "s-1",
             "angular velocity at given action and angle variable",
             "phi' after the time theta T/(2 pi) from theta = 0", ACTION_ANGLE),
    Quantity("motion_phi", "motion", (), "float64", "rad", "angle, continuous in time",
             "phi'' = -V'(phi)", FROM_MOTION),
    Quantity("motion_dphi", "motion", (), "float64", "s-1", "angular velocity",
             "phi'' = -V'(phi)", FROM_MOTION),
    Quantity("near_center_period", "near_center", _BRANCHES, "float64", "s",
             "period of small oscillations about the center, to first order in the energy",
             "(2 pi/w) (1 + eps (5 V'''^2/(24 w^6) - V''''/(8 w^4))), w^2 = V''", SMALL),
    Quantity("near_center_frequency", "near_center", _BRANCHES, "float64", "s-1",
             "angular frequency of small oscillations, to first order in the energy",
             "w - eps (5 V'''^2/(24 w^5) - V''''/(8 w^3)), w^2 = V''", SMALL),
    Quantity("near_separatrix_period", "near_separatrix", _SADDLES, "float64", "s",
             "period next to the separatrix of the saddle, to leading order in the gap",
             "(n/k) ln(32 k^6/(|gap| |D|)), heteroclinic: (2/k) ln(8 k^4/(|gap| |A|))",
             f"expansion of {FROM_ENERGY}"),
    Quantity("energy_level", "orbit_families", ("family",), "float64", "s-2",
             "energy of the orbit", "h = phi'^2/2 + V(phi)", FROM_ENERGY),
    Quantity("critical_fold", "critical", ("fold",), "float64", "1",
             "value of the parameter at the fold of equilibria",
             "|B|^(2/3) + |C|^(2/3) = |A|^(2/3)", FROM_MOTION),
    Quantity("critical_sign_change", "critical", (), "float64", "1",
             "value of the parameter where A changes sign", "A = 0", FROM_MOTION),
)
# fmt: on

ROWS: dict[str, Quantity] = {row.name: row for row in QUANTITIES}

_ABC = ("A", "B", "C")

#: Passes over the cells, those that compute more groups first. Groups that need an argument of
#: their own (critical: the parameter) have none; their functions make one for the call, as do those
#: that find orbits by something else than a state.
PASSES: tuple[Pass, ...] = (
    Pass("phasekit.phase.separatrices:phase_space", _ABC, ("equilibria", "separatrices")),
    Pass("phasekit.phase.equilibria:equilibria", _ABC, ("equilibria",)),
    Pass("phasekit.phase.separatrices:separatrices", _ABC, ("separatrices",)),
    Pass("phasekit.phase.potential:potential", (*_ABC, "state_phi"), ("potential",)),
    Pass("phasekit.phase.potential:gradient", (*_ABC, "state_phi"), ("potential_gradient",)),
    Pass("phasekit.phase.potential:curvature", (*_ABC, "state_phi"), ("potential_curvature",)),
    Pass(
        "phasekit.phase.potential:energy",
        (*_ABC, "state_phi", "state_dphi"),
        ("energy_integral",),
    ),
    Pass(
        "phasekit.phase.potential:phase_velocity",
        (*_ABC, "state_phi", "state_energy"),
        ("phase_velocity",),
    ),
    Pass(
        "phasekit.phase.action_angle:orbits_with_angles",
        (*_ABC, "state_phi", "state_dphi"),
        ("orbits", "action_angle"),
    ),
    Pass("phasekit.phase.orbits:orbits", (*_ABC, "state_phi", "state_dphi"), ("orbits",)),
    Pass(
        "phasekit.labelled.orbits:states_of",
        (*_ABC, "state_action", "state_angle", "state_family"),
        ("state_of",),
    ),
    Pass("phasekit.phase.flow:flow", (*_ABC, "state_phi", "state_dphi", "time"), ("motion",)),
    Pass("phasekit.phase.asymptotics:near_center", (*_ABC, "state_excess"), ("near_center",)),
    Pass("phasekit.phase.asymptotics:near_separatrix", (*_ABC, "state_gap"), ("near_separatrix",)),
)


def select(of: str | Iterable[str]) -> tuple[Quantity, ...]:
    """Return the rows that `of` names: groups, quantities, or several of either.

    Raises
    ------
    ParameterError
        If a name is unknown or nothing is named.
    """
    names = (of,) if isinstance(of, str) else of
    offered = quantities()
    if not isinstance(names, Iterable) or isinstance(names, (bytes, Mapping)):
        raise bad("of", of, "a name or a list of names", "pk.quantities() lists them")
    wanted: set[str] = set()
    for name in names:
        row = ROWS.get(name) if isinstance(name, str) else None
        if row is not None and name not in offered:
            raise ParameterError(
                f"of: got {name!r}, which needs an argument of its own; call pk.{row.group}"
            )
        if not isinstance(name, str) or (name not in offered and name not in offered.groups):
            raise unknown("of: the quantity", name, [*offered.groups, *offered])
        wanted.update([name] if name in offered else offered.groups[name])
    if not wanted:
        raise bad("of", of, "at least one name", "pk.quantities() lists them")
    return tuple(row for row in QUANTITIES if row.name in wanted)


def plan_passes(rows: Iterable[Quantity]) -> tuple[Pass, ...]:
    """Return the passes that compute the rows, as few as the table has."""
    missing = {row.group for row in rows}
    chosen = []
    for candidate in PASSES:
        if missing.issuperset(candidate.groups):
            chosen.append(candidate)
            missing.difference_update(candidate.groups)
    for group in sorted(missing):  # its passes compute others as well, which are not wanted
        if pass_of(group, chosen) not in chosen:
            chosen.append(pass_of(group, chosen))
    return tuple(chosen)


def pass_of(group: str, chosen: Sequence[Pass]) -> Pass:
    """Return the pass for a group: one of those chosen, else the one that computes the least."""
    for candidate in (*chosen, *reversed(PASSES)):
        if group in candidate.groups:
            return candidate
    raise KeyError(group)


class Quantities(Mapping[str, Quantity]):
    """The quantities that a sweep offers, by name; prints as a table."""

    def __init__(self) -> None:
        computed = {group for one in PASSES for group in one.groups}
        self._rows = {row.name: row for row in QUANTITIES if row.group in computed}

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Names of the quantities of each group."""
        names = dict.fromkeys(row.group for row in self._rows.values())
        return {g: tuple(r.name for r in self._rows.values() if r.group == g) for g in names}

    def __getitem__(self, name: str) -> Quantity:
        """Return the row of a quantity."""
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._rows)

    def __len__(self) -> int:
        """Return the number of quantities."""
        return len(self._rows)

    def __repr__(self) -> str:
        """Write the table."""
        head = ("quantity", "group", "dims", "units", "meaning")
        table = [
            (row.name, row.group, ", ".join(row.dims), row.units, row.long_name)
            for row in self._rows.values()
        ]
        widths = [max(len(line[i]) for line in [head, *table]) for i in range(4)]
        return "\n".join(
            "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=False))
            + f"  {line[-1]}"
            for line in [head, *table]
        )


def quantities() -> Quantities:
    """List what `sweep(of=...)` takes: quantities and groups of them, with units and meaning.

    Returns
    -------
    Quantities
        A mapping of name to row; a row has ``group``, ``dims``, ``units``, ``long_name``,
        ``equation`` and ``source``. Printed, it is a table.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.quantities()["winding_area"].units
    's-1'
    >>> "figure_eight" in pk.quantities().groups["separatrices"]
    True
    """
    return Quantities()
