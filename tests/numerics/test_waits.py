"""Whoever waits for more than two seconds is told why."""

import os
import sys
import time
import types

import numba
import pytest
from numba.core import event

import phasekit as pk
from phasekit.cells import progress
from phasekit.numerics import compiling, waits


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setattr(waits, "watched", lambda: True)
    monkeypatch.setattr(waits, "PATIENCE", 0.01)
    monkeypatch.setattr(compiling._COMPILING, "told", False)


def compiled(module, seconds=0.0):
    """Compile a function of a module, which takes at least so long."""
    space = {"__name__": module}
    exec("def double(x):\n    return 2 * x", space)

    class Slow(event.Listener):
        def on_start(self, started):
            time.sleep(seconds)

        def on_end(self, ended):
            pass

    with event.install_listener("numba:compile", Slow()):
        assert numba.njit(space["double"])(2) == 4


def test_compiling_is_said_once(terminal, capfd):
    compiled("phasekit.made_up", 0.3)
    compiled("phasekit.made_up", 0.3)
    text = "phasekit: compiling once for this machine, which takes up to half a minute\n"
    assert capfd.readouterr().err == text


def test_many_functions_that_are_compiled_one_after_the_other_are_one_wait(
    terminal, monkeypatch, capfd
):
    monkeypatch.setattr(waits, "PATIENCE", 0.4)
    for _ in range(4):
        compiled("phasekit.made_up", 0.2)
    assert capfd.readouterr().err.count("compiling") == 1


def test_what_takes_long_is_said_once_by_the_outermost(terminal, capfd):
    with waits.said("counting sheep"), waits.said("counting legs"):
        time.sleep(0.1)
    with waits.said("counting wolves"):
        pass
    assert capfd.readouterr().err == "phasekit: counting sheep\n"
    with pytest.raises(KeyboardInterrupt), waits.said("counting sheep"):
        raise KeyboardInterrupt
    with waits.said("counting again"):
        time.sleep(0.1)
    assert capfd.readouterr().err == "phasekit: counting again\n"


def test_how_far_it_is_is_said_again_and_again(terminal, monkeypatch, capfd):
    monkeypatch.setattr(waits, "AGAIN", 0.1)
    with waits.said("counting sheep"):
        for count in range(1, 4):
            waits.stage(f"{count} sheep")
            time.sleep(0.25)
    time.sleep(0.2)
    lines = capfd.readouterr().err.splitlines()
    assert lines == [f"phasekit: counting sheep: {count} sheep" for count in (1, 2, 3)]
    with waits.said("counting legs"):
        time.sleep(0.05)
    assert capfd.readouterr().err == "phasekit: counting legs\n"


@pytest.mark.parametrize("moving", [False, True])
def test_a_branch_says_how_many_points_it_has(terminal, monkeypatch, capfd, moving):
    monkeypatch.setattr(waits, "AGAIN", 0.02)
    f = {"x": "y", "y": "mu*y - x - y**3"}
    problem = pk.Problem(f, ("x", "y"), {"mu": 0.5})
    if moving:
        orbit = pk.periodic_orbit(problem, [1.0, 0.0])
        capfd.readouterr()
        options = pk.ContinuationOptions(max_step=2e-3, max_points=10_000)
        branch = pk.continuation(problem, "mu", orbit=orbit, span=(0.4, 0.6), options=options)
    else:
        # Enough of them that the lines, which a thread writes, come in between on any machine.
        options = pk.ContinuationOptions(max_step=2e-5, max_points=1_000_000)
        branch = pk.continuation(problem, "mu", x0=[0.0, 0.0], span=(-1.0, 1.0), options=options)
    assert len(branch.points.point) > 5
    text = capfd.readouterr().err
    kind = "periodic orbits" if moving else "equilibria"
    assert f"phasekit: following {kind} along mu" in text
    assert " points" in text


def test_functions_of_others_and_quick_ones_are_not_said(terminal, monkeypatch, capfd):
    compiled("somebody.elses", 0.3)
    monkeypatch.setattr(waits, "PATIENCE", 60.0)
    compiled("phasekit.made_up")
    assert capfd.readouterr().err == ""


def test_nothing_is_said_where_nobody_looks(monkeypatch, capfd):
    monkeypatch.setattr(waits, "PATIENCE", 0.01)
    assert not waits.watched()
    compiled("phasekit.made_up", 0.1)
    assert capfd.readouterr().err == ""


def test_what_is_no_stream_is_no_terminal(monkeypatch):
    closed = open(os.devnull, "w")
    closed.close()
    for stream in (None, closed, object()):
        monkeypatch.setattr(sys, "stderr", stream)
        assert not waits.watched()


def notebook(monkeypatch, config):
    shell = types.SimpleNamespace(config=config)
    module = types.SimpleNamespace(get_ipython=lambda: shell)
    monkeypatch.setitem(sys.modules, "IPython", module)


def test_a_notebook_is_looked_at(monkeypatch):
    notebook(monkeypatch, {"TerminalInteractiveShell": {}})
    assert not waits.watched()
    notebook(monkeypatch, {"IPKernelApp": {}})
    assert waits.watched()
    with progress.progress_bar(10, None) as bar:
        assert bar.total == 10
        bar.update(10)
