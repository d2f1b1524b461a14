"""Units that the house multiplies by, and the standard gravity."""

from phasekit.units import deg as deg
from phasekit.units import rpm as rpm

#: Acceleration of gravity, m s^-2.
STANDARD_GRAVITY = 9.80665
