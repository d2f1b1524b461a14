"""Exceptions that phasekit raises, and the integer codes that its results hold.

The codes are stored as int8 with CF ``flag_values`` and ``flag_meanings``; the enumerations
give them names: ``ds.kind == pk.EquilibriumKind.SADDLE``.
"""

from __future__ import annotations

from enum import IntEnum


class PhasekitError(Exception):
    """Base class of everything that phasekit raises on purpose."""


class ParameterError(PhasekitError, ValueError):
    """An argument is unusable; the message names it, what it got and what it wants."""


class ConvergenceError(PhasekitError, RuntimeError):
    """An iteration ended without reaching its tolerance."""


class StoreError(PhasekitError, OSError):
    """A stored map cannot be read, written or continued."""


class EquilibriumKind(IntEnum):
    """Type of an equilibrium, by the sign of V''."""

    NOT_COMPUTED = -1
    ABSENT = 0
    CENTER = 1
    SADDLE = 2
    DEGENERATE = 3


class Topology(IntEnum):
    """What the separatrices of one system look like.

    On a line they may close on one side of a saddle alone (homoclinic), or on neither (unbounded).
    """

    NOT_COMPUTED = -1
    NONE = 0
    WINDING = 1
    FIGURE_EIGHT = 2
    HETEROCLINIC = 3
    HOMOCLINIC = 4
    UNBOUNDED = 5


class Loop(IntEnum):
    """What the separatrix of one saddle does: close on itself, wind round, or reach a partner.

    On a line it may close on one side alone (lobe), or on neither (unbounded).
    """

    ABSENT = 0
    LOBES = 1
    WINDING = 2
    HETEROCLINIC = 3
    LOBE = 4
    UNBOUNDED = 5


class OrbitKind(IntEnum):
    """Type of an orbit; an unbounded one leaves the line, or the interval that is looked at."""

    NOT_COMPUTED = -1
    EQUILIBRIUM = 0
    LIBRATION = 1
    ROTATION = 2
    ASYMPTOTIC = 3
    UNBOUNDED = 4


class OrbitFamily(IntEnum):
    """Family of orbits: each has orbits of every action between its limits, one of each."""

    NOT_COMPUTED = -1
    NONE = 0
    LOWER_WELL = 1
    UPPER_WELL = 2
    OUTER = 3
    FORWARD = 4
    BACKWARD = 5
