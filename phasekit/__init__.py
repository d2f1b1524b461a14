"""phasekit: bifurcation and phase-space analysis of coupled rotations.

Public names are loaded when they are first used, so ``import phasekit`` itself loads neither
numpy nor anything built on it.

Examples
--------
>>> import phasekit as pk
>>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=24 * pk.rpm)
>>> pk.equilibria(disk).n_equilibria.item()
4
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

from phasekit.units import deg as deg
from phasekit.units import rpm as rpm
from phasekit.version import __version__ as __version__

if TYPE_CHECKING:
    from phasekit import extend as extend
    from phasekit import plot as plot
    from phasekit import units as units
    from phasekit.bifurcation.continuation.options import ContinuationOptions as ContinuationOptions
    from phasekit.cells.offered import quantities as quantities
    from phasekit.errors import AttractorKind as AttractorKind
    from phasekit.errors import BranchStatus as BranchStatus
    from phasekit.errors import ConvergenceError as ConvergenceError
    from phasekit.errors import EquilibriumKind as EquilibriumKind
    from phasekit.errors import EscapeRegime as EscapeRegime
    from phasekit.errors import FlowEquilibriumKind as FlowEquilibriumKind
    from phasekit.errors import InvalidCellsWarning as InvalidCellsWarning
    from phasekit.errors import Loop as Loop
    from phasekit.errors import MergerKind as MergerKind
    from phasekit.errors import OrbitFamily as OrbitFamily
    from phasekit.errors import OrbitKind as OrbitKind
    from phasekit.errors import ParameterError as ParameterError
    from phasekit.errors import PhasekitError as PhasekitError
    from phasekit.errors import PointStatus as PointStatus
    from phasekit.errors import SpecialPointKind as SpecialPointKind
    from phasekit.errors import StoreError as StoreError
    from phasekit.errors import Topology as Topology
    from phasekit.errors import Validity as Validity
    from phasekit.explorer.explore import explore as explore
    from phasekit.labelled.asymptotics import near_center as near_center
    from phasekit.labelled.asymptotics import near_separatrix as near_separatrix
    from phasekit.labelled.atlas import branches as branches
    from phasekit.labelled.basins import attractors as attractors
    from phasekit.labelled.basins import basins as basins
    from phasekit.labelled.bifurcation_set import bifurcation_set as bifurcation_set
    from phasekit.labelled.continuation.atlas import Atlas as Atlas
    from phasekit.labelled.continuation.atlas import atlas as atlas
    from phasekit.labelled.continuation.branch import Branch as Branch
    from phasekit.labelled.continuation.connection import connection as connection
    from phasekit.labelled.continuation.continuation import continuation as continuation
    from phasekit.labelled.continuation.critical_rate import critical_rate as critical_rate
    from phasekit.labelled.continuation.cycle_branch import ConnectionBranch as ConnectionBranch
    from phasekit.labelled.continuation.cycle_branch import CycleBranch as CycleBranch
    from phasekit.labelled.continuation.diagram import diagram as diagram
    from phasekit.labelled.continuation.fit import fit as fit
    from phasekit.labelled.continuation.periodic_orbit import periodic_orbit as periodic_orbit
    from phasekit.labelled.continuation.recording import fourier as fourier
    from phasekit.labelled.continuation.special_point import SpecialPoint as SpecialPoint
    from phasekit.labelled.critical import critical as critical
    from phasekit.labelled.driven import lyapunov as lyapunov
    from phasekit.labelled.driven import stroboscopic as stroboscopic
    from phasekit.labelled.edge_state import edge_state as edge_state
    from phasekit.labelled.energy import curvature as curvature
    from phasekit.labelled.energy import energy as energy
    from phasekit.labelled.energy import gradient as gradient
    from phasekit.labelled.energy import phase_velocity as phase_velocity
    from phasekit.labelled.energy import potential as potential
    from phasekit.labelled.families import orbit_families as orbit_families
    from phasekit.labelled.figure_eights import figure_eights as figure_eights
    from phasekit.labelled.loads import bearing_forces as bearing_forces
    from phasekit.labelled.loads import fixed_bearing_forces as fixed_bearing_forces
    from phasekit.labelled.loads import rotators as rotators
    from phasekit.labelled.manifolds import manifolds as manifolds
    from phasekit.labelled.motion import flow as flow
    from phasekit.labelled.motion import separatrix_motion as separatrix_motion
    from phasekit.labelled.noise import first_passage as first_passage
    from phasekit.labelled.nullclines import nullclines as nullclines
    from phasekit.labelled.orbit_diagram import orbit_diagram as orbit_diagram
    from phasekit.labelled.orbits import action_angle as action_angle
    from phasekit.labelled.orbits import orbits as orbits
    from phasekit.labelled.orbits import state_of as state_of
    from phasekit.labelled.periodic_orbits import periodic_orbits as periodic_orbits
    from phasekit.labelled.perturbed import capture as capture
    from phasekit.labelled.perturbed import critical_torque as critical_torque
    from phasekit.labelled.perturbed import escape_rate as escape_rate
    from phasekit.labelled.perturbed import melnikov as melnikov
    from phasekit.labelled.perturbed import quiet_frequencies as quiet_frequencies
    from phasekit.labelled.perturbed import resonances as resonances
    from phasekit.labelled.perturbed import retrapping_torque as retrapping_torque
    from phasekit.labelled.phase_response import phase_response as phase_response
    from phasekit.labelled.phase_space import equilibria as equilibria
    from phasekit.labelled.phase_space import separatrices as separatrices
    from phasekit.labelled.quasi_static import quasi_static as quasi_static
    from phasekit.labelled.run_up import run_up as run_up
    from phasekit.labelled.section import poincare_section as poincare_section
    from phasekit.labelled.spectrum import spectrum as spectrum
    from phasekit.labelled.warm import warm as warm
    from phasekit.maps.sweep import sweep as sweep
    from phasekit.maps.whole import open_map as open_map
    from phasekit.mechanics.general.body import RigidBody as RigidBody
    from phasekit.mechanics.general.rotation import CoupledRotation as CoupledRotation
    from phasekit.motion.events import Event as Event
    from phasekit.systems.analogues import ParticleOnCircle as ParticleOnCircle
    from phasekit.systems.analogues import Pendulum as Pendulum
    from phasekit.systems.analogues import StonerWohlfarth as StonerWohlfarth
    from phasekit.systems.boundary_problem import BoundaryProblem as BoundaryProblem
    from phasekit.systems.disk import GyroRotorDisk as GyroRotorDisk
    from phasekit.systems.field_analogues import JosephsonJunction as JosephsonJunction
    from phasekit.systems.field_analogues import SpinOrbit as SpinOrbit
    from phasekit.systems.free_rotor import FreeGyroRotor as FreeGyroRotor
    from phasekit.systems.grid import grid as grid
    from phasekit.systems.harmonic import Harmonic as Harmonic
    from phasekit.systems.parameter import parameter as parameter
    from phasekit.systems.perturbed import Perturbed as Perturbed
    from phasekit.systems.potential import Potential as Potential
    from phasekit.systems.problem import Problem as Problem
    from phasekit.systems.statement import angle as angle
    from phasekit.systems.statement import coordinate as coordinate
    from phasekit.systems.system import Coefficients as Coefficients
    from phasekit.systems.system import Reduced as Reduced
    from phasekit.systems.system import System as System
    from phasekit.systems.term import Term as Term

#: Where public names are: a module and its names, a line each; an indented line goes on.
_MODULES = """
bifurcation.continuation.options: ContinuationOptions
errors: AttractorKind BranchStatus ConvergenceError EquilibriumKind FlowEquilibriumKind
    InvalidCellsWarning EscapeRegime Loop MergerKind OrbitFamily OrbitKind ParameterError
    PhasekitError PointStatus SpecialPointKind StoreError Topology Validity
