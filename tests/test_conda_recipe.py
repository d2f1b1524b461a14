"""The recipe for conda asks for what pyproject.toml asks for."""

import re
import tomllib
from pathlib import Path

import phasekit as pk

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RECIPE = (ROOT / "recipe" / "meta.yaml").read_text(encoding="utf-8")
#: What a package is called there.
CONDA = {"matplotlib": "matplotlib-base"}


def bounds(lines):
    """Names and lowest versions of requirements."""
    found = dict(re.fullmatch(r"([\w.-]+) ?(?:>=([\w.]+))?", line).groups() for line in lines)
    assert len(found) == len(lines)
    return found


def listed(section):
    """The lines of a list of the recipe."""
    block = re.search(rf"^ +{section}:\n((?: +- .*\n)+)", RECIPE, re.M)[1]
    return [line.strip().removeprefix("- ") for line in block.splitlines()]


def test_bounds_are_those_of_the_project():
    project = PROJECT["project"]
    wanted = {CONDA.get(n, n): low for n, low in bounds(project["dependencies"]).items()}
    wanted["python"] = project["requires-python"].removeprefix(">=")
    assert bounds(listed("run")) == wanted
    host = bounds(listed("host"))
    build = bounds(PROJECT["build-system"]["requires"])
    assert host == {**build, "pip": None, "python": wanted["python"]}


def test_it_is_the_same_package():
    project = PROJECT["project"]
    assert f'version = "{pk.__version__}"' in RECIPE
    assert f"  name: {project['name']}\n" in RECIPE
    assert f"  license: {project['license']}\n" in RECIPE
    assert f"  summary: {project['description']}\n" in RECIPE
    assert listed("entry_points") == [f"phasekit = {project['scripts']['phasekit']}"]
    assert listed("imports") == ["phasekit"]
