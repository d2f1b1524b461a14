"""Pictures of systems and of Datasets: every function takes ``ax=`` and returns the Axes."""

from phasekit.plot.basins import basins
from phasekit.plot.bearing_forces import bearing_forces
from phasekit.plot.bearing_load_map import bearing_load_map
from phasekit.plot.bifurcation_diagram import bifurcation_diagram
from phasekit.plot.bifurcation_set import bifurcation_set
from phasekit.plot.branch import branch
from phasekit.plot.branch_surface import branch_surface
from phasekit.plot.damped_portrait import damped_portrait
from phasekit.plot.force_polygon import force_polygon
from phasekit.plot.hodograph import hodograph
from phasekit.plot.parameter_map import parameter_map
from phasekit.plot.periods import frequency_action, period_energy
from phasekit.plot.phase_portrait import phase_portrait
from phasekit.plot.poincare_section import poincare_section
from phasekit.plot.potential_well import potential_well
from phasekit.plot.run_up import run_up
from phasekit.plot.time_history import time_history

__all__ = [
    "basins",
    "bearing_forces",
    "bearing_load_map",
    "bifurcation_diagram",
    "bifurcation_set",
    "branch",
    "branch_surface",
    "damped_portrait",
    "force_polygon",
    "frequency_action",
    "hodograph",
    "parameter_map",
    "period_energy",
    "phase_portrait",
    "poincare_section",
    "potential_well",
    "run_up",
    "time_history",
]
