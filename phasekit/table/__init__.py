"""The table of what is computed, put together as soon as any part of it is used."""

from phasekit.table import quantities as quantities
