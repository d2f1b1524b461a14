"""The demos of AUTO-07p print what is found here."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from published.auto_demos import DEMOS
from witnesses.variants import some


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", some(sorted(DEMOS), 3))
def test_values_are_those_of_auto(name: str) -> None:
    demo = DEMOS[name]
    for what, printed, found in demo.run():
        fine = any(float(f"{one:.7g}") != one for one in np.ravel(printed))
        within = 3e-9 if fine else demo.within
        np.testing.assert_allclose(found, printed, rtol=within, atol=within / 10, err_msg=what)


def test_table_has_all_demos_once() -> None:
    page = (Path(__file__).parents[2] / "docs" / "auto_demos.md").read_text()
    rows = re.findall(r"^\| (\w+) \| (.*?) \| (.*?) \|", page, re.M)
    named = [name for name, _, _ in rows if name not in ("demo",)]
    assert len(named) == len(set(named)) == 72
    assert set(DEMOS) <= set(named)
