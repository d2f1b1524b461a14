"""Pictures of systems and of Datasets: every function takes ``ax=`` and returns the Axes."""

from phasekit.plot.bearing_loads import bearing_forces
from phasekit.plot.continued import branch
from phasekit.plot.diagram import bifurcation_diagram
from phasekit.plot.history import time_history
from phasekit.plot.hodographs import hodograph
from phasekit.plot.load_map import bearing_load_map
from phasekit.plot.loci import bifurcation_set
from phasekit.plot.maps import parameter_map
from phasekit.plot.periods import frequency_action, period_energy
from phasekit.plot.polygon import force_polygon
from phasekit.plot.portrait import phase_portrait
from phasekit.plot.surface import branch_surface
from phasekit.plot.well import potential_well

__all__ = [
    "bearing_forces",
    "bearing_load_map",
    "bifurcation_diagram",
    "bifurcation_set",
    "branch",
    "branch_surface",
    "force_polygon",
    "frequency_action",
    "hodograph",
    "parameter_map",
    "period_energy",
    "phase_portrait",
    "potential_well",
    "time_history",
]
