"""Whatever is passed to a public callable, it is understood, or refused by a documented error."""

from __future__ import annotations

import contextlib
import io
import os
import warnings
import zlib
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
import pytest
from properties import hostile

import phasekit as pk

matplotlib.use("Agg")

#: How many values of the pool are tried for each argument; PHASEKIT_FUZZ overrides it.
EACH = int(os.environ.get("PHASEKIT_FUZZ", "1"))
DOCUMENTED = (pk.ParameterError, pk.ConvergenceError, pk.StoreError)
CALLABLES = hostile.callables()


@pytest.fixture(autouse=True)
def _nothing_is_left(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yield
    hostile.plt.close("all")


def sample(seed: str) -> list[str]:
    """Return names of the pool, the same ones in every run."""
    rng = np.random.default_rng(zlib.crc32(seed.encode()))
    names = list(hostile.POOL)
    return [str(name) for name in rng.permutation(names)[:EACH]]


def attempt(function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> None:
    """Call with every undocumented warning an error; the documented exceptions pass."""
    with (
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
    ):
        warnings.simplefilter("error")
        for documented in hostile.ANNOUNCED:
            warnings.filterwarnings("ignore", documented, RuntimeWarning)
        try:
            function(*args, **kwargs)
        except DOCUMENTED:
            pass
        finally:
            hostile.plt.close("all")


@pytest.mark.parametrize("name", hostile.INSTANCES)
def test_instances_are_of_their_classes(name):
    assert type(hostile.INSTANCES[name]()) is hostile.OWNERS[name]


@pytest.mark.parametrize("name", CALLABLES)
def test_hostile_arguments(name):
    function = CALLABLES[name]
    fitting = hostile.arguments(name, function)
    for argument in fitting:
        for value in sample(f"{name} {argument}"):
            if (name, value) in hostile.LONG:
                continue
            given = {key: make() for key, make in fitting.items()}
            given[argument] = hostile.POOL[value]()
            attempt(function, **given)


@pytest.mark.parametrize("value", sample("command line"))
def test_hostile_command_lines(value):
    for argv in hostile.argv(hostile.POOL[value]()):
        with contextlib.suppress(SystemExit):
            attempt(hostile.main, argv)


@pytest.mark.parametrize("name", ["equilibria", "orbits", "Potential", "RigidBody", "sweep"])
def test_the_arguments_that_fit_do(name):
    assert CALLABLES[name](**{k: f() for k, f in hostile.arguments(name, CALLABLES[name]).items()})


@pytest.mark.parametrize("name", CALLABLES)
def test_unknown_keywords(name):
    fitting = {k: f() for k, f in hostile.arguments(name, CALLABLES[name]).items()}
    with pytest.raises((TypeError, pk.ParameterError), match="nonsense"):
        CALLABLES[name](**fitting, nonsense=1)
