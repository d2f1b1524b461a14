"""The examples on the pages run as they stand, one after the other, as a reader types them.

Notebooks run when the site is built, the examples of the contributing guide in
tests/test_contributing.py, recipes in tests/test_recipes.py.
"""

import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

matplotlib.use("Agg")
DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
PAGES = [
    path.name
    for path in sorted(DOCS.glob("*.md"))
    if path.name not in ("contributing.md", "recipes.md")
    and BLOCK.search(path.read_text(encoding="utf-8"))
]
#: Sizes that take long, and what they are here.
SMALLER = {
    "10_001": "101", "10_000": "200", "few = pk.ContinuationOptions(max_points=30)":
    "few = pk.ContinuationOptions(max_points=3)", "n = 20\n": "n = 10\n", "n = 40\n": "n = 10\n",
    "max_points=250": "max_points=25", "4, 201": "4, 101",
    "20, 13": "20, 5", "3.5, 11": "3.5, 3",
    'switch("fold_of_cycles")':  # tests/labelled/test_cycle_canards.py follows it to its end
    'switch("fold_of_cycles", options=pk.ContinuationOptions(max_points=5))',
}  # fmt: skip


def test_there_are_pages_with_examples():
    assert {"index.md", "continuation.md", "large_maps.md"} <= set(PAGES)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", PAGES)
def test_the_examples_of_a_page_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "example"}
    for number, block in enumerate(BLOCK.findall((DOCS / name).read_text(encoding="utf-8"))):
        for size, less in SMALLER.items():
            block = block.replace(size, less)
        exec(compile(block, f"{name}, example {number + 1}", "exec"), names)
    plt.close("all")
