"""The same equation in other fields: the Josephson junction, the spin of a planet on its orbit."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from phasekit.labels.arguments import NumberLike, bad, number
from phasekit.laws.trigonometric import Values
from phasekit.systems.parameter import parameter
from phasekit.systems.system import System


class JosephsonJunction(System):
    """Josephson junction with two harmonics of its current-phase relation, threaded by a flux.

    ``I(phi) = I_1 [sin(phi - flux) + second_harmonic sin(2 phi)]``, phi the gauge-invariant phase
    difference: in the resistively and capacitively shunted model a particle in the tilted washboard
    ``V = omega_p^2 [-cos(phi - flux) - (second_harmonic/2) cos(2 phi)]``.

    Parameters
    ----------
    plasma_frequency : float, 1-D array_like or xarray.DataArray
        ``omega_p = sqrt(2 e I_1/(hbar C))`` of the first harmonic, in s^-1, > 0.

    Notes
    -----
    ``A = -2 omega_p^2 second_harmonic``, ``B = omega_p^2 cos flux``, ``C = omega_p^2 sin flux``.
    The greatest currents without voltage, in units of I_1, are `critical_torque` over
    ``omega_p^2``; where they differ in size the junction is a diode. `shunt` says what bias, shunt
    and temperature are as damping, torque and noise.

    Examples
    --------
    >>> import phasekit as pk
    >>> diode = pk.JosephsonJunction(plasma_frequency=1.0, second_harmonic=0.5, flux=-45 * pk.deg)
    >>> minus, plus = pk.critical_torque(diode).critical_torque.values
    >>> round(float(abs(plus + minus) / (plus - minus)), 12)  # no greater with two
    0.333333333333
    """

    plasma_frequency: NumberLike = parameter("s-1", "plasma frequency", positive=True)
    second_harmonic: NumberLike = parameter(
        "1", "second harmonic over the first, I_2/I_1", default=0.0
    )
    flux: NumberLike = parameter("rad", "phase of the flux, 2 pi Phi/Phi_0", default=0.0)

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """The washboard, by plasma frequency, ratio and flux."""
        sine, cosine, unit = v["flux"]
        size = v["plasma_frequency"] * v["plasma_frequency"]
        return -2 * (size * v["second_harmonic"]) * unit, size * cosine, size * sine, unit

    def shunt(
        self, *, stewart_mccumber: float, bias: float = 0.0, gamma: float = 0.0
    ) -> dict[str, float]:
        """Damping, torque and noise of a shunt, a bias current and a temperature.

        Parameters
        ----------
        stewart_mccumber : float
            Stewart-McCumber parameter ``beta_c = (omega_p R C)^2``, > 0.
        bias : float, default 0.0
            Bias current over I_1.
        gamma : float, default 0.0
            Thermal energy over the Josephson energy, ``2 e k_B T/(hbar I_1)``, >= 0.

        Returns
        -------
        dict
            Arguments of `Perturbed`: ``damping = omega_p/sqrt(beta_c)``,
            ``torque = omega_p^2 bias``, ``kT = omega_p^2 gamma``.

        Raises
        ------
        ParameterError
            If a value is unusable, or the plasma frequency is an array.

        Notes
        -----
        [Stewart1968], [McCumber1968].

        Examples
        --------
        >>> import phasekit as pk
        >>> junction = pk.JosephsonJunction(plasma_frequency=2.0)
        >>> pk.Perturbed(junction, **junction.shunt(stewart_mccumber=25.0, bias=0.5))
        Perturbed(JosephsonJunction(plasma_frequency=2.0, second_harmonic=0.0, flux=0.0),
        damping=0.4, torque=2.0)
        """
        omega = number("plasma_frequency", self.plasma_frequency, "one number here")
        quality = number("stewart_mccumber", stewart_mccumber, "a number > 0")
        if not quality > 0.0:
            raise bad("stewart_mccumber", stewart_mccumber, "a number > 0")
        scale = omega * omega
        return {
            "damping": omega / float(np.sqrt(quality)),
            "torque": scale * number("bias", bias),
            "kT": scale * number("gamma", gamma),
        }


class SpinOrbit(System):
    """Spin of a planet or moon next to a resonance with its orbit, averaged over the orbit.

    ``gamma'' + (3/2) n^2 asymmetry strength sin(2 gamma) = 0`` for ``gamma = theta - p M``, theta
    the angle of the long axis, M the mean anomaly, p the resonance.

    Parameters
    ----------
    strength : float or array_like, default 1.0
        ``H(p, e)``, of either sign; `resonance` computes it.

    Notes
    -----
    ``A = -3 n^2 asymmetry strength``, ``B = C = 0`` ([GoldreichPeale1966]). A cell is pi wide.

    Examples
    --------
    The odds that Mercury was captured in the resonance 3:2, by tides of constant time lag:

    >>> import phasekit as pk
    >>> mercury = pk.SpinOrbit.resonance(1.5, eccentricity=0.206, asymmetry=1e-4)
    >>> tides = mercury.tides(1.5, eccentricity=0.206, rate=1e-8)
    >>> odds = pk.capture(pk.Perturbed(mercury, **tides), start="rotation").capture_probability
    >>> round(1.0 - odds.sel(region="none").item(), 4)
    0.0708
    """

    mean_motion: NumberLike = parameter("s-1", "mean motion on the orbit")
    asymmetry: NumberLike = parameter("1", "(B - A)/C of the body", low=0.0)
    strength: NumberLike = parameter("1", "strength H(p, e) of the resonance", default=1.0)

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """The averaged torque on the figure."""
        size = v["mean_motion"] * v["mean_motion"] * v["asymmetry"]
        return -3 * (size * v["strength"]), 0 * size, 0 * size, 1

    @classmethod
    def resonance(
        cls, p: float, *, eccentricity: float, asymmetry: NumberLike, mean_motion: NumberLike = 1.0
    ) -> Self:
        """Return the spin next to the resonance p, a multiple of 1/2, on an orbit.

        Parameters
        ----------
        p : float
            Rotations in one revolution: 1, 1.5, 2, ...
        eccentricity : float
            Eccentricity of the orbit, 0 to 0.9.
        asymmetry, mean_motion : float or array_like
            As of the class.

        Returns
        -------
        SpinOrbit
            With the strength ``H(p, e)``.

        Raises
        ------
        ParameterError
            If a value is unusable.

        Notes
        -----
        ``H(p, e) = (1/2 pi) int (a/r)^3 cos(2 f - 2 p M) dM``, by the trapezoidal rule in the
        eccentric anomaly, which converges exponentially.
        """
        strength = _strength(*_orbit(p, eccentricity))
        return cls(mean_motion=mean_motion, asymmetry=asymmetry, strength=strength)

    def tides(self, p: float, *, eccentricity: float, rate: float) -> dict[str, float]:
        """Damping and torque of tides of a constant time lag.

        Parameters
        ----------
        p : float
            The resonance.
        eccentricity : float
            Eccentricity of the orbit, 0 to 0.9.
        rate : float
            K of ``theta'' = -K (Omega(e) theta' - N(e) n)`` in s^-1, > 0.

        Returns
        -------
        dict
            Arguments of `Perturbed`: ``damping = K Omega(e)`` and
            ``torque = -K n (p Omega(e) - N(e))``.

        Raises
        ------
        ParameterError
            If a value is unusable, or the mean motion is an array.

        Notes
        -----
        ``Omega = (1 + 3 e^2 + 3 e^4/8)/(1 - e^2)^(9/2)``,
        ``N = (1 + 15 e^2/2 + 45 e^4/8 + 5 e^6/16)/(1 - e^2)^6`` ([CorreiaLaskar2004]).
        """
        p, e = _orbit(p, eccentricity)
        K = number("rate", rate, "a number > 0", "s-1")
        if not K > 0.0:
            raise bad("rate", rate, "a number > 0 in s-1")
        n = number("mean_motion", self.mean_motion, "one number here")
        square = e * e
        drag = (1.0 + 3.0 * square + 0.375 * square**2) / (1.0 - square) ** 4.5
        push = 1.0 + 7.5 * square + 5.625 * square**2 + 0.3125 * square**3
        push /= (1.0 - square) ** 6
        return {"damping": K * drag, "torque": -K * n * (p * drag - push)}


def _orbit(p: Any, eccentricity: Any) -> tuple[float, float]:
    kept = number("p", p, "a multiple of 1/2")
    if (2.0 * kept) % 1.0 != 0.0:
        raise bad("p", p, "a multiple of 1/2")
    e = number("eccentricity", eccentricity, "a number from 0 to 0.9")
    if not 0.0 <= e <= 0.9:
        raise bad("eccentricity", eccentricity, "a number from 0 to 0.9")
    return kept, e


def _strength(p: float, e: float) -> float:
    E = 2.0 * np.pi * np.arange(4096) / 4096
    near = 1.0 - e * np.cos(E)
    true = 2.0 * np.arctan2(np.sqrt(1.0 + e) * np.sin(E / 2), np.sqrt(1.0 - e) * np.cos(E / 2))
    return float(np.mean(np.cos(2.0 * true - 2.0 * p * (E - e * np.sin(E))) / near**2))
