"""Branches of formulas that are proved: one curve between neighbouring points, special points.

What is proved holds for the formulas and the doubles that stand for parameters, exactly. Between
neighbouring points tubes hold one curve and no other zero (`phasekit.numerics.intervals.tubes`);
where a tube fails it is tried in halves (`tube_chains`). Special points are boxes that hold exactly
one solution of the equations that define them (`enclosed_points`), branch points where formulas
split them (`proved_crossings`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.bifurcation.continuation.enclosed_points import (
    CROSSINGS,
    Enclosure,
    Equations,
    Mark,
    enclosures_of,
)
from phasekit.bifurcation.continuation.proved_crossings import passed
from phasekit.numerics.intervals.krawczyk import UNIT
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.intervals.tube_chains import Chain, chain_of
from phasekit.numerics.intervals.tubes import FRAME, tubes_about
from phasekit.numerics.intervals.zeros import System


class Certificate(NamedTuple):
    """What is proved of a branch."""

    #: Shape (points - 1,): whether one curve goes from each point to the next, and no other passes
    #: its tube; where formulas split, no other of the same part.
    stretches: Flags
    reasons: list[str]  # why not, in words
    #: Shape (points - 1, unknowns): how far the curve may be from the chords of the stretch; NaN
    #: where nothing is known.
    radius: Array
    #: Shape (points, unknowns): how far each point may be from the curve; NaN where nothing is
    #: known.
    errors: Array
    specials: list[Enclosure]


def certificate(
    equations: Equations, points: Array, scale: Array, marks: Sequence[Mark]
) -> Certificate:
    """What is proved of a branch through some points.

    points shape (points, states + 1): states and parameter in order along the branch, special
    points among them; scale shape (states + 1,): their sizes.
    """
    units: Array = np.exp2(np.round(np.log2(scale))).astype(float)
    unknowns = (*equations.states, equations.parameter)
    values = {s: v for s, v in equations.values.items() if s != equations.parameter}
    system = System(equations.zero(), unknowns, values, units)
    crossings = {mark.place: mark.kind for mark in marks if mark.kind in CROSSINGS}
    chain = chain_of(system, points / units)
    proofs = {}
    for place in crossings:
        chain, proofs[place] = passed(equations, system, chain, points, place, crossings)
    leaves = chain.tubes
    stretches, reasons = _stretches(chain, points, units, crossings)
    radius = np.full((len(points) - 1, len(units)), np.nan)
    sizes = np.einsum("kij,kj->ki", np.abs(leaves.across), leaves.radius) * (1.0 + FRAME) * units
    for k in np.intersect1d(np.flatnonzero(stretches), chain.owner):
        radius[k] = np.max(sizes[chain.owner == k], axis=0)
    errors = _errors(system, chain, len(points), units)
    specials = enclosures_of(equations, chain, marks, errors, units)
    for i, mark in enumerate(marks):
        proved = proofs.get(mark.place)
        if proved is not None and mark.kind in CROSSINGS:
            specials[i] = proved
    return Certificate(stretches, reasons, radius, errors, specials)


def _stretches(
    chain: Chain, points: Array, units: Array, crossings: Mapping[int, str]
) -> tuple[Flags, list[str]]:
    """Which stretches are proved, and why others are not."""
    count = len(points) - 1
    proved, owner = chain.tubes.proved, chain.owner
    owned = np.isin(np.arange(count), owner)
    stretches, reasons = owned.copy(), [""] * count
    for k in np.unique(owner[~proved]):
        stretches[k] = False
        open_ = (owner == k) & ~proved
        ends = chain.tubes.middle[open_, -1, None] + 0.5 * chain.tubes.chord[open_, -1:] * [-1, 1]
        where = f"between {ends.min() * units[-1]:.9g} and {ends.max() * units[-1]:.9g}"
        kinds = [crossings[i] for i in (k, k + 1) if i in crossings]
        if kinds:
            what = kinds[0].replace("_", " ")
            reasons[k] = f"{where}: branches meet in the {what}, which no tube passes"
        elif not chain.tubes.defined[open_].all():
            reasons[k] = f"{where}: f or a derivative may have a pole or be undefined"
        else:
            reasons[k] = (
                f"{where}: other branches may be nearer than intervals can tell, or derivatives "
                "vanish together"
            )
    # Points that are the same but for rounding are on the curve of the stretch before them, or of
    # the first one of all, as far as that is proved.
    places = np.flatnonzero(owned)
    for k in np.flatnonzero(~owned):
        if places.size:
            near = places[max(int(np.searchsorted(places, k)) - 1, 0)]
            stretches[k], reasons[k] = stretches[near], reasons[near]
        else:
            reasons[k] = "all points are the same but for rounding: no tube is about a point"
    return stretches, reasons


def _errors(system: System, chain: Chain, count: int, units: Array) -> Array:
    """How far points may be from the curve, in planes across the chords that end there."""
    errors = np.full((count, len(units)), np.nan)
    tubes, owner = chain.tubes, chain.owner
    last = np.append(owner[1:] != owner[:-1], True) & tubes.proved
    size = np.einsum("kij,kj->ki", np.abs(tubes.across), tubes.tip) * (1.0 + FRAME) * units
    errors[owner[last] + 1] = size[last]
    first = np.append(True, owner[1:] != owner[:-1]) & tubes.proved
    first[first] = np.isnan(errors[owner[first], 0])
    if first.any():
        there = tubes.rows(first)
        back = tubes_about(system, there.end, there.end - there.chord)
        size = np.einsum("kij,kj->ki", np.abs(back.across), back.tip) * (1.0 + FRAME) * units
        size += 2.0 * UNIT * (np.abs(there.end) + np.abs(there.chord)) * units
        same = back.proved & there.hold(back.end, back.across, back.tip)
        errors[owner[first]] = np.where(same[:, None], size, np.nan)
    return errors


def missing_rule(equations: Equations) -> str | None:
    """The name of a function of which no bounds are known."""
    try:
        System(equations.zero(), (*equations.states, equations.parameter), dict(equations.values))
    except NoRule as missing:
        return str(missing)
    return None
