"""Equilibria and separatrices, labelled: a system goes in, a Dataset comes out.

Array parameters of the system span the result's dims.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from phasekit.cells.evaluate import evaluate
from phasekit.cells.request import equations_for
from phasekit.labels.arguments import bad, call_checked
from phasekit.systems.parameter import warn_of_invalid
from phasekit.systems.system import as_system
from phasekit.table.quantities import returns, select


@call_checked
@returns("equilibria")
def equilibria(system: Any, box: Any = None, *, n: Any = None) -> xr.Dataset:
    """All equilibria, their kinds, energies and frequencies, as branches.

    Parameters
    ----------
    system : system or Problem
        Any system; or equations ``x' = f(x)``.
    box : mapping of str to (float, float), optional
        Of a `Problem`: where to look, by state; by default its window. States that are angles may
        be left out: one turn.
    n : int, optional
        Of a map: fixed points of the n-th iterate, the orbits of all periods that divide n.

    Returns
    -------
    xarray.Dataset
        The dim ``equilibrium`` has the labels lower_center, lower_saddle, upper_center and
        upper_saddle. What is absent is NaN, and its kind is absent; only centers have a frequency,
        only saddles an exponent.

    Notes
    -----
    The labels are the brackets of the location theorem, so each is a branch that does not jump
    when parameters change. The pair that merges on a fold stands once, as lower_saddle, with the
    kind degenerate. Angles are wrapped to (-pi, pi].

    Those of a `Potential` are numbered from left to right instead, 0 to one less than the most
    that a cell has; there is no ``fold_margin``, which belongs to the coefficients (A, B, C), but
    ``complete``: whether it is proved that there are no others, and ``phi_error``: how far a place
    may be from the true one.

    Of a `Perturbed` system they are those under its constant torque N, where ``V' = N``, with
    frequencies and exponents as without damping; the drive does not count.

    Those of a `Problem` in a box, and the fixed points of a map, are ``x`` on (``equilibrium``,
    ``state``), with ``kind`` (`FlowEquilibriumKind`), ``eigenvalue``, ``n_unstable`` and
    ``complete``; array parameters span cells in front. Interval arithmetic on the formulas
    proves that there are no others [MooreKearfottCloud2009]. Where it does not, ``complete`` is
    False and a warning says what is open; so it is where f is code, of which nothing can be proved.

    Examples
    --------
    >>> import phasekit as pk
    >>> lorenz = pk.Problem(
    ...     ["10*(y - x)", "x*(rho - z) - y", "x*y - 8*z/3"], ["x", "y", "z"], {"rho": 28.0}
    ... )
    >>> three = pk.equilibria(lorenz, box={"x": (-50, 50), "y": (-50, 50), "z": (-50, 50)})
    >>> three.x.sel(state="z").values.round(9).tolist(), three.complete.item()
    ([27.0, 0.0, 27.0], True)
    >>> eq = pk.equilibria(pk.Coefficients(4.0, 1.0, 0.5))
    >>> eq.n_equilibria.item()
    4
    >>> pk.EquilibriumKind(eq.kind.sel(equilibrium="lower_saddle").item()).name
    'SADDLE'
    """
    found = as_system(system)
    if equations_for(found, "equilibria") is not None:
        # Only then: continuation takes long to load.
        from phasekit.labelled.in_box import equilibria_in_box

        if found.standing.traits is not None:
            box = box_of(found, box)
        return equilibria_in_box(found, box, n)
    if n is not None:
        raise bad("n", n, "None: only maps are iterated")
    if box is not None:
        raise bad("box", box, "None: all equilibria of a system are found, wherever they are")
    return _of_system("equilibria", system)


@call_checked
@returns("separatrices")
def separatrices(system: Any) -> xr.Dataset:
    """Separatrices: their topology, turning points and areas; whether there is a figure-eight.

    Returns
    -------
    xarray.Dataset
        The dim ``saddle`` has the labels lower and upper; a single saddle is the upper one. The dim
        ``side`` is that of the saddle, left or right.

    Notes
    -----
    From the energy integral [Veljovic2015] (14) at the saddles' energies, in closed form. The
    saddles of a `Potential` are numbered from left to right; a separatrix that goes to infinity,
    or out of the interval, has an infinite turning point and area; its areas have estimates of
    their errors, ``lobe_area_error`` and ``winding_area_error``.

    Under a constant torque, ``pk.Perturbed(system, torque=...)``, the energy is
    ``phi'^2/2 + V - torque phi``: nothing winds, and the separatrix of each saddle turns back on
    the side where this rises (`Loop` lobe), on the other it may run away (infinite turning point
    and area). Areas are quadratures with ``lobe_area_error``; ``energy_per_turn`` is what the
    saddles of the next turn lie lower.

    Examples
    --------
    >>> import phasekit as pk
    >>> sep = pk.separatrices(pk.Coefficients(4.0, 1.0, 0.5))
    >>> bool(sep.figure_eight), pk.Topology(sep.topology.item()).name
    (True, 'FIGURE_EIGHT')
    """
    return _of_system("separatrices", system)


def box_of(system: Any, box: Any) -> Any:
    """A box with what a system with terms says of it: no rate at rest, the part of a line."""
    if box is not None and not isinstance(box, Mapping):
        return box
    x = system.coordinate
    known = {f"d{x}": (-1.0, 1.0)}  # zero, wherever the system rests
    if (interval := getattr(system.system, "interval", None)) is not None:
        known[x] = interval
    return {**known, **(box or {})}


def _of_system(group: str, system: Any) -> xr.Dataset:
    system, rows = as_system(system), select(group)
    warn_of_invalid(system.declared, system.parameters)
    return evaluate(system, rows)
