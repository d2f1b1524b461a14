"""AUTO-07p as an executable: a system compiled with its library, run and timed as a process.

``AUTO_DIR`` names a built AUTO-07p (``./configure && make`` with ``FFLAGS=-O``). Processes are
timed by what the system accounts to them, user and system time together, with one thread.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

#: What every run has in common: constants of AUTO's demos, without output of single orbits.
CONSTANTS: dict[str, Any] = {
    "ILP": 1, "ISW": 1, "IPLT": 0, "NBC": 0, "NINT": 0, "NTST": 25, "NCOL": 4, "IAD": 3,
    "NPR": 100_000, "MXBF": 10, "IID": 0, "ITMX": 8, "ITNW": 5, "NWTN": 3, "JAC": 0,
    "EPSL": 1e-7, "EPSU": 1e-7, "EPSS": 1e-5, "DS": 0.01, "DSMIN": 1e-4, "IADS": 1,
    "THL": {11: 0.0}, "THU": {},
}  # fmt: skip

SOURCE = """
      SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
      IMPLICIT NONE
      INTEGER NDIM, IJAC, ICP(*)
      DOUBLE PRECISION U(NDIM), PAR(*), F(NDIM), DFDU(NDIM,*), DFDP(NDIM,*)
{f}
      END SUBROUTINE FUNC
      SUBROUTINE STPNT(NDIM,U,PAR,T)
      IMPLICIT NONE
      INTEGER NDIM
      DOUBLE PRECISION U(NDIM), PAR(*), T
{start}
      END SUBROUTINE STPNT
      SUBROUTINE BCND
      END SUBROUTINE BCND
      SUBROUTINE ICND
      END SUBROUTINE ICND
      SUBROUTINE FOPT
      END SUBROUTINE FOPT
      SUBROUTINE PVLS
      END SUBROUTINE PVLS
"""


@dataclass(frozen=True)
class Run:
    """Least CPU time of a run in seconds, its number of points and the types of special ones."""

    seconds: float
    points: int
    special: list[str]


class Auto:
    """A system in Fortran, compiled in a folder of its own."""

    def __init__(self, folder: Path, f: list[str], start: list[str], states: int) -> None:
        objects = sorted(Path(os.environ.get("AUTO_DIR", "nowhere"), "lib").glob("*.o"))
        if not objects or shutil.which("gfortran") is None:
            pytest.skip("AUTO_DIR names no built AUTO-07p, or gfortran is missing")
        self.folder, self.states = folder, states
        lines = {"f": "\n".join(f"       {one}" for one in f)}
        lines["start"] = "\n".join(f"       {one}" for one in start)
        (folder / "system.f90").write_text(SOURCE.format(**lines))
        command = ["gfortran", "-O", "-fopenmp", "system.f90", *map(str, objects), "-o", "run"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)

    def run(self, repeats: int = 25, **constants: Any) -> Run:
        """Run with some constants; the least time of a few."""
        given = CONSTANTS | {"NDIM": self.states, "NPAR": 3} | constants
        text = "\n".join(f"{name} = {value!r}" for name, value in given.items())
        (self.folder / "fort.2").write_text(text + "\n")
        seconds = min(self._once() for _ in range(repeats))
        rows = (self.folder / "fort.7").read_text().splitlines()
        points = [row.split() for row in rows if row.split()[0] not in ("0",)]
        names = {1: "BP", 2: "LP", 3: "HB", 5: "LP", 6: "BP", 7: "PD", 8: "TR"}
        types = [names.get(abs(int(p[2])) % 10, "") for p in points]
        return Run(seconds, len(points), [one for one in types if one])

    def _once(self) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            ["./run"], cwd=self.folder, check=True, stdout=subprocess.DEVNULL,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    def keep(self) -> dict[str, int]:
        """Let later runs start from the special points of the last; labels of these by type."""
        shutil.copy(self.folder / "fort.8", self.folder / "fort.3")
        labels = {}
        for row in (self.folder / "fort.7").read_text().splitlines():
            words = row.split()
            if words[0] != "0" and abs(int(words[2])) % 10 == 3:
                labels["HB"] = int(words[3])
        return labels
