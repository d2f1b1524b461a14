"""How the quantities of a `Potential` are computed: numerically, for any potential."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labelled.arguments import bad, one_of
from phasekit.labelled.grid import make_grid
from phasekit.labelled.methods import SIDES, Noted
from phasekit.labelled.quantities import (
    FROM_ENERGY,
    FROM_MOTION,
    LABELS,
    Labels,
    Pass,
    Quantity,
)
from phasekit.labelled.tiling import cut, tiles
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import Shape

if TYPE_CHECKING:
    from phasekit.labelled.potential_system import Potential

_STATES: dict[str, tuple[str, tuple[str, ...]]] = {
    "potential": ("potential", ("state_phi",)),
    "potential_gradient": ("gradient", ("state_phi",)),
    "potential_curvature": ("curvature", ("state_phi",)),
    "energy_integral": ("energy", ("state_phi", "state_dphi")),
    "phase_velocity": ("phase_velocity", ("state_phi", "state_energy")),
    "equilibria": ("equilibria", ()),
    "separatrices": ("separatrices", ()),
    "orbits": ("orbits", ("state_phi", "state_dphi")),
    "motion": ("flow_with_errors", ("state_phi", "state_dphi", "time")),
}
_POINTWISE = ("potential", "potential_gradient", "potential_curvature", "energy_integral")

#: What the table says of the closed forms alone.
_EQUATIONS = {
    "potential_gradient": "V'",
    "potential_curvature": "V''",
    "n_equilibria": "changes of sign of V' between the zeros of V''",
    "topology": "by what the separatrices of all saddles do",
    "figure_eight": "V = h_s on both sides of a saddle, before a saddle as high",
    "loop": "where V = h_s again on either side of the saddle",
    "turning_phi": "V(phi_t) = h_s",
    "winding_area": "integral of |phi'| over the circle at h = h_s",
    "period": "T = closed integral of dphi/phi' (rotation: over the circle)",
    "action": "J = (1/2 pi) closed integral of phi' dphi (rotation: over the circle)",
}
#: Rows that numerical results have besides those of the table, by group.
_BESIDE: dict[str, tuple[Quantity, ...]] = {
    "equilibria": (
        Quantity("complete", "equilibria", (), "bool", "1",
                 "whether it is proved that there are these equilibria and no others",
                 "bounds of V' and V'' over all pieces; disjoint discs; exact isolation of roots",
                 "[MooreKearfottCloud2009]; [Smith1970]"),
    ),
    "separatrices": (
        Quantity("winding_area_error", "separatrices", ("saddle",), "float64", "s-1",
                 "estimated error of the area under one branch", "of its quadrature", FROM_ENERGY),
        Quantity("lobe_area_error", "separatrices", ("saddle", "side"), "float64", "s-1",
                 "estimated error of the area inside the separatrix", "of its quadrature",
                 FROM_ENERGY),
    ),
    "orbits": (
        Quantity("period_error", "orbits", (), "float64", "s",
                 "estimated error of the period", "of its quadrature", FROM_ENERGY),
        Quantity("action_error", "orbits", (), "float64", "s-1",
                 "estimated error of the action", "of its quadrature", FROM_ENERGY),
    ),
    "motion": (
        Quantity("motion_phi_error", "motion", (), "float64", "rad",
                 "estimated error of the angle", "change of the energy, error of the period",
                 FROM_MOTION),
        Quantity("motion_dphi_error", "motion", (), "float64", "s-1",
                 "estimated error of the angular velocity",
                 "change of the energy, error of the period", FROM_MOTION),
    ),
}  # fmt: skip
BESIDE = tuple(row.name for rows in _BESIDE.values() for row in rows)
_ABSENT = ("fold_margin",)  # of a cubic in the coefficients, which only those have
_EMPTY = {"kind": 0, "loop": 0}


class Numerical:
    """Numerical methods for one potential; see `phasekit.labelled.methods.Methods`."""

    by_tiles = False  # the number of equilibria is that of the cell which has most

    def __init__(self, system: Potential) -> None:
        self.system = system

    def passes(self, rows: Iterable[Quantity]) -> tuple[Pass, ...]:
        """Return the passes that compute rows of the table.

        Raises
        ------
        ParameterError
            If a row is not offered for a potential.
        """
        groups = list(dict.fromkeys(row.group for row in rows))
        for group in groups:
            if group not in _STATES:
                raise bad(
                    "system",
                    self.system,
                    f"a system with coefficients (A, B, C), because {group} is in closed form",
                )
        chosen = []
        if {"equilibria", "separatrices"} <= set(groups):
            chosen.append(self._pass("phase_space", (), ("equilibria", "separatrices")))
        done = {group for one in chosen for group in one.groups}
        for group in groups:
            if group not in done:
                name, states = _STATES[group]
                chosen.append(self._pass(name, states, (group,)))
        return tuple(chosen)

    def fitted(
        self, rows: Sequence[Quantity], passes: Sequence[Pass]
    ) -> tuple[Sequence[Quantity], Sequence[Pass]]:
        """Return rows and passes with as many numbers on their label dims as there are points.

        Raises
        ------
        ParameterError
            If what is asked for needs an interval, loaded parameters, or a closed form.
        """
        kept = [row for row in rows if row.name not in _ABSENT]
        if not kept:
            raise bad("of", rows[0].name, "quantities that a Potential has")
        if any(row.group not in (*_POINTWISE, "phase_velocity") for row in kept):
            self.need_a_stretch()
        formula, labels = self.system.formula, dict(LABELS)
        if any(dim in ("equilibrium", "saddle") for row in kept for dim in row.dims):
            equilibria, saddles = self._most()
            labels["equilibrium"] = (range(equilibria), "equilibrium, by its coordinate")
            labels["saddle"] = (range(saddles), "saddle, by its coordinate")
        elif formula.shape is Shape.GENERAL and any(row.group in _BESIDE for row in kept):
            self._most()  # orbits and motion rest on the equilibria as well
        groups = dict.fromkeys(row.group for row in kept)
        kept += [row for group in groups for row in _BESIDE.get(group, ())]
        fitted = [self._worded(row, labels) for row in kept]
        shapes = {row.name: row.label_shape for row in fitted}
        return fitted, [
            replace(one, function=functools.partial(_padded, one, shapes))
            if set(one.groups) & {"equilibria", "separatrices"}
            else replace(one, function=functools.partial(_told, one, formula.text))
            if set(one.groups) & {"orbits", "motion"}
            else one
            for one in passes
        ]

    def at_energy(self, center: str | int | None) -> Noted:
        """Return the pass for orbits by their energy round a center."""
        number = _number("center", center, "a center's number on the dim equilibrium")
        one = self._pass("orbits_at_energy", ("state_energy",), ("orbits",), number)
        return one, {"center": "the lowest" if number is None else str(number)}

    def at_gap(self, saddle: str | int | None, side: str) -> Noted:
        """Return the pass for orbits by their energy above a saddle."""
        return self._of_saddle("orbits_at_gap", "state_gap", "orbits", saddle, side)

    def on_separatrix(self, saddle: str | int | None, side: str) -> Noted:
        """Return the pass for motion on the separatrix of a saddle."""
        return self._of_saddle("separatrix_motion_with_errors", "time", "motion", saddle, side)

    def _of_saddle(self, name: str, state: str, group: str, saddle: Any, side: str) -> Noted:
        number = _number("saddle", saddle, "a number on the dim saddle")
        one = self._pass(name, (state,), (group,), number, one_of("side", side, SIDES))
        return one, {"saddle": "the lowest" if number is None else str(number), "side": side}

    def _pass(
        self, name: str, states: tuple[str, ...], groups: tuple[str, ...], *options: int | None
    ) -> Pass:
        formula = self.system.formula
        function = functools.partial(getattr(functions, name), formula, *options)
        return Pass(function, (*formula.names, *states), groups)

    def need_a_stretch(self) -> None:
        """Refuse to look for the equilibria of a function on the whole line.

        Raises
        ------
        ParameterError
        """
        formula = self.system.formula
        if formula.shape is Shape.GENERAL and not formula.bounded:
            raise ParameterError(
                f"interval: got None, wants (low, high), the stretch of the line on which the "
                f"equilibria of {formula.text} are looked for, because it is not a polynomial; or "
                "give its period, if it has one"
            )

    def _most(self) -> tuple[int, int]:
        """Greatest numbers of equilibria and saddles over all cells of the parameters."""
        formula = self.system.formula
        grid = make_grid(self.system.parameters)
        if grid.lazy:
            raise ParameterError(
                "parameters: got chunked arrays, wants loaded ones (.load()), because the number "
                "of equilibria is not known before they are found"
            )
        dims = tuple(grid.sizes)
        arrays = [grid.aligned(name, dims) for name in formula.names]
        shape = tuple(grid.sizes.values())
        found = [
            functions.most(formula, *(cut(array, tile) for array in arrays))
            for tile in tiles(shape, 4096)
            if prod(shape)
        ]
        gaps = np.concatenate([open_ for *_, open_ in found])
        if len(gaps):
            low, high = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
            of = f", in {len(gaps)} of {prod(shape)} systems" if shape else ""
            warnings.warn(
                f"equilibria of {formula.text}: it is not proved that there are no others between "
                f"{low:.6g} and {high:.6g}{of}; there `complete` is False",
                RuntimeWarning,
                stacklevel=2,
            )
        return max(n for n, *_ in found), max(n for _, n, _ in found)

    def _worded(self, row: Quantity, labels: dict[str, Labels]) -> Quantity:
        formula = self.system.formula
        on_angles = formula.period is not None and abs(formula.period - 2.0 * np.pi) < 1e-12
        words: dict[str, Any] = {"labels": labels, "source": f"V = {formula.text}"}
        if row.name == "potential":
            words["equation"] = f"V = {formula.text}"
        elif row.name in _EQUATIONS:
            words["equation"] = _EQUATIONS[row.name]
        if row.units == "rad" and not on_angles:
            words["units"] = "1"
            words["long_name"] = row.long_name.replace("signed angle", "signed distance").replace(
                "angle", "coordinate"
            )
        if row.name == "n_equilibria":
            words["dtype"] = "int16"
        return replace(row, **words)


def _told(one: Pass, text: str, *arrays: Any) -> Any:
    """Call a pass, and say how many results it could not compute, and why."""
    assert callable(one.function)
    result = one.function(*arrays)
    fields = result._asdict()
    for name in ("period", "motion_phi"):
        if name in fields:
            error = fields[f"{name}_error"]
            unknown = np.isnan(fields[name]) & ~np.isnan(error)
            if unknown.any():
                worst = np.max(error[unknown])
                why = f"their error may be as large as {worst:.2g}"
                if np.isinf(worst):
                    why = "they take too many steps" if name == "motion_phi" else "V is too rough"
                warnings.warn(
                    f"{name} of {text}: {unknown.sum()} of {unknown.size} values are NaN, because "
                    f"{why}",
                    RuntimeWarning,
                    stacklevel=2,
                )
    return result


def _padded(one: Pass, shapes: dict[str, tuple[int, ...]], *arrays: Any) -> Any:
    """Call a pass and fill its label axes up to the lengths that the whole map has."""
    assert callable(one.function)
    result = one.function(*arrays)
    filled = []
    for group in result if len(one.groups) > 1 else (result,):
        fields = {}
        for name, values in group._asdict().items():
            tail = shapes.get(name, ())
            first = values.ndim - len(tail)
            missing = [n - m for n, m in zip(tail, values.shape[first:], strict=True)]
            if any(missing):
                width = [(0, 0)] * first + [(0, n) for n in missing]
                values = np.pad(values, width, constant_values=_EMPTY.get(name, np.nan))
            fields[name] = values
        filled.append(type(group)(**fields))
    return tuple(filled) if len(filled) > 1 else filled[0]


def _number(argument: str, value: Any, wants: str) -> int | None:
    if value is None:
        return None
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < 0:
        raise bad(argument, value, f"{wants}, 0 or more, for a Potential")
    return int(value)