explorer.explore: explore
labelled.asymptotics: near_center near_separatrix
labelled.atlas: branches
labelled.continuation.atlas: Atlas atlas
labelled.continuation.branch: Branch
labelled.continuation.connection: connection
labelled.continuation.continuation: continuation
labelled.critical: critical
labelled.continuation.critical_rate: critical_rate
labelled.continuation.cycle_branch: ConnectionBranch CycleBranch
labelled.continuation.diagram: diagram
labelled.continuation.fit: fit
labelled.continuation.recording: fourier
labelled.continuation.periodic_orbit: periodic_orbit
labelled.figure_eights: figure_eights
labelled.families: orbit_families
systems.free_rotor: FreeGyroRotor
systems.field_analogues: JosephsonJunction SpinOrbit
systems.harmonic: Harmonic
systems.perturbed: Perturbed
systems.term: Term
systems.analogues: ParticleOnCircle Pendulum StonerWohlfarth
labelled.basins: attractors basins
labelled.edge_state: edge_state
labelled.driven: lyapunov stroboscopic
labelled.energy: curvature energy gradient phase_velocity potential
labelled.bifurcation_set: bifurcation_set
labelled.loads: bearing_forces fixed_bearing_forces rotators
systems.disk: GyroRotorDisk
labelled.manifolds: manifolds
labelled.motion: flow separatrix_motion
labelled.noise: first_passage
labelled.nullclines: nullclines
labelled.orbit_diagram: orbit_diagram
labelled.orbits: action_angle orbits state_of
labelled.periodic_orbits: periodic_orbits
labelled.perturbed: capture critical_torque escape_rate melnikov quiet_frequencies resonances
    retrapping_torque
