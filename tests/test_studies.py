"""The studies run, write their picture, and print the numbers that the paper prints."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

STUDIES = sorted((Path(__file__).parents[1] / "studies").glob("*_figure_*.py"))


def run(script: Path, folder: Path) -> str:
    """Run a study as a user would, warnings being errors; its output."""
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script)],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("script", STUDIES, ids=lambda path: path.stem)
def test_study_runs_and_writes_its_picture(script, tmp_path):
    assert script.stem in run(script, tmp_path)
    picture = tmp_path / f"{script.stem}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_thresholds_of_progressive_motion_are_those_of_the_paper(tmp_path):
    """[Veljovic2015], section 4: 1.54 1/s at beta = pi/3 and 2.53 1/s at beta = 0.01 pi."""
    script = next(path for path in STUDIES if path.stem.endswith("figure_6"))
    speeds = re.findall(r"beta = (\S+)\s+pi: progressive motion above (\S+)", run(script, tmp_path))
    assert dict(speeds)["1/3"] == "1.5401"
    assert dict(speeds)["0.01"] == "2.5296"
