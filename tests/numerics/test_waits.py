"""Whoever waits for more than two seconds is told why."""

import os
import sys
import time
import types

import numba
import pytest
from numba.core import event

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
    text = "phasekit: compiling once for this machine, which takes some seconds\n"
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
