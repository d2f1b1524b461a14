"""Pictures of systems and of Datasets: every function takes ``ax=`` and returns the Axes.

Each picture is loaded when it is first used.
"""

import importlib as _importlib
import sys as _sys
from types import ModuleType as _ModuleType
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

if _TYPE_CHECKING:
    from phasekit.plot.atlas import atlas as atlas
    from phasekit.plot.basins import basins as basins
    from phasekit.plot.bearing_forces import bearing_forces as bearing_forces
    from phasekit.plot.bearing_load_map import bearing_load_map as bearing_load_map
    from phasekit.plot.bifurcation_diagram import bifurcation_diagram as bifurcation_diagram
    from phasekit.plot.bifurcation_set import bifurcation_set as bifurcation_set
    from phasekit.plot.branch import branch as branch
    from phasekit.plot.branch_surface import branch_surface as branch_surface
    from phasekit.plot.damped_portrait import damped_portrait as damped_portrait
    from phasekit.plot.force_polygon import force_polygon as force_polygon
    from phasekit.plot.hodograph import hodograph as hodograph
    from phasekit.plot.hysteresis_loop import hysteresis_loop as hysteresis_loop
    from phasekit.plot.lyapunov_map import lyapunov_map as lyapunov_map
    from phasekit.plot.multipliers import multipliers as multipliers
    from phasekit.plot.nullclines import nullclines as nullclines
    from phasekit.plot.orbit_diagram import orbit_diagram as orbit_diagram
    from phasekit.plot.parameter_map import parameter_map as parameter_map
    from phasekit.plot.periods import frequency_action as frequency_action
    from phasekit.plot.periods import period_energy as period_energy
    from phasekit.plot.phase_portrait import phase_portrait as phase_portrait
    from phasekit.plot.phase_response import phase_response as phase_response
    from phasekit.plot.poincare_section import poincare_section as poincare_section
    from phasekit.plot.potential_well import potential_well as potential_well
    from phasekit.plot.run_up import run_up as run_up
    from phasekit.plot.spectrum import spectrum as spectrum
    from phasekit.plot.spectrum import waterfall as waterfall
    from phasekit.plot.time_history import time_history as time_history

#: Pictures that are not in a file of their own name.
_ELSEWHERE = {"frequency_action": "periods", "period_energy": "periods", "waterfall": "spectrum"}

__all__ = [
    "atlas", "basins", "bearing_forces", "bearing_load_map", "bifurcation_diagram",
    "bifurcation_set", "branch", "branch_surface", "damped_portrait", "force_polygon",
    "frequency_action", "hodograph", "hysteresis_loop", "lyapunov_map", "multipliers", "nullclines",
    "orbit_diagram", "parameter_map", "period_energy", "phase_portrait", "phase_response",
    "poincare_section", "potential_well", "run_up", "spectrum", "time_history", "waterfall",
]  # fmt: skip


class _Pictures(_ModuleType):
    """The import system leaves files here under their names, which are those of pictures."""

    def __setattr__(self, name: str, value: object) -> None:
        if isinstance(value, _ModuleType):
            if name not in __all__:
                return  # what pictures are made of is imported by its own name
            value = getattr(value, name)
        super().__setattr__(name, value)


_sys.modules[__name__].__class__ = _Pictures

if not _TYPE_CHECKING:

    def __getattr__(name: str) -> _Any:
        if name in __all__:
            home = _importlib.import_module(f"{__name__}.{_ELSEWHERE.get(name, name)}")
            value = globals()[name] = getattr(home, name)  # later uses find it
            return value
        if name.startswith("__"):  # the import system asks for names such as __path__
            raise AttributeError(name)
        from phasekit.labels.arguments import unknown
        from phasekit.spellings import name_meant

        text, meant = str(unknown("picture", name, __all__)), name_meant(name, __all__)
        hint = f"; {meant}" if "did you mean" not in text and meant.startswith("use") else ""
        raise AttributeError(text + hint)


def __dir__() -> list[str]:
    return sorted(__all__)
