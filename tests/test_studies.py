"""The studies run, write their picture, and print the numbers that they should."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = sorted((Path(__file__).parents[1] / "studies").glob("*.py"))
STUDIES = [path for path in SCRIPTS if "__main__" in path.read_text(encoding="utf-8")]


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


def test_the_two_wells_have_one_period_and_different_actions(tmp_path):
    """The actions differ by 2 |C|/sqrt(A), whatever the energy."""
    script = next(path for path in STUDIES if path.stem == "equal_periods_of_two_wells")
    text = run(script, tmp_path)
    lower, upper = re.findall(r"period (\S+) s, action (\S+) ", text)
    assert float(lower[0]) == pytest.approx(float(upper[0]), rel=1e-12)
    assert float(lower[1]) > 3.0 * float(upper[1])
    ((apart, formula),) = re.findall(r"differ by (\S+) rad.*= (\S+)", text)
    assert apart == formula


def test_backbone_curves_end_at_the_saddle_or_at_the_top(tmp_path):
    script = next(path for path in STUDIES if path.stem == "backbone_curves")
    text = run(script, tmp_path)
    assert "fold at beta = 1.151233 rad = 0.3664 pi" in text
    ends = re.findall(r"beta = (\S+)\s+pi, (\S+): .* amplitude of (\S+) deg", text)
    assert [end for beta, _, end in ends if beta in ("0.38", "0.42", "1/2")] == ["180.0"] * 3
    assert len([center for _, center, _ in ends if center == "upper_center"]) == 5


def test_the_docs_show_every_study():
    page = (Path(__file__).parents[1] / "docs" / "studies.md").read_text(encoding="utf-8")
    for script in STUDIES:
        assert f"`studies/{script.name}`" in page
        assert f"auto_studies/{script.stem}.png" in page
