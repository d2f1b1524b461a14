"""What the columns of a branch are called: names that states and records do not take."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from phasekit.labels.arguments import bad

#: What a branch says of its points, and of each special point as ``special_<name>``.
COLUMNS = (
    "kind", "n_unstable", "kind_of_pair", "arclength", "special", "tangent", "step", "residual",
    "newton_steps", "point", "unknown", "end", "special_point",
)  # fmt: skip
OF_SPECIAL = (
    "kind", "label", "status", "message", "name", "residual", "corank", "index", "interval",
    "point",
)  # fmt: skip


def check_names(names: Sequence[str]) -> None:
    """Refuse states and free parameters whose columns would stand for something else."""
    taken = {*columns(names), *OF_SPECIAL}
    for name in names:
        if name in taken:
            raise bad(
                "problem", name, "names of states and free parameters that are no columns",
                f"these are {', '.join(COLUMNS)}, and special_<name> of special points",
            )  # fmt: skip


def columns(names: Iterable[str]) -> set[str]:
    """What the columns of a branch are called, beside its own states and parameters."""
    return {*COLUMNS, *(f"special_{one}" for one in (*OF_SPECIAL, *names))}
