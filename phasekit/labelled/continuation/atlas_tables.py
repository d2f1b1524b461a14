"""An atlas in rows: its curves, its special points, its regions."""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from phasekit.labelled.continuation.atlas_cycles import KINDS_OF_CYCLES, called, ranges_of
from phasekit.labelled.continuation.branch_points import SHOWN

if TYPE_CHECKING:
    import pandas as pd

#: Numbers of a region, in this order in its rows.
NUMBERS = ("n_equilibria", "n_stable", "n_cycles")


def tables_of(atlas: Any) -> dict[str, pd.DataFrame]:
    """The tables of an atlas by their names."""
    return {
        "special_points": point_table(atlas),
        "curves": curve_table(atlas),
        "regions": region_table(atlas),
    }


def point_table(atlas: Any) -> pd.DataFrame:
    """The points of codimension two, a row each."""
    import pandas as pd

    points = atlas.special_points
    columns = {"label": [p.label for p in points], "kind": [p.kind for p in points]}
    names = (*atlas.names, *atlas.problem.state)
    return pd.DataFrame(columns | {name: [p[name] for p in points] for name in names})


def curve_table(atlas: Any) -> pd.DataFrame:
    """The curves, a row each: what they are, where they begin and end, and their ranges."""
    import pandas as pd

    curves = atlas.curves
    ends = [atlas._named(curve) for curve in curves]
    columns: dict[str, Any] = {
        "kind": [called(curve) for curve in curves],
        "begins": [begin for begin, _ in ends],
        "ends": [end for _, end in ends],
        "points": [ranges_of(curve).sizes["point"] for curve in curves],
    }
    for name in atlas.names:
        for which in ("min", "max"):
            column = [float(getattr(ranges_of(curve)[name], which)()) for curve in curves]
            columns[f"{name}_{which}"] = column
    return pd.DataFrame(columns)


def region_table(atlas: Any) -> pd.DataFrame:
    """The numbers of equilibria that there are, a row each; numbers that are not known are NA."""
    import pandas as pd

    found, names = atlas._regions, atlas.names
    numbers = np.stack([found.n_equilibria, found.n_stable, atlas._n_cycles], axis=1)
    area = np.bincount(found.region[found.region >= 0], minlength=len(found.place))
    rows = []
    for row in sorted({tuple(row) for row in numbers.tolist()}):
        (own,) = np.nonzero((numbers == row).all(axis=1))
        widest = own[np.argmax(found.reach[own])]
        share = area[own].sum() / found.region.size
        rows.append([*row, len(own), share, *found.place[widest].tolist()])
    table = pd.DataFrame(rows, columns=[*NUMBERS, "regions", "share", *names])
    for name in NUMBERS:
        table[name] = table[name].astype("Int64").mask(table[name] < 0)
    return table if (atlas._n_cycles >= 0).any() else table.drop(columns="n_cycles")


def region_lines(atlas: Any) -> list[str]:
    """The same in sentences."""
    lines = []
    for row in region_table(atlas).astype(object).to_dict("records"):
        count, cycles = row["regions"], _number(row, "n_cycles")
        more = "" if cycles is None else f", {cycles} cycle{'s'[: cycles != 1]}"
        lines.append(
            f"{_at_rest(row)}{more}: {count} region{'s'[: count != 1]}, "
            f"{row['share']:.1%} of the plane"
        )
    return lines


def narrow_lines(atlas: Any) -> list[str]:
    """The regions that are narrower than a cell, in sentences."""
    lines = []
    for row in atlas.narrow_regions:
        place = ", ".join(f"{name}={row[name]:.9g}" for name in atlas.names)
        lines.append(f"{_at_rest(row)}: narrower than a cell, as at {place}")
    return lines


def _at_rest(row: Mapping[str, Any]) -> str:
    number, stable = _number(row, "n_equilibria"), _number(row, "n_stable")
    return (
        f"{'an unclear number of' if number is None else number} "
        f"equilibri{'um' if number == 1 else 'a'}, "
        f"{'an unclear number' if stable is None else stable} stable"
    )


def _number(row: Mapping[str, Any], name: str) -> int | None:
    """A number of a row, None where it is not known."""
    found = row.get(name)
    return found if isinstance(found, int) else None


def text_of(atlas: Any) -> str:
    """An atlas in lines: its curves, points and regions, and what is proved."""
    lines = [f"<{_head(atlas)}", *map(repr, atlas.special_points)]
    lines += [
        f"{called(curve)} curve: from {' to '.join(atlas._named(curve, where=True))}"
        for curve in atlas.curves if curve.kind in KINDS_OF_CYCLES
    ]  # fmt: skip
    lines += [*region_lines(atlas), *narrow_lines(atlas), *_notes(atlas)]
    return "\n  ".join(lines) + ">"


def html_of(atlas: Any) -> str:
    """The same for a notebook, in tables."""
    parts = [f"<b>{html.escape(_head(atlas))}</b>"]
    for name, table in tables_of(atlas).items():
        if len(table):
            rows = table.to_html(
                index=False, border=0, max_rows=SHOWN, float_format="{:.6g}".format
            )
            parts.append(f"<div>{name.replace('_', ' ')}</div>{rows}")
    parts += [f"<div>{html.escape(line)}</div>" for line in (*narrow_lines(atlas), *_notes(atlas))]
    return f"<div>{''.join(parts)}</div>"


def _head(atlas: Any) -> str:
    """Its ranges, and how many curves of which kind."""
    ranges = ", ".join(f"{n} from {a:.6g} to {b:.6g}" for n, (a, b) in atlas.span.items())
    kinds = list(map(called, atlas.curves))
    numbers = [f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)]
    return f"Atlas: {ranges}; curves: {', '.join(numbers) or 'none'}"


def _notes(atlas: Any) -> list[str]:
    """What is proved, and what was not found or followed."""
    proved = ", ".join(name for name, sure in atlas.complete.items() if sure)
    notes = [f"proved off the curves: {proved or 'nothing'}", *atlas.messages]
    return notes + [f"not followed: {one}" for one in atlas.not_followed]
