"""Whoever waits for more than two seconds is told why."""

import os
import sys
import time
import types

import pytest

import phasekit as pk
from phasekit.cells import progress
from phasekit.numerics import forms, waits
from phasekit.numerics.compile import kernel
from phasekit.numerics.compiler import machine
from phasekit.numerics.compiler.kinds import FLOAT


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setattr(waits, "watched", lambda: True)
    monkeypatch.setattr(waits, "PATIENCE", 0.01)


@kernel
def doubled(x):
    return 2.0 * x


@pytest.fixture
def slow(monkeypatch, tmp_path):
    """Let the finished form of a kernel take at least so long, as one of so many lines would."""
    monkeypatch.setenv("PHASEKIT_CACHE_DIR", str(tmp_path))
    assemble = machine.assemble
    lines = []

    def slowly(text, effort):
        lines.append(text.count("\n"))
        time.sleep(0.3 if effort else 0.0)
        return assemble(text, effort)

    def make(seconds):
        kinds = (FLOAT,)
        monkeypatch.setattr(machine, "assemble", slowly)
        forms.python_function(doubled.py_func, kinds, 0, make=True)
        monkeypatch.setattr(forms, "_SECONDS_A_LINE", seconds / lines[-1])
        assert forms.python_function(doubled.py_func, kinds, 1, make=True)(2.0) == 4.0

    return make


def test_how_long_compiling_takes_is_said(terminal, slow, monkeypatch, capfd):
    slow(12.0)
    lines = capfd.readouterr().err.splitlines()
    assert lines == ["phasekit: compiling, about 12 s, once on this machine"]


def test_it_is_said_where_nobody_looks_but_not_in_pools(slow, monkeypatch, capfd):
    """Into the log of a script; on standard error, so that what commands print stays clean."""
    monkeypatch.setattr(waits, "PATIENCE", 0.01)
    assert not waits.watched()
    slow(1.0)
    out, err = capfd.readouterr()
    assert "compiling" in err
    assert out == ""
    monkeypatch.setattr(waits.multiprocessing, "parent_process", lambda: object())
    with waits.notice("compiling", logged=True):
        time.sleep(0.1)
    assert capfd.readouterr().err == ""


def test_a_notebook_shows_plain_text(monkeypatch, capfd):
    notebook(monkeypatch, {"IPKernelApp": {}})
    waits.tell("compiling")
    assert capfd.readouterr() == ("phasekit: compiling\n", "")


def test_what_takes_long_is_said_once_by_the_outermost(terminal, capfd):
    with waits.notice("counting sheep"), waits.notice("counting legs"):
        time.sleep(0.1)
    with waits.notice("counting wolves"):
        pass
    assert capfd.readouterr().err == "phasekit: counting sheep\n"
    with pytest.raises(KeyboardInterrupt), waits.notice("counting sheep"):
        raise KeyboardInterrupt
    with waits.notice("counting again"):
        time.sleep(0.1)
    assert capfd.readouterr().err == "phasekit: counting again\n"


def test_how_far_it_is_is_said_again_and_again(terminal, monkeypatch, capfd):
    monkeypatch.setattr(waits, "AGAIN", 0.1)
    with waits.notice("counting sheep"):
        for count in range(1, 4):
            waits.stage(f"{count} sheep")
            time.sleep(0.25)
    time.sleep(0.2)
    lines = capfd.readouterr().err.splitlines()
    assert lines == [f"phasekit: counting sheep: {count} sheep" for count in (1, 2, 3)]
    with waits.notice("counting legs"):
        time.sleep(0.05)
    assert capfd.readouterr().err == "phasekit: counting legs\n"


@pytest.mark.slow
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


def test_what_is_quick_is_not_said(terminal, monkeypatch, capfd):
    monkeypatch.setattr(waits, "PATIENCE", 60.0)
    with waits.notice("counting sheep", logged=True):
        pass
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
