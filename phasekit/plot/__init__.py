"""Pictures of systems and of Datasets: every function takes ``ax=`` and returns the Axes."""

from phasekit.plot.diagram import bifurcation_diagram
from phasekit.plot.history import time_history
from phasekit.plot.maps import parameter_map
from phasekit.plot.periods import frequency_action, period_energy
from phasekit.plot.portrait import phase_portrait
from phasekit.plot.well import potential_well

__all__ = [
    "bifurcation_diagram",
    "frequency_action",
    "parameter_map",
    "period_energy",
    "phase_portrait",
    "potential_well",
    "time_history",
]
