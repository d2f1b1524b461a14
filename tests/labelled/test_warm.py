"""Kernels compiled beforehand are those that first calls take."""

import json
import os
import subprocess
import sys

import pytest
from witnesses.variants import ALL

import phasekit as pk
from phasekit.cli import main
from phasekit.labelled import warm as module
from phasekit.numerics import kept
from phasekit.numerics.compile import kernel
from phasekit.numerics.kernels import QuickForm


@kernel
def total(n: int) -> float:
    """1 + 1/2 + ... + 1/n."""
    found = 0.0
    for i in range(n):
        found += 1.0 / (i + 1)
    return found


def test_quick_forms_are_finished_and_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("PHASEKIT_CACHE_DIR", str(tmp_path))
    seen = []

    def job(package):
        seen.append(package)
        assert total(4) == pytest.approx(25 / 12)
        (form,) = total.forms.values()
        assert isinstance(form, QuickForm)

    monkeypatch.setattr(module, "JOBS", {"sums": job})
    monkeypatch.setattr(module, "KERNELS", [total])  # not those that other tests have used
    found = pk.warm()
    assert seen == [pk]
    assert found.kernels == 1
    assert found.folder == str(tmp_path / "phasekit-kernels")
    assert not any(isinstance(form, QuickForm) for form in total.forms.values())
    (place, count, size), *_ = kept.inventory()
    assert str(place) == found.folder
    assert count == len(list(place.glob("*.kernel"))) >= 2  # quick and finished
    assert size == sum(one.stat().st_size for one in place.glob("*.kernel"))


@pytest.mark.parametrize("subjects", ["sums", ["equilibria", "sums"], [3]])
def test_unknown_subjects_are_refused_before_any_work(subjects, monkeypatch):
    monkeypatch.setitem(module.JOBS, "equilibria", pytest.fail)
    with pytest.raises(pk.ParameterError, match="^subject .* is unknown"):
        pk.warm(subjects)
    with pytest.raises(pk.ParameterError, match="^subjects: got 3"):
        pk.warm(3)


def test_the_environment_is_said(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("PHASEKIT_CACHE_DIR", str(tmp_path))
    assert main(["info", "--environment"]) == 0
    said = capsys.readouterr().out
    for words in ("phasekit ", "Python ", "numpy ", "llvmlite ", "threads: ", f"in {tmp_path}"):
        assert words in said
    with pytest.raises(SystemExit) as ended:
        main(["info"])
    assert ended.value.code == 2


@pytest.mark.slow
def test_first_calls_compile_nothing_afterwards(tmp_path):
    environment = {**os.environ, "PHASEKIT_CACHE_DIR": str(tmp_path)}

    def kernels_after(code):
        subprocess.run([sys.executable, "-c", code], env=environment, check=True)
        return sorted(one.name for one in tmp_path.rglob("*.kernel"))

    subjects = ["equilibria", "perturbed"]  # what is called below
    warm = kernels_after(
        f"from phasekit.cli import main; raise SystemExit(main(['warm', *{subjects}]))"
    )
    assert len(warm) > 10
    disk = json.dumps({"beta": 1.4, "e": 0.05, "a": 0.012, "r": 0.2, "omega1": 30.0, "m": 2.0})
    calls = f"""
import numpy as np, phasekit as pk
disk = pk.GyroRotorDisk(**{disk})
pk.sweep(disk, beta=np.linspace(0, 1.5, 100), a=np.linspace(-.06, .06, 100))
driven = pk.Perturbed(pk.Pendulum(length=9.81), damping=0.2, forcing=pk.Harmonic(0.5, 0.7))
pk.melnikov(driven)
pk.capture(pk.Perturbed(pk.Pendulum(length=9.81), damping=0.1))
pk.lyapunov(driven, 0.1, 0.0, duration=500.0)
"""
    for _ in range(2 if ALL else 1):  # processes end in another order each time, and none may crash
        assert kernels_after(calls) == warm
