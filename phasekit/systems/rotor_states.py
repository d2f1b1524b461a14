"""The disk on a free support in given states: accelerations, energy, angular momentum."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

from phasekit.docstrings import explained
from phasekit.mechanics import two_degrees as mechanics
from phasekit.systems.amended import WORDS, States, on_states, result_on_states
from phasekit.systems.rotor_motions import RotorMotions


class Accelerations(NamedTuple):
    """Angular accelerations of support and disk, s^-2."""

    domega1: Any
    ddphi: Any


@explained(WORDS, raises="ParameterError\n    If an argument is unusable, or shapes do not fit.")
class RotorStates(RotorMotions):
    """What `FreeGyroRotor` has in states that are given, where its parameters are numbers."""

    def accelerations(
        self,
        phi: States,
        dphi: States,
        omega1: States | None = None,
        *,
        torque1: States = 0.0,
        torque2: States = 0.0,
    ) -> Accelerations:
        """Accelerations of support and disk in states.

        Parameters
        ----------
        torque1, torque2 : float, array_like or xarray.DataArray
            Torques on the support and on the disk by its shaft, N m.

        Returns
        -------
        Accelerations
            domega1 and ddphi in s^-2; numbers, arrays or DataArrays as the states.

        Notes
        -----
        Lagrange's equations; for a prescribed omega1 the second one is [Veljovic2015] (11),
        corrected, with the term of omega1' that is missing there.

        Examples
        --------
        >>> import phasekit as pk
        >>> pendulum = pk.GyroRotorDisk(beta=90 * pk.deg, e=0.5, a=0, r=0, omega1=0, m=1, g=9.81)
        >>> round(pk.FreeGyroRotor(pendulum, 1.0).accelerations(30 * pk.deg, 0.0).ddphi, 12)
        -9.81
        """
        rows = {
            "domega1": ("s-2", "angular acceleration of the support"),
            "ddphi": ("s-2", "angular acceleration of the disk"),
        }
        states = {"phi": phi, "dphi": dphi, "omega1": self._omega1(omega1)}
        return Accelerations(
            *on_states(
                functools.partial(mechanics.accelerations, self._machine),
                rows,
                **states,
                torque1=torque1,
                torque2=torque2,
            )
        )

    def mass_matrix(self, phi: States) -> States:
        """Matrix [[M11, M12], [M12, M22]] of the kinetic energy, kg m^2.

        It multiplies (omega1', phi''). The last two axes, for a DataArray the dims ``row`` and
        ``column``, are those of the matrix.

        Returns
        -------
        ndarray or xarray.DataArray
            Shape (..., 2, 2).
        """
        row = "mass_matrix", "kg m2", "mass matrix of support and disk"
        function = functools.partial(mechanics.mass_matrix, self._machine)
        return result_on_states(function, row, dims=("row", "column"), phi=phi)

    def energy(self, phi: States, dphi: States, omega1: States | None = None) -> States:
        """Kinetic and potential energy, J; constant without torques.

        The potential energy of the weight is 0 at ``phi = pi/2``.
        """
        row = "mechanical_energy", "J", "kinetic and potential energy"
        function = functools.partial(mechanics.energy, self._machine)
        return result_on_states(function, row, phi=phi, dphi=dphi, omega1=self._omega1(omega1))

    def angular_momentum(self, phi: States, dphi: States, omega1: States | None = None) -> States:
        """Angular momentum ``M11 omega1 + M12 phi'`` about the vertical axis, kg m^2/s.

        Its rate is the torque on the support: it is constant without one.
        """
        row = "angular_momentum", "kg m2 s-1", "angular momentum about the vertical axis"
        function = functools.partial(mechanics.angular_momentum, self._machine)
        return result_on_states(function, row, phi=phi, dphi=dphi, omega1=self._omega1(omega1))
