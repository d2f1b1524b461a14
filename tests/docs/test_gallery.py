"""The gallery's systems run as they stand, and each shows the value that its text says.

Where ``PHASEKIT_SITE`` names a built site, for which they ran, what it shows is held against the
same values.
"""

import ast
import html
import os
import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

matplotlib.use("Agg")
PAGE = Path(__file__).parents[2] / "docs" / "notebooks" / "twenty_systems.md"
SECTIONS = PAGE.read_text(encoding="utf-8").split("\n## ")
SITE = os.environ.get("PHASEKIT_SITE")
SHOWN = re.compile(r'class="output text_plain[^"]*">(.*?)</pre>', re.DOTALL)
CELL = re.compile(r"^```\{code-cell\} python\n(.*?)^```", re.MULTILINE | re.DOTALL)

#: What is known of each system, and within which error of it.
FACTS = {
    "Three normal forms": ([0.0, 0.0, 0.0], 1e-6),
    "Pendulum": (1.1803405990, 1e-9),
    "Van der Pol's oscillator": (6.66328685932, 1e-7),
    "Duffing's oscillator": (-0.3, 1e-6),
    "Lorenz's system": (10 * (10 + 8 / 3 + 3) / (10 - 8 / 3 - 1), 1e-8),
    "Rössler's system": (0.0714, 0.003),
    "FitzHugh and Nagumo's neuron": (
        (0.7 - np.sqrt(0.936)) / 0.8 + np.sqrt(0.936) - 0.936**1.5 / 3,
        1e-8,
    ),
    "Morris and Lecar's neuron": (93.86, 0.005),
    "Hodgkin and Huxley's axon": ([9.78, 154.5], 0.05),
    "Predators that are sated": (3.0, 1e-8),
    "Brusselator": (2.0, 1e-8),
    "Sel'kov's glycolysis": ([np.sqrt(0.12), np.sqrt(0.72)], 1e-8),
    "Class-B laser": (np.sqrt(0.02 - 0.015**2), 1e-8),
    "Josephson junction": (0.5 / 0.2 - 0.2**3 / (2 * 0.5**3), 0.003),
    "Stoner and Wohlfarth's magnet": (0.5, 1e-8),
    "Bead on a hoop": (1.0, 1e-8),
    "Rotor with a skew disk": ([1.0, 1.0], 1e-12),
    "Hénon's map": ([0.4192, np.log(0.3) - 0.4192], 0.002),
    "Logistic map": (np.log(2), 0.002),
    "Cusp": ([-2 / np.sqrt(27), 2 / np.sqrt(27)], 1e-8),
}


def run(title: str, source: str) -> object:
    """What the last line of a cell shows."""
    names = {"__name__": "example"}
    exec(CELL.search(SECTIONS[0]).group(1), names)
    tree = ast.parse(source)
    last = ast.Expression(tree.body.pop().value)
    exec(compile(tree, title, "exec"), names)
    return eval(compile(last, title, "eval"), names)


def shown_on(site: str) -> list[object]:
    """What the last lines of the cells have shown on a built site, one a system."""
    page = Path(site, "notebooks", PAGE.with_suffix(".html").name).read_text(encoding="utf-8")
    texts = [html.unescape(re.sub(r"<[^>]+>", "", text)) for text in SHOWN.findall(page)]
    assert len(texts) == len(FACTS)
    return [eval(text, {"np": np, "array": np.array}) for text in texts]


def test_each_system_is_short_and_has_a_fact():
    assert [section.splitlines()[0] for section in SECTIONS[1:]] == list(FACTS)
    assert all(len(CELL.search(section).group(1).splitlines()) <= 20 for section in SECTIONS[1:])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("place", range(len(FACTS)), ids=list(FACTS))
def test_a_system_shows_what_is_known_of_it(place):
    title = list(FACTS)[place]
    value, error = FACTS[title]
    if SITE is None:
        shown = run(title, CELL.search(SECTIONS[1 + place]).group(1))
        plt.close("all")
    else:
        shown = shown_on(SITE)[place]
    np.testing.assert_allclose(
        np.sort(np.ravel(shown)), np.sort(np.ravel(value)), rtol=0, atol=error
    )
