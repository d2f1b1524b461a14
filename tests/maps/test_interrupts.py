"""Sweeps that are interrupted end within moments, keep what is done, and leave nothing behind.

The first tests send signals to sweeps in processes of their own; ``PHASEKIT_KILLS=1`` runs them in
all combinations. The others raise signals in this process, at moments that are known.
"""

import itertools
import multiprocessing
import os
import re
import signal
import threading
import time
from pathlib import Path

import pytest
from witnesses.kill_harness import Map, content, local_cluster, processes_of, wait_for

import phasekit as pk
from phasekit import cli
from phasekit.cells import progress
from phasekit.maps import run
from phasekit.numerics import interrupts

pytest.importorskip("zarr")

SHAPE = Map()
TOLD = re.compile(r"KeyboardInterrupt: (\d+) of 8 tiles are done; the same call resumes the map\n$")
COMMAND = re.compile(
    r"phasekit: interrupted: (\d+) of 8 tiles are done; the same call resumes the map\n"
)

in_proc = pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="looks for processes in /proc"
)
GROUP, PARENT = os.killpg, os.kill
ONCE, QUICKLY, SLOWLY = (0.0,), (0.0, 0.0), (0.0, 0.3)
SOME = [
    ("command", 2, GROUP, ONCE),
    ("command", 1, GROUP, QUICKLY),
]
ALL = list(
    itertools.product(
        ("command", "main", "in_a_thread"), (1, 2), (GROUP, PARENT), (ONCE, QUICKLY, SLOWLY)
    )
)


@pytest.mark.slow
@in_proc
@pytest.mark.parametrize(
    ("call", "workers", "to", "waits"), ALL if "PHASEKIT_KILLS" in os.environ else SOME
)
def test_interrupts_end_a_sweep(call, workers, to, waits, tmp_path):
    """Each tile takes longer than the test waits: nothing but the signals can end the sweep."""
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    with processes_of(log, delay=0.3) as group:
        start = group.command if call == "command" else group.sweep
        how = {} if call == "command" else {"call": call}
        process = start(SHAPE, store, workers=workers, **how)
        wait_until_done(process, store, 2, group)
        for wait in waits:
            time.sleep(wait)
            if process.poll() is None:
                to(process.pid, signal.SIGINT)
        code = process.wait(60)
        wait_for(lambda: not group.alive(), "all processes to end")
        said = group.errors.read_text()
        done = SHAPE.done(store)
        assert 2 <= len(done) < 8
        assert code == -signal.SIGINT or (call, code) == ("command", 130)
        if waits is ONCE and call != "in_a_thread":
            told = (COMMAND if call == "command" else TOLD).search(said)
            assert told, said
            assert int(told[1]) == len(done)
            assert not any(name.endswith(".partial") for name in content(store))
        if call == "command":
            assert "Traceback" not in said
            assert said.count("\n") <= 1
        assert "leaked" not in said


@pytest.mark.slow
@in_proc
def test_no_worker_outlives_a_terminated_sweep(tmp_path):
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    with processes_of(log, delay=0.3) as group:
        process = group.sweep(SHAPE, store, workers=2)
        wait_until_done(process, store, 1, group)
        process.terminate()
        assert process.wait(60) == -signal.SIGTERM
        wait_for(lambda: not group.alive(), "the workers to end")
        assert "leaked" not in group.errors.read_text()


@in_proc
@pytest.mark.skipif("PHASEKIT_KILLS" not in os.environ, reason="PHASEKIT_KILLS=1 runs it")
def test_interrupts_on_a_cluster_of_processes(tmp_path):
    pytest.importorskip("distributed")
    store, log = tmp_path / "map.zarr", tmp_path / "log"
    with processes_of(log, delay=0.5) as group:
        process = group.sweep(SHAPE, store, call="clustered")
        wait_until_done(process, store, 2, group)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == -signal.SIGINT
        wait_for(lambda: not group.alive(), "all processes to end")
        said = group.errors.read_text()
        assert re.search(r"KeyboardInterrupt: \d of 8 tiles are done", said), said
        assert 2 <= len(SHAPE.done(store)) < 8


def wait_until_done(process, store, tiles, group):
    def done():
        assert process.poll() is None, group.errors.read_text()
        return len(SHAPE.done(store)) >= tiles

    wait_for(done, f"{tiles} tiles", 120)


# ------------------------------------------------------------------------------ in this process


