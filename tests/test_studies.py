"""The studies run, write their picture, and print the numbers that they should.

Those that take long are left to the gallery, which runs all of them for their pictures. Where
``PHASEKIT_SITE`` names a built site, what they printed there is held against the same numbers.
``PHASEKIT_STUDIES=all`` runs each study here, in a process of its own.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import html
import io
import os
import re
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

matplotlib.use("Agg")
pytestmark = pytest.mark.slow
FOLDER = Path(__file__).parents[1] / "studies"
STUDIES = [
    path for path in sorted(FOLDER.glob("*/*.py")) if "__main__" in path.read_text(encoding="utf-8")
]
#: Thousands of motions.
LONG = {
    "capture_against_simulation",
    "doublings_of_a_cycle",
    "escape_of_a_junction",
    "response_of_a_driven_disk",
    "threshold_of_irregular_motion",
}
ALL = "PHASEKIT_STUDIES" in os.environ
SITE = os.environ.get("PHASEKIT_SITE")


def here(script: Path, folder: Path) -> str:
    """Run a study in this process, warnings being errors; what it prints."""
    printed = io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        warnings.catch_warnings(),
        plt.rc_context(),
        contextlib.redirect_stdout(printed),
    ):
        warnings.simplefilter("error")
        patch.chdir(folder)
        patch.setattr(sys, "argv", [str(script)])
        patch.syspath_prepend(script.parent)
        runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
    return printed.getvalue()


def alone(script: Path, folder: Path) -> str:
    """Run a study as a user would, warnings being errors; what it prints."""
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


def on_site(name: str) -> tuple[Path, str]:
    """The picture of a study in the gallery, and what it printed there, warnings with it."""
    (page,) = Path(SITE).glob(f"gallery/*/{name}.html")
    (printed,) = re.findall(
        r'"sphx-glr-script-out.*?<pre>(.*?)</pre>', page.read_text(encoding="utf-8"), re.DOTALL
    )
    text = html.unescape(re.sub(r"<[^>]*>", "", printed))
    assert "Warning" not in text
    return Path(SITE) / "_images" / f"sphx_glr_{name}_001.png", text


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run a study by its name: its picture and what it prints."""

    @functools.cache
    def once(name: str) -> tuple[Path, str]:
        if SITE and not ALL:
            return on_site(name)
        folder = tmp_path_factory.mktemp(name)
        text = (alone if ALL else here)(*FOLDER.glob(f"*/{name}.py"), folder)
        assert f"wrote {name}.png" in text
        return folder / f"{name}.png", text

    def unless_long(name: str) -> tuple[Path, str]:
        if name in LONG and not (SITE or ALL):
            pytest.skip("long: PHASEKIT_STUDIES=all runs it, the gallery does, see PHASEKIT_SITE")
        return once(name)

    return unless_long


@pytest.mark.parametrize("name", [path.stem for path in STUDIES])
def test_study_runs_and_writes_its_picture(run, name):
    picture, text = run(name)
    assert "wrote " in text
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_study_needs_nothing_that_is_loaded_here(run, tmp_path):
    """Nor where it stands: it is run as its users do."""
    name = "veljovic2015_figure_5"
    text = alone(*FOLDER.glob(f"*/{name}.py"), tmp_path)
    numbers = text.removesuffix(f"wrote {name}.png\n")
    assert numbers.count("\n") == 6
    assert run(name)[1].startswith(numbers)
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_thresholds_of_progressive_motion_are_those_of_the_paper(run):
    """[Veljovic2015], section 4: 1.54 1/s at beta = pi/3 and 2.53 1/s at beta = 0.01 pi."""
    _, text = run("veljovic2015_figure_6")
    speeds = re.findall(r"beta = (\S+)\s+pi: progressive motion above (\S+)", text)
    assert dict(speeds)["1/3"] == "1.5401"
    assert dict(speeds)["0.01"] == "2.5296"


def test_the_two_wells_have_one_period_and_different_actions(run):
    """The actions differ by 2 |C|/sqrt(A), whatever the energy."""
    _, text = run("equal_periods_of_two_wells")
    lower, upper = re.findall(r"period (\S+) s, action (\S+) ", text)
    assert float(lower[0]) == pytest.approx(float(upper[0]), rel=1e-12)
    assert float(lower[1]) > 3.0 * float(upper[1])
    ((apart, formula),) = re.findall(r"differ by (\S+) rad.*= (\S+)", text)
    assert apart == formula


def test_backbone_curves_end_at_the_saddle_or_at_the_top(run):
    _, text = run("backbone_curves")
    assert "fold at beta = 1.151233 rad = 0.3664 pi" in text
    ends = re.findall(r"beta = (\S+)\s+pi, (\S+): .* amplitude of (\S+) deg", text)
    assert [end for beta, _, end in ends if beta in ("0.38", "0.42", "1/2")] == ["180.0"] * 3
    assert len([center for _, center, _ in ends if center == "upper_center"]) == 5


