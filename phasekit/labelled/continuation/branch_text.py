"""What a branch is, in words and in a notebook."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

#: Special points that a branch shows at most.
SHOWN = 20


def text_of(branch: Any, notes: Sequence[str]) -> str:
    """What it is, its range, its special points and why it ends."""
    points = [repr(s) for s in branch.special_points if s.kind != "end"]
    more = [f"... {len(points) - SHOWN} more"] if len(points) > SHOWN else []
    return "\n  ".join([f"<{head_of(branch)}", *points[:SHOWN], *more, *notes]) + ">"


def html_of(branch: Any, notes: Sequence[str]) -> str:
    """The same, special points in a table."""
    points = branch.table()
    points = points[points.kind != "end"]
    rows = points.to_html(index=False, border=0, max_rows=SHOWN) if len(points) else ""
    lines = "".join(f"<div>{html.escape(note)}</div>" for note in notes)
    return f"<div><b>{html.escape(head_of(branch))}</b>{rows}{lines}</div>"


def head_of(branch: Any) -> str:
    """What its points are, how many there are, and where."""
    points = branch._points
    u = {name: points[name].values for name in (*branch.free, *branch._numbers)}
    ranges = ", ".join(f"{n} from {v.min():.6g} to {v.max():.6g}" for n, v in u.items())
    return f"Branch of {_followed(branch)}: {points.sizes['point']} points, {ranges}"


def _followed(branch: Any) -> str:
    held = getattr(branch.walker.curve, "held", None)
    if held is not None:
        return f"points of the event {held.name!r}"
    holds = " and ".join(one.name for one in getattr(branch.walker.curve, "holds", ()))
    with_held = f" with {holds}" if holds else ""
    words = {
        "equilibrium": "fixed points" if branch.problem.map else "equilibria",
        "cycle": "periodic orbits",
        "boundary": "solutions",
        "connection": "connections",
    }
    pairs = branch._points.get("kind_of_pair")
    names = set[str]() if pairs is None else set(map(str, pairs.values))
    beyond = sorted(names - {"", branch.kind})
    with_others = "".join(f" and {name} points" for name in beyond)
    return words.get(branch.kind, f"{branch.kind} points") + with_others + with_held