@pytest.fixture
def third(monkeypatch):
    """Raise Ctrl-C when the third tile is counted, once."""
    finish = run.Tally.finish
    count = itertools.count(1)

    def interrupting(tally, tile):
        finish(tally, tile)
        if next(count) == 3:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(run.Tally, "finish", interrupting)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupt_says_how_much_is_done(workers, tmp_path, third, capfd):
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt, match=r"^(\d) of 8 tiles are done; the same") as caught:
        SHAPE.sweep(tmp_path / "map.zarr", workers=workers, progress=True)
    done = SHAPE.done(tmp_path / "map.zarr")
    assert int(str(caught.value)[0]) == len(done) >= 3
    assert capfd.readouterr().err.endswith("\n")  # the bar is closed
    assert signal.getsignal(signal.SIGINT) is handler
    assert not multiprocessing.active_children()
    ds = SHAPE.sweep(tmp_path / "map.zarr", workers=1)
    assert "computed" not in ds


def test_an_interrupt_on_a_cluster(tmp_path, third):
    pytest.importorskip("distributed")
    with (
        local_cluster(1) as client,
        pytest.raises(KeyboardInterrupt, match=r"^\d of 8 tiles are done"),
    ):
        SHAPE.sweep(tmp_path / "map.zarr", client=client)
    assert len(SHAPE.done(tmp_path / "map.zarr")) >= 3


def test_what_the_store_says_is_counted(tmp_path, monkeypatch):
    """A tile is done once it is marked, though the interrupt comes before it is counted."""

    def interrupted(tally, tile):
        raise KeyboardInterrupt

    monkeypatch.setattr(progress._NoBar, "update", interrupted)
    with pytest.raises(KeyboardInterrupt, match=r"^1 of 8 tiles"):
        SHAPE.sweep(tmp_path / "map.zarr", workers=1, progress=False)


def test_interrupts_before_anything_is_written(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "prepare", interrupted)
    with pytest.raises(
        KeyboardInterrupt, match=r"^0 of 8 tiles are done; the same call resumes the map$"
    ):
        SHAPE.sweep(tmp_path / "map.zarr", workers=1)
    assert not (tmp_path / "map.zarr").exists()


def test_handlers_of_the_caller_are_asked(tmp_path, third):
    """One that does not raise lets the sweep go on."""
    heard = []
    before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        SHAPE.sweep(tmp_path / "map.zarr", workers=2)
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]
    assert SHAPE.done(tmp_path / "map.zarr") == SHAPE.tiles


def test_notes_are_kept_until_the_end():
    steps = []

    def work():
        with interrupts.deferred_interrupts():
            signal.raise_signal(signal.SIGINT)
            steps.append("after")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert steps == ["after"]


def test_no_signal_is_caught_in_other_threads(tmp_path):
    found = []

    def sweep():
        found.append(SHAPE.sweep(tmp_path / "map.zarr", workers=2))

    thread = threading.Thread(target=sweep)
    thread.start()
    thread.join()
    assert SHAPE.done(tmp_path / "map.zarr") == SHAPE.tiles
    assert len(found) == 1


def test_daemonic_processes_work_alone(tmp_path, monkeypatch):
    """They may not start processes."""
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)
    with pytest.raises(pk.StoreError, match="daemonic and may not start others; pass workers=1"):
        SHAPE.sweep(tmp_path / "map.zarr", workers=2)
    assert "computed" not in SHAPE.sweep(tmp_path / "map.zarr")


def test_the_same_command_says_how_much_is_left(tmp_path, third, capsys):
    recipe = tmp_path / "map.toml"
    axes = "\n".join(f"{name} = {axis.tolist()}" for name, axis in SHAPE.axes.items())
    recipe.write_text(
        f"store = {str(tmp_path / 'map.zarr')!r}\nworkers = 1\nchunks = {{ beta = 2, a = 3 }}\n"
        f"[parameters]\ne = 0.0115\nr = 0.21\nomega1 = 2.5\n[axes]\n{axes}\n"
    )
    command = ["sweep", str(recipe)]
    assert cli.main(command) == 130
    said = capsys.readouterr()
    assert said.err == (
        "phasekit: interrupted: 3 of 8 tiles are done; the same call resumes the map\n"
    )
    assert said.out == ""
    assert cli.main(command) == 0
    assert capsys.readouterr().out.startswith("5 of 8 tiles are left\n")


def test_bars_do_not_flood_logs(capfd):
    with progress.progress_bar(10_000, True) as bar:
        for _ in range(20):
            time.sleep(0.11)  # longer than a terminal's bar waits
            bar.update(500)
    err = capfd.readouterr().err
    assert "10.0k/10.0k" in err
    assert err.count("\r") <= 3


def test_commands_are_interrupted_in_one_line(monkeypatch, capsys):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("phasekit.cli.info.run", interrupted)
    assert cli.main(["info", "map.zarr"]) == 130
    assert capsys.readouterr().err == "phasekit: interrupted\n"