def test_the_least_bearing_load_and_the_fold(run):
    _, text = run("least_bearing_load")
    (inside,) = re.findall(r"at most (\S+) of the peak load on it", text)
    assert 0.99 < float(inside) < 1.00001
    best = re.findall(r"e = +(\S+) mm: least .* at beta = +(\S+) deg", text)
    assert [float(beta) for _, beta in best] == [90.0, 84.0, 80.0, 80.0, 78.0, 2.0]
    folds = re.findall(
        r"fold at beta = (\S+) deg: .* center (\S+) N.* most (\S+) N "
        r".* (\S+) N before, (\S+) N after",
        text,
    )
    assert [beta for beta, *_ in folds] == ["49.55", "75.09"]
    for _, rest, swing, before, after in folds:
        assert before == after  # the worst swing does not feel the fold
        assert float(rest) < float(swing) < float(before)


@pytest.mark.parametrize(
    ("figure", "same"), [("2011_figure_8", "a = 0 mm"), ("2013_figure_5", None)]
)
def test_printed_and_correct_curves_differ_except_where_the_printed_formula_holds(
    run, figure, same
):
    """(6.12) lacks psi, which is zero for a = 0."""
    _, text = run(f"hedrih_veljovic{figure}")
    found = re.findall(r", (\w+ = \S+ \S+): at most (\S+), as printed (\S+)", text)
    assert len(found) == 4
    assert [name for name, right, printed in found if right == printed] == ([same] if same else [])


def test_every_study_begins_with_its_title_and_says_how_it_runs():
    """The gallery takes the title from there."""
    assert len(STUDIES) >= 19
    for script in STUDIES:
        title, line = ast.get_docstring(ast.parse(script.read_text())).split("\n")[:2]
        assert set(line) == {"="}
        assert len(line) == len(title)
        assert f"python studies/{script.parent.name}/{script.name}" in script.read_text()


def test_a_rotor_leaves_a_fold_late(run):
    """The lag's power lies between those of strong damping and of none."""
    _, text = run("run_down_through_the_fold")
    assert 2 / 3 < float(re.search(r"to the power (\S+)", text)[1]) < 4 / 5
    assert len(re.findall(r"leaves 0\.\d+ 1/s late", text)) == 5


def test_the_share_of_captured_motions_is_that_in_closed_form(run):
    """Within three standard errors at small damping."""
    _, text = run("capture_against_simulation")
    assert "0.719450" in text
    off = [float(x) for x in re.findall(r"(\S+) standard errors off", text)]
    assert len(off) == 4
    assert max(map(abs, off[1:])) < 3.0


def test_a_driven_disk_jumps_at_two_frequencies(run):
    _, text = run("response_of_a_driven_disk")
    jumps = [float(one) for one in re.findall(r"jump at (\S+) 1/s", text)]
    natural = float(re.search(r"oscillations: (\S+) 1/s", text)[1])
    assert len(jumps) == 2
    assert 0.8 * natural < jumps[1] < jumps[0] < natural
    assert float(re.search(r"exp\(-damping T\) to (\S+)", text)[1]) < 1e-6


def test_the_junction_leaves_at_the_rate_of_simulated_phases(run):
    _, text = run("escape_of_a_junction")
    medians = dict(re.findall(r"noise (\S+): half .* at (\S+)", text))
    assert medians == {"0.001": "0.978", "0.01": "0.886", "0.03": "0.747"}
    pairs = re.findall(r"rate (\S+) .*simulated (\S+) \+- (\S+)", text)
    assert len(pairs) == 2
    for rate, found, spread in (map(float, one) for one in pairs):
        assert abs(rate - found) < 3.0 * spread


def test_doublings_of_a_cycle_approach_feigenbaums_ratio(run):
    """The first two places were refined elsewhere, to 12 digits."""
    _, text = run("doublings_of_a_cycle")
    places = re.findall(r"doubling \d: c = (\S+), period (\S+)", text)
    assert places[0] == ("2.832445028", "5.769820")
    assert places[1][0] == "3.837358168"
    first, second = (float(x) for x in re.search(r"distances: (\S+), (\S+)", text).groups())
    assert abs(second - 4.669202) < 0.11 < abs(first - 4.669202)


def test_curves_of_a_driven_saddle_cross_at_the_threshold(run):
    _, text = run("threshold_of_irregular_motion")
    seen = re.findall(r"threshold (\S+) 1/s2, seen (\S+)", text)
    assert len(seen) == 3
    for expected, simulated in seen:
        assert float(simulated) == pytest.approx(float(expected), rel=1e-4)