labelled.phase_space: equilibria separatrices
labelled.quasi_static: quasi_static
systems.potential: Potential
systems.boundary_problem: BoundaryProblem
systems.grid: grid
systems.problem: Problem
cells.offered: quantities
labelled.continuation.special_point: SpecialPoint
labelled.run_up: run_up
labelled.section: poincare_section
labelled.phase_response: phase_response
labelled.spectrum: spectrum
labelled.warm: warm
maps.whole: open_map
maps.sweep: sweep
motion.events: Event
systems.parameter: parameter
systems.statement: angle coordinate
systems.system: Coefficients Reduced System
mechanics.general.rotation: CoupledRotation
mechanics.general.body: RigidBody
"""
_HOME = {
    name: f"phasekit.{module}"
    for module, _, names in (
        line.partition(": ") for line in _MODULES.strip().replace("\n    ", " ").split("\n")
    )
    for name in names.split()
}

__all__ = ["__version__", "deg", "extend", "plot", "rpm", "units", *_HOME]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name in ("extend", "plot", "units"):
        return importlib.import_module(f"phasekit.{name}")
    if name not in _HOME:
        raise AttributeError(_unknown(name), name=name)
    value = getattr(importlib.import_module(_HOME[name]), name)
    if "xarray" in sys.modules:
        importlib.import_module("phasekit.labelled.accessor")
    globals()[name] = value  # later uses find it without coming here
    return value


def _unknown(name: str) -> str:
    text = f"module 'phasekit' has no attribute {name!r}"
    if name.startswith("__"):  # asked for by machines
        return text
    from phasekit.spellings import name_meant

    return "; ".join(filter(None, (text, name_meant(name, __all__))))


#: What is listed: what most questions need. The rest is reached in the same way, and listed by
#: `phasekit.extend`.
_SHOWN = (
    # modules and units
    "deg", "extend", "plot", "rpm", "units",
    # systems
    "BoundaryProblem", "Coefficients", "Event", "FreeGyroRotor", "GyroRotorDisk", "Harmonic",
    "Pendulum", "Perturbed", "Potential", "Problem", "System", "Term", "angle", "coordinate",
    "grid", "parameter",
    # what they do
    "attractors", "basins", "bearing_forces", "bifurcation_set", "branches", "capture",
    "connection", "continuation", "critical", "diagram", "equilibria", "escape_rate", "explore",
    "first_passage", "flow", "lyapunov", "melnikov", "open_map", "orbit_diagram", "orbits",
    "periodic_orbit", "periodic_orbits", "phase_response", "poincare_section", "quantities",
    "quasi_static", "run_up", "separatrices", "spectrum", "sweep",
)  # fmt: skip


def __dir__() -> list[str]:
    return sorted(_SHOWN)


if "xarray" in sys.modules:  # then the accessor costs nothing, and maps opened by xarray have it
    importlib.import_module("phasekit.labelled.accessor")
