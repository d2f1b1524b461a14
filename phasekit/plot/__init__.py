"""Pictures of systems and of Datasets: every function takes ``ax=`` and returns the Axes."""

from types import ModuleType as _ModuleType
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from phasekit.labels.arguments import unknown as _unknown
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
from phasekit.plot.hysteresis_loop import hysteresis_loop
from phasekit.plot.multipliers import multipliers
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
    "hysteresis_loop",
    "multipliers",
    "parameter_map",
    "period_energy",
    "phase_portrait",
    "poincare_section",
    "potential_well",
    "run_up",
    "time_history",
]

# What pictures are made of is imported by its own name, and is no picture.
for _name in [name for name, value in globals().items() if isinstance(value, _ModuleType)]:
    del globals()[_name]

if not _TYPE_CHECKING:

    def __getattr__(name: str) -> _Any:
        # The import system asks for names such as __path__.
        raise AttributeError(str(_unknown("picture", name, __all__)))


def __dir__() -> list[str]:
    return sorted(__all__)
