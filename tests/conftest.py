"""Settings of the whole suite."""

import gc
import getpass
import hashlib
import os
import signal
import sys
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings

# Each tree has its own machine code, which is checked against the sources it was made from.
TREE = hashlib.sha256(str(Path(__file__).parents[1]).encode()).hexdigest()[:16]
os.environ.setdefault(
    "PHASEKIT_CACHE_DIR", f"{tempfile.gettempdir()}/phasekit-{getpass.getuser()}/{TREE}"
)

# Each worker has a core: threads of linear algebra in all of them would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Jobs that a shell runs beside others ignore Ctrl-C, which tests send.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Hundreds of processes that tests start read the bytecode of phasekit that this one leaves.
sys.dont_write_bytecode = False

# Compiling a kernel takes seconds in the first example. Examples repeat exactly; nothing is left
# in the working directory.
settings.register_profile("phasekit", deadline=None, derandomize=True, database=None)
settings.load_profile("phasekit")

#: Files that workers begin with. Of the first four, each compiles the kernels of another subject,
#: for all workers, while the others compile theirs; kernels that share routines are compiled by one
#: process, which compiles those once. The rest take long for so few tests: begun last, they would
#: leave one worker alone at the end.
FIRST = (
    "phase/test_phase_space_kernel.py",
    "labelled/test_continuation.py",
    "phase/test_portrait_kernel.py",
    "labelled/test_cycles.py",
    "motion/test_strobe.py",
    "loads/test_functions.py",
    "maps/test_kills.py",
    "maps/test_store_failures.py",
    "perturbation/test_melnikov.py",
    "perturbation/test_escape.py",
    "labelled/test_any_potential.py",
    "maps/test_interrupts.py",
    "docs/test_pages.py",
    "test_studies.py",
    "published/test_any_law.py",
    "motion/test_creeping_attractors.py",
    "labelled/test_warm.py",
    "maps/test_seal.py",
    "labelled/test_manifolds.py",
    "labelled/test_plane_atlas.py",
    "labelled/test_connections.py",
    "labelled/test_periodic_orbits.py",
    "labelled/test_noise.py",
    "labelled/test_certified.py",
    "labelled/test_codimension_two.py",
    "systems/test_mechanical.py",
    "published/test_discretised.py",
    "test_recipes.py",
    "maps/test_s3.py",
    "phase/test_motions_near_saddles.py",
)
FAST = "not slow"

TESTS = Path(__file__).parent

#: Folders and files that are slow as a whole, besides what is marked where it stands.
SLOW = (
    "published",
    "properties",
    "bifurcation/test_centers.py",
    "bifurcation/test_codimension_two.py",
    "bifurcation/test_many_states.py",
    "bifurcation/test_multiple_hopf.py",
    "bifurcation/test_multipliers_together.py",
    "bifurcation/test_own_kinds.py",
    "bifurcation/test_zero_along.py",
    "bifurcation/test_zero_along_cycles.py",
    "cells/test_rungs.py",
    "docs/test_pages.py",
    "labelled/test_any_branches.py",
    "labelled/test_connections.py",
    "labelled/test_curves_of_maps.py",
    "labelled/test_cycle_branch_points.py",
    "labelled/test_cycle_canards.py",
    "labelled/test_cycle_codim2.py",
    "labelled/test_cycle_curves.py",
    "labelled/test_cycle_events.py",
    "labelled/test_cycle_forms.py",
    "labelled/test_cycle_stops.py",
    "labelled/test_cycle_units.py",
    "labelled/test_event_curves.py",
    "labelled/test_fields.py",
    "labelled/test_iterated_maps.py",
    "labelled/test_loads.py",
    "labelled/test_long_formulas.py",
    "labelled/test_long_periods.py",
    "labelled/test_periodic_orbits.py",
    "labelled/test_phase_response.py",
    "labelled/test_plane_atlas.py",
    "labelled/test_quasi_static.py",
    "labelled/test_response.py",
    "labelled/test_rotor_orbits.py",
    "labelled/test_slow_path.py",
    "labelled/test_travel.py",
    "loads/test_functions.py",
    "maps/test_hostile_files.py",
    "maps/test_interrupts.py",
    "maps/test_numbered_maps.py",
    "maps/test_replacing.py",
    "maps/test_store_damage.py",
    "maps/test_store_failures.py",
    "maps/test_sweep_equations.py",
    "motion/test_attractors.py",
    "motion/test_attractors_of_any_law.py",
    "motion/test_creeping_attractors.py",
    "motion/test_driven_attractors.py",
    "motion/test_extreme_motions.py",
    "motion/test_series.py",
    "motion/test_strobe.py",
    "numerics/test_same_bits.py",
    "numerics/test_tape.py",
    "perturbation/test_by_numbers.py",
    "perturbation/test_capture.py",
    "perturbation/test_escape.py",
    "perturbation/test_free_rotor.py",
    "perturbation/test_tilted_numerical.py",
    "perturbation/test_validity.py",
    "phase/test_exact_numbers.py",
    "phase/test_machines.py",
    "phase/test_numerical.py",
    "phase/test_numerical_energies.py",
    "phase/test_phase_space_kernel.py",
    "phase/test_portrait_kernel.py",
    "phase/test_positions.py",
    "phase/test_proved_equilibria.py",
    "phase/test_turning_errors.py",
    "plot/test_driven.py",
    "plot/test_layout.py",
    "plot/test_tilted_portrait.py",
    "systems/test_free_rotor_system.py",
    "systems/test_inertia.py",
)


