"""The registry of special points: whatever an engine finds has its entry."""

import ast
from pathlib import Path

import numpy as np
import pytest

import phasekit
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special
from phasekit.bifurcation.special_points import KINDS
from phasekit.plot.parts.style import POINTS_OF

#: Where special points are made, and by which calls.
FOLDER = Path(phasekit.__file__).parent / "bifurcation"


def made() -> set[str]:
    """Kinds that the sources name where they make a special point."""
    names = set()
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Special":
                names |= {
                    leaf.value
                    for leaf in ast.walk(node.args[0])
                    if isinstance(leaf, ast.Constant) and isinstance(leaf.value, str)
                }
    return names


def test_all_kinds_that_are_made_are_registered():
    names = made()
    assert {"fold", "hopf", "branch_point", "bogdanov_takens"} <= names
    assert names <= set(KINDS)


def test_a_kind_that_is_not_registered_cannot_be():
    with pytest.raises(ValueError, match="no special point is a 'fald'"):
        Special("fald", np.zeros(2), (0.0, 1.0), 0.0, CONVERGED)


def test_every_kind_but_ends_has_its_own_look():
    looks = [(look["marker"], look["markerfacecolor"]) for look in POINTS_OF.values()]
    assert set(POINTS_OF) == set(KINDS) - {"end"}
    assert len(set(looks)) == len(looks) >= 11
