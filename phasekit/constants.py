"""Units to multiply by, ``30 * pk.deg``, ``24 * pk.rpm``, and the standard gravity."""

#: One degree in radians.
deg: float = 0.017453292519943295
#: One revolution a minute in s^-1.
rpm: float = 0.10471975511965977

#: Acceleration of gravity, m s^-2.
STANDARD_GRAVITY = 9.80665