def pytest_configure(config):
    """Leave out what is slow where neither files nor a selection are asked for."""
    everything = config.args_source is config.ArgsSource.TESTPATHS
    if everything and not (config.option.markexpr or config.option.keyword):
        config.option.markexpr = FAST
    if everything and config.option.markexpr == "slow":  # examples of docstrings are fast
        config.args = ["tests"]


def pytest_ignore_collect(collection_path, config):
    """Leave files unread of which no test would run."""
    if config.option.markexpr == FAST and is_slow(collection_path):
        return True
    if config.option.markexpr == "slow" and collection_path.suffix == ".py":
        return None if is_slow(collection_path) or names_slow(collection_path) else True
    return None


@pytest.hookimpl(wrapper=True)
def pytest_collect_file():
    """Look for examples in the package's docstrings alone, not in those of tests."""
    return [one for one in (yield) if type(one).__name__ != "DoctestModule"]


def pytest_itemcollected(item):
    """Mark what is slow as a whole."""
    if is_slow(item.path):
        item.add_marker(pytest.mark.slow)


@cache
def is_slow(path):
    """Whether a file is slow as a whole: asked once a file, not once for each of its tests."""
    if not path.is_relative_to(TESTS):
        return False
    own = path.relative_to(TESTS)
    return any(one.as_posix() in SLOW for one in (own, *own.parents))


def names_slow(path):
    """Whether a file may mark tests of its own as slow: its text has the word."""
    return b"slow" in path.read_bytes()


def pytest_terminal_summary(terminalreporter, config):
    """Say what was left out."""
    if config.option.markexpr == FAST:
        terminalreporter.write_line("slow tests were left out: pytest -n auto -m slow runs them")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """Put files in the order in which workers take them: ``FIRST``, then by number of tests."""
    place = {TESTS / name: i for i, name in enumerate(FIRST)}
    tests = Counter(item.path for item in items)
    items.sort(key=lambda item: (place.get(item.path, len(FIRST)), -tests[item.path]))


def pytest_collection_finish():
    """Leave modules and tests out of garbage collections, which took a seventh of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 50, 20)


def pytest_sessionfinish():
    """Look for what was not closed once: pytest collects five times, which took seconds."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def every_branch_is_checked():
    """Hold each branch of equilibria that a test computes against what holds of all of them."""
    from witnesses import branch_invariants

    from phasekit.bifurcation.continuation.curve_walk import CurveWalk

    search = CurveWalk.search

    def checked(walker, path):
        found, placed, messages = search(walker, path)
        detect = set(walker.options.detect)
        if walker.kind == "equilibrium" and detect == {"fold", "branch_point", "hopf"}:
            curve = walker.curve
            both = walker.in_order([*placed, *found.outside])
            special = [one for one in both if one.special.kind != "event"]
            branch_invariants.check(curve, path, special, found.eigenvalues, curve.conservative)
        return found, placed, messages

    CurveWalk.search = checked
    yield
    CurveWalk.search = search
