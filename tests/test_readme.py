"""The README and the papers around it say what is so."""

import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import phasekit as pk
from phasekit.cli import main

matplotlib.use("Agg")
ROOT = Path(__file__).parents[1]
TOUR = ROOT / "docs" / "tutorial" / "tour.md"


def run(page):
    """The names that the examples of a page define, typed from top to bottom."""
    names = {}
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert blocks
    for block in blocks:
        exec(block, names)
    plt.close("all")
    return names


def folds_of(disk):
    return [f"{fold:.1f}" for fold in pk.critical(disk, "beta").critical_fold.values / pk.deg]


@pytest.fixture(scope="module")
def readme():
    return (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_calls_run_and_give_what_the_comments_say(readme):
    names = run(readme)
    assert pk.equilibria(names["disk"]).n_equilibria == 4
    assert pk.separatrices(names["disk"]).figure_eight
    said = re.search(r"# at ([\d.]+) and ([\d.]+) degrees", readme)
    assert folds_of(names["disk"]) == list(said.groups())
    assert [point.kind for point in names["cycles"].special_points].count("fold_of_cycles") == 2


@pytest.mark.slow
def test_the_tour_runs_and_prints_what_it_shows(capsys):
    """Words are the same, and numbers but for the last digit that is shown."""
    page = TOUR.read_text(encoding="utf-8")
    names, printed = {}, 0
    for block, shown in re.findall(
        r"```python\n(.*?)```\n(?:\n```text\n(.*?)```)?", page, re.DOTALL
    ):
        exec(block, names)
        said, wants = capsys.readouterr().out, shown
        number = r"-?\d+\.?\d*"
        assert re.sub(number, "#", said).split() == re.sub(number, "#", wants).split()
        for got, want in zip(re.findall(number, said), re.findall(number, wants), strict=True):
            last = 10.0 ** -len(want.partition(".")[2]) if "." in want else 0.0
            assert float(got) == pytest.approx(float(want), rel=0.0, abs=1.5 * last)
        printed += bool(shown)
    assert printed == 11
    assert pk.equilibria(names["system"]).n_equilibria == 4
    assert pk.separatrices(names["disk"]).figure_eight
    areas = pk.separatrices(names["well"]).lobe_area.values
    np.testing.assert_allclose(areas[np.isfinite(areas)], [4 / 3, 4 / 3], rtol=1e-12)
    plt.close("all")


def test_the_readme_is_short(readme):
    assert len(readme.splitlines()) <= 120


def test_the_shell_commands_run(readme, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (recipe,) = re.findall(r"```toml\n(.*?)```", TOUR.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "map.toml").write_text(recipe)
    lines = re.findall(r"^phasekit (?:portrait|diagram) .*$", readme, re.MULTILINE)
    commands = [line.split()[1:] for line in lines]
    commands += [["sweep", "map.toml"], ["info", "map.zarr"]]
    assert [words[0] for words in commands] == ["portrait", "diagram", "sweep", "info"]
    for words in commands:
        assert main(words) == 0
    assert "empty" not in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {
        "map.toml", "map.zarr", "portrait.png", "diagram.png",
    }  # fmt: skip


def test_each_of_the_two_commands_is_one_line_that_does_everything(readme):
    commands = re.findall(r"^python3 -m venv .*$", readme, re.MULTILINE)
    assert len(commands) == 2
    demo, tests = commands
    assert demo.endswith("phasekit demo")
    assert tests.endswith("pytest -n auto")
    assert all("pip install" in command for command in commands)


def test_files_that_the_readme_shows_are_there(readme):
    for target in re.findall(r"\]\(([^)#:]+)\)", readme):
        assert (ROOT / target).exists()


def test_the_version_is_one():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {pk.__version__}\n" in citation
    changelog = (ROOT / "docs" / "changelog.md").read_text(encoding="utf-8")
    assert f"## {pk.__version__}" in changelog


def test_the_reference_page_lists_every_public_name():
    listed = set(re.findall(r"\w+", (ROOT / "docs" / "api.md").read_text(encoding="utf-8")))
    assert set(pk.__all__) <= listed
