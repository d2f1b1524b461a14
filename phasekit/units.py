"""Units to multiply by, ``30 * pk.units.deg``: SI units and radians are what everything takes.

Results are read in other units by ``ds.phasekit.to(beta="deg")``.

Examples
--------
>>> import phasekit as pk
>>> 24 * pk.units.mm, round(300 * pk.units.rpm, 12)
(0.024, 31.415926535898)
"""

#: One degree in radians.
deg: float = 0.017453292519943295
#: One revolution a minute in s^-1.
rpm: float = 0.10471975511965977
#: One turn a second in s^-1.
turns_per_second: float = 6.283185307179586
#: One centimetre, one millimetre and one micrometre in m.
cm: float = 1e-2
mm: float = 1e-3
um: float = 1e-6
#: One gram and one tonne in kg.
gram: float = 1e-3
tonne: float = 1e3
#: One millisecond and one minute in s.
ms: float = 1e-3
minute: float = 60.0
#: One kilonewton and one millinewton in N.
kN: float = 1e3  # noqa: N816
mN: float = 1e-3  # noqa: N816

__all__ = [
    "cm",
    "deg",
    "gram",
    "kN",
    "mN",
    "minute",
    "mm",
    "ms",
    "rpm",
    "tonne",
    "turns_per_second",
    "um",
]


def __getattr__(name: str) -> float:
    raise AttributeError(f"phasekit.units has no {name!r}; there are {', '.join(__all__)}")


def __dir__() -> list[str]:
    return __all__
