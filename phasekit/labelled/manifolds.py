"""Stable and unstable manifolds of the saddles of a flow, labelled."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs
from phasekit.errors import FlowEquilibriumKind
from phasekit.labelled.in_box import corners, equilibria_in_box, kind_of
from phasekit.labels.arguments import bad, call_checked, number, whole
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.equations import equations_of
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import pointwise, slopes_at
from phasekit.motion.manifold import Strand, strand
from phasekit.numerics.waits import said
from phasekit.systems.problem import as_problem
from phasekit.systems.system import as_system


@call_checked
def manifolds(
    system: Any,
    equilibrium: int | None = None,
    *,
    window: Any = None,
    length: float = 20.0,
) -> xr.Dataset:
    """One-dimensional stable and unstable manifolds of the saddles of a flow.

    Parameters
    ----------
    system : Problem, or system that states rates
        One flow without forcing, of any number of states.
    equilibrium : int, optional
        Number of the equilibrium, as `equilibria` has it; by default all that have such manifolds.
    window : mapping of str to (float, float), optional
        Where to look for equilibria, and where manifolds end; by default the system's.
    length : float, default 20
        Greatest length of each half, in widths of the window.

    Returns
    -------
    xarray.Dataset
        On ``manifold``: ``manifold_stable``, ``manifold_from`` (number of the equilibrium),
        ``manifold_end`` (window, equilibrium, length, lost) and ``manifold_to`` (number of the
        equilibrium that it comes to, or -1). On (``manifold``, ``point``): ``arclength`` in widths
        of the window, and ``manifold_`` with the name of each state; shorter ones end in NaN.
        Beside them the equilibria: ``x``, ``kind``, ``eigenvalue``.

    Raises
    ------
    ParameterError
        If the system is no such flow, or an argument is unusable.

    Notes
    -----
    Each half begins 1e-6 of the window from the equilibrium, in the direction of the one unstable
    (or stable) eigenvector, from which the manifold differs there by the square of that; it is
    followed by DOP853 with a relative tolerance of 1e-9 ([Kuznetsov2004] section 2.2).

    Examples
    --------
    >>> import phasekit as pk
    >>> duffing = pk.Problem(
    ...     {"x": "v", "v": "x - x^3 - d*v"}, parameters={"d": 0.2},
    ...     window={"x": (-2, 2), "v": (-2, 2)},
    ... )
    >>> found = pk.manifolds(duffing)
    >>> found.manifold_end.values[~found.manifold_stable.values].tolist()  # both fall into wells
    ['equilibrium', 'equilibrium']
    """
    found = as_system(system)
    law = equations_of(found)
    if law is None or isinstance(law, Map) or law.time is not None:
        raise bad("system", found, "a flow x' = f(x) without forcing, such as a pk.Problem")
    if not (length := number("length", length, "a length > 0, in widths of the window")) > 0.0:
        raise bad("length", length, "a length > 0, in widths of the window")
    problem = as_problem(found)
    low, high = corners(problem, window)
    rests = equilibria_in_box(
        problem, dict(zip(law.states, zip(low, high, strict=True), strict=True))
    )
    chosen = range(rests.sizes["equilibrium"])
    if equilibrium is not None:
        wants = f"a number of an equilibrium, below {len(chosen)}"
        if (which := whole("equilibrium", equilibrium, wants, 0)) >= len(chosen):
            raise bad("equilibrium", equilibrium, wants)
        chosen = range(which, which + 1)
    values = {name: float(problem.parameters[name]) for name in law.names}
    rates, places = pointwise(law, values), rests.x.values
    strands: list[tuple[bool, int, Strand]] = []
    with said("following manifolds"):
        for k in chosen:
            for stable, direction in _directions(law, values, places[k], problem, high - low):
                strands += [
                    (stable, k, strand(rates, places[k], side * direction, -1.0 if stable else 1.0,
                                       (low, high), places, length))
                    for side in (1.0, -1.0)
                ]  # fmt: skip
    if equilibrium is not None and not strands:
        wants = "an equilibrium with one unstable or one stable eigenvalue, which is real"
        raise bad("equilibrium", equilibrium, wants)
    lost = sum(one.end == "lost" for *_, one in strands)
    if lost:
        warnings.warn(
            f"manifolds: {lost} of {len(strands)} could not be followed to their ends",
            RuntimeWarning,
            stacklevel=2,
        )
    return _dataset(problem, law.states, rests, strands)


def _directions(law: Any, values: Any, x: Any, problem: Any, width: Any) -> list[tuple[bool, Any]]:
    """The one stable and the one unstable direction of a saddle, in widths of the window."""
    slopes = slopes_at(law, values, x) * width / width[:, None]
    if len(x) < 2 or not np.isfinite(slopes).all():
        return []
    *_, kind = kind_of(slopes, discrete=False, conservative=problem.conservative, error=1e-9)
    if kind != FlowEquilibriumKind.SADDLE:
        return []
    found, vectors = np.linalg.eig(slopes)
    directions = []
    for stable, those in ((False, found.real > 0.0), (True, found.real < 0.0)):
        if those.sum() == 1:
            directions.append((stable, np.real(vectors[:, np.argmax(those)])))
    return directions


def _dataset(
    problem: Any, states: tuple[str, ...], rests: xr.Dataset,
    strands: list[tuple[bool, int, Strand]],
) -> xr.Dataset:  # fmt: skip
    most = max((len(one.x) for *_, one in strands), default=0)
    table = np.full((len(strands), most, len(states) + 1), np.nan)
    for row, (*_, one) in zip(table, strands, strict=True):
        row[: len(one.x), 0] = one.arclength
        row[: len(one.x), 1:] = one.x
    on, along = ("manifold",), ("manifold", "point")
    data = {
        "manifold_stable": variable(
            on, np.array([stable for stable, *_ in strands], bool),
            {"long_name": "whether motions on it come to the equilibrium"},
        ),
        "manifold_from": variable(
            on, np.array([k for _, k, _ in strands], np.int64),
            {"long_name": "number of the equilibrium to which it belongs"},
        ),
        "manifold_end": variable(
            on, np.array([one.end for *_, one in strands], LABEL_DTYPE),
            {"long_name": "why it ends"},
        ),
        "manifold_to": variable(
            on, np.array([one.reached for *_, one in strands], np.int64),
            {"long_name": "number of the equilibrium to which it comes, or -1"},
        ),
        "arclength": variable(
            along, table[..., 0], {"long_name": "length in widths of the window", "units": "1"}
        ),
        **{
            f"manifold_{name}": variable(
                along, table[..., 1 + i], {"long_name": f"{name} on the manifold"}
            )
            for i, name in enumerate(states)
        },
    }  # fmt: skip
    kept = rests[["x", "kind", "eigenvalue", "n_unstable", "n_equilibria", "complete"]]
    return kept.assign(data).assign_attrs(dataset_attrs(problem))
