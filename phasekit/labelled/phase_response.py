"""`phase_response`: by how much a kick moves the phase of a stable periodic orbit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.cycles import collocation, starts
from phasekit.cycles.adjoint import adjoint
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch_points import attrs_of, clock_units
from phasekit.labelled.continuation.orbit_guess import given_orbit, scale_of, units_of
from phasekit.labelled.continuation.unfolding import NO_PARAMETER, unfolded
from phasekit.labelled.motion import flow
from phasekit.labels.arguments import bad, flag
from phasekit.systems.cycle_families import cycles_of, first_point
from phasekit.systems.field_arrays import states_over_time
from phasekit.systems.problem import Problem, as_problem

KICK = 3e-4  # of direct responses, beside the range of a state
PHASES = 32  # of direct responses
LEFT = 1e-10  # part of a kick across the orbit that is left when phases are compared
LONGEST = 400  # periods until then
SAME = 1e-12  # part of the period by which times differ by rounding
NEUTRAL = 1e-6  # distance of a multiplier from the unit circle within which nothing decays


@call_checked
def phase_response(orbit: xr.Dataset, direct: bool = False, *, system: Any = None) -> xr.Dataset:
    """Response of the phase of a stable periodic orbit to small kicks of its states.

    Parameters
    ----------
    orbit : xarray.Dataset
        What `periodic_orbit` or ``branch.orbit(i)`` returns.
    direct : bool, default False
        Kick the orbit and follow the motions until they are back on it, at 32 phases, instead of
        solving the adjoint equations.
    system : Problem or system, optional
        What the orbit is one of. Orbits of formulas know it; those of functions do not.

    Returns
    -------
    xarray.Dataset
        ``phase_response`` on ``time`` and ``state``: the time by which a motion that is kicked
        there runs ahead afterwards, over the size of the kick. The phase is the time along the
        orbit, dphase/dt = 1; in radians it is ``2 pi/period`` times that. Besides ``period`` and
        ``phase_response_error``: by how much the response to f itself differs from 1.

    Raises
    ------
    ParameterError
        If it is no orbit or the system is not known; if the system is forced, whose cycles have
        the phase of the forcing; or if the orbit is not stable: motions beside it have no phase.
    ConvergenceError
        If kicks take more than 400 periods to decay, with ``direct``.

    Notes
    -----
    The response z solves ``dz/dt = -A(t)^T z`` with ``f z = 1``, A the derivatives of f along the
    orbit ([ErmentroutTerman2010] chapter 8), by collocation on the mesh of the orbit.

    Examples
    --------
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 1.0})
    >>> orbit = pk.periodic_orbit(oscillator, [2.0, 0.0])
    >>> response = pk.phase_response(orbit)
    >>> response.phase_response.dims, bool(response.phase_response_error < 1e-6)
    (('time', 'state'), True)
    """
    problem = _problem_of(orbit, system)
    flag("direct", direct)
    if "multiplier" in orbit:
        _slowest(orbit["multiplier"].values)
    cycles, found = _solved(problem, orbit)
    slowest = _slowest(found.multipliers)
    at = collocation.times(found.orbit.mesh, cycles.m) * found.orbit.y[0]
    given = np.asarray(orbit["time"].values, dtype=float)
    if len(given) == len(at) and np.allclose(given, at, rtol=0.0, atol=SAME * at[-1]):
        at = given  # so that both can be merged
    if direct:
        places, z, error = _kicked(problem, cycles, found.orbit, slowest)
        at = at[places]
    else:
        z, error = adjoint(cycles, found.orbit)
    clock = clock_units(problem)
    values = {
        name: ((), value, attrs_of(problem, name)) for name, value in problem.parameters.items()
    }
    return xr.Dataset(
        {
            "phase_response": (
                ("time", "state"), z,
                {"long_name": "phase response", **clock, "source": "[ErmentroutTerman2010]",
                 "equation": "(8.9)"},
            ),
            "period": ((), float(found.orbit.y[0]), {"long_name": "period", **clock}),
            "phase_response_error": (
                (), error, {"long_name": "error of the phase response", "units": "1"},
            ),
        },
        {"time": ("time", at, {"long_name": "phase", **clock}),
         "state": list(problem.state), **values},
    )  # fmt: skip


def _slowest(multipliers: npt.NDArray[np.complex128]) -> float:
    """The largest size of the multipliers across an orbit, which is to be stable."""
    others = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
    slowest = float(np.max(np.abs(others), initial=0.0))
    if not slowest <= 1.0 - NEUTRAL:
        raise bad(
            "orbit", f"a periodic orbit with a multiplier of size {slowest:.6g}", "a stable one",
            "motions beside an orbit that is not stable do not return to it and have no phase",
        )  # fmt: skip
    return slowest


def _problem_of(orbit: Any, system: Any) -> Problem:
    """The problem of an orbit at its parameters."""
    if not isinstance(orbit, xr.Dataset) or "time" not in orbit.dims or "period" not in orbit:
        raise bad(
            "orbit", orbit, "what pk.periodic_orbit(system, state) or branch.orbit(i) returns"
        )
    if system is not None:
        problem = as_problem(system, moving=True)
    else:
        try:
            problem = as_problem(Problem.from_dataset(orbit))
        except ParameterError as error:
            raise bad(
                "orbit", "an orbit that does not know its equations", "one of formulas",
                f"give the system, pk.phase_response(orbit, system=problem); {error}",
            ) from None  # fmt: skip
    if problem.time is not None:
        raise bad(
            "orbit", "a cycle of a forced system", "one of an autonomous system",
            "a forced cycle has the phase of its forcing: a kick decays and shifts nothing",
        )  # fmt: skip
    states_over_time(problem, orbit)  # all of them are there
    values = {name: float(orbit[name]) for name in problem.parameters if name in orbit.coords}
    return problem.replace(**values) if values else problem


def _solved(problem: Problem, orbit: xr.Dataset) -> tuple[Cycles, Any]:
    """The family and the point of an orbit that is given, on its own mesh if it has one."""
    if not problem.parameters:
        problem = unfolded(problem, NO_PARAMETER)
    name, value = next(iter(problem.parameters.items()))
    options = ContinuationOptions()
    guess, turns, multiple = given_orbit(problem, orbit, value, options.degree)
    count = int(orbit["n_intervals"]) if "n_intervals" in orbit else 0
    places = orbit.sizes["time"] - 1
    if count and places % count == 0 and places // count == options.degree:
        at = np.asarray(orbit["time"].values, dtype=float)
        x = states_over_time(problem, orbit)
        mesh = (at[:: options.degree] - at[0]) / (at[-1] - at[0])
        guess = Orbit(mesh, x, np.array([at[-1] - at[0], value]))
    width = abs(value) or 1.0
    scale = scale_of(guess.x, units_of(problem, guess.x[0]))
    spans = [(value - width, value + width)]
    cycles = cycles_of(problem, [name], spans, scale, turns, options, multiple)
    return cycles, first_point(cycles, starts.settled(cycles, guess), "from the orbit given")


def _kicked(
    problem: Problem, cycles: Cycles, orbit: Orbit, slowest: float
) -> tuple[Any, Array, float]:
    """Responses at some places by motions that are kicked to both sides."""
    periods = max(2, math.ceil(math.log(LEFT) / math.log(slowest)) if slowest > 0.0 else 2)
    if periods > LONGEST:
        raise ConvergenceError(
            f"phase_response: kicks take {periods} periods to decay, the largest multiplier being "
            f"{slowest:.9g}; the adjoint equations (direct=False) take none"
        )
    step = max(1, (len(orbit.x) - 1) // PHASES)
    places = np.arange(0, len(orbit.x) - 1, step)
    n, T = cycles.n, float(orbit.y[0])
    sizes = KICK * np.maximum(np.ptp(orbit.x, axis=0), 1e-3 * cycles.scale)
    kicks = np.concatenate([k * np.diag(sizes) for k in (1.0, -1.0, 2.0, -2.0)])
    states = (orbit.x[places][:, None, :] + kicks).reshape(-1, n)
    ends = flow(
        problem, {name: states[:, i] for i, name in enumerate(problem.state)},
        t=[periods * T], rtol=1e-12, atol=float(np.clip(1e-14 * np.max(cycles.scale), 1e-14, 1e-6)),
    )  # fmt: skip
    x = states_over_time(problem, ends.isel(time=0), "motion_").reshape(len(places), 4, n, n)
    # On the orbit again, motions differ along f alone.
    f = cycles.jets.values(np.column_stack([orbit.x[places], np.full(len(places), orbit.y[1])]))
    f = f / cycles.scale
    near, far = ((x[:, k] - x[:, k + 1]) / (k + 2.0) for k in (0, 2))
    gap = (4.0 * near - far) / 3.0 / sizes[:, None] / cycles.scale
    z = np.einsum("pkn,pn->pk", gap, f) / np.sum(f * f, axis=1)[:, None]
    along = np.einsum("pk,pk->p", z, f * cycles.scale)
    return places, z, float(np.max(np.abs(along - 1.0)))
