"""The energy integral, labelled: potential, its derivatives, energy and angular velocity.

A system and states go in, a Dataset with labels, units and sources comes out. Array parameters of
the system span the result's dims. States (phi, dphi, energy) are scalars, arrays of equal shape,
which pair on the dim `point`, or DataArrays, which broadcast by the names of their dims; they come
back as the coordinates state_phi, state_dphi and state_energy.
"""

from __future__ import annotations

from typing import Any

import xarray as xr

from phasekit.cells.states import at_states
from phasekit.labels.arguments import NumberLike, state_arguments
from phasekit.table.quantities import returns, select


@state_arguments
@returns("potential")
def potential(system: Any, phi: NumberLike) -> xr.Dataset:
    """Potential V of the equation of motion, per unit of inertia.

    Parameters
    ----------
    system : system
        A `GyroRotorDisk`, `Reduced`, `Coefficients` or any other system.

    Notes
    -----
    ``V = -B cos phi + (A/2) cos^2 phi - C sin phi``: [Veljovic2015] (15) plus the constant
    Omega^2/2.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.potential(pk.Coefficients(4.0, 1.0, 0.5), 0.0).potential.item()
    1.0
    """
    return _at_states("potential", system, phi=phi)


@state_arguments
@returns("potential_gradient")
def gradient(system: Any, phi: NumberLike) -> xr.Dataset:
    """Gradient V' of the potential: ``phi'' = -V'``.

    Notes
    -----
    ``V' = B sin phi - A sin phi cos phi - C cos phi``, [Veljovic2015] (12).

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.gradient(pk.Coefficients(4.0, 1.0, 0.5), 0.0).potential_gradient.item()
    -0.5
    """
    return _at_states("potential_gradient", system, phi=phi)


@state_arguments
@returns("potential_curvature")
def curvature(system: Any, phi: NumberLike) -> xr.Dataset:
    """Curvature V'' of the potential.

    Notes
    -----
    ``V'' = B cos phi - A cos 2 phi + C sin phi``, the derivative of [Veljovic2015] (12).

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.curvature(pk.Coefficients(4.0, 1.0, 0.5), 0.0).potential_curvature.item()
    -3.0
    """
    return _at_states("potential_curvature", system, phi=phi)


@state_arguments
@returns("energy_integral")
def energy(system: Any, phi: NumberLike, dphi: NumberLike) -> xr.Dataset:
    """Energy integral of a state: constant along every motion.

    Parameters
    ----------
    phi, dphi : float, 1-D array_like or xarray.DataArray
        Angles in rad and angular velocities in s^-1.

    Notes
    -----
    ``h = phi'^2/2 + V(phi)``, [Veljovic2015] (14). For a prescribed omega1 it is the Jacobi
    integral, not the sum of kinetic and potential energy.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.energy(pk.Coefficients(4.0, 1.0, 0.5), 0.0, [0.0, 2.0]).energy_integral.values
    array([1., 3.])
    """
    return _at_states("energy_integral", system, phi=phi, dphi=dphi)


@state_arguments
@returns("phase_velocity")
def phase_velocity(system: Any, phi: NumberLike, energy: NumberLike) -> xr.Dataset:
    """Angular velocity at an angle, on the level of an energy.

    Parameters
    ----------
    energy : float, 1-D array_like or xarray.DataArray
        Energies in s^-2, as `energy` gives them.

    Notes
    -----
    ``phi' = +sqrt(2 (h - V(phi)))``, [Veljovic2015] (14); the other branch has the other sign.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.phase_velocity(pk.Coefficients(4.0, 1.0, 0.5), 0.0, [0.0, 3.0]).phase_velocity.values
    array([nan,  2.])
    """
    return _at_states("phase_velocity", system, phi=phi, energy=energy)


def _at_states(name: str, system: Any, **states: Any) -> xr.Dataset:
    given = {argument: (f"state_{argument}", value) for argument, value in states.items()}
    return at_states(system, select(name), given)
