"""The way along a cycle, and how far states are from it."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.motion.method import whole_turns


class Way:
    """Many points along a cycle, between which chords are as good as the way."""

    def __init__(self, points: Array, turns: Array, units: Array) -> None:
        from scipy.spatial import cKDTree

        self.turns, self.units, self.low = turns / units, units, points.min(axis=0)
        self.points = self._inside(points)
        ahead = np.roll(self.points, -1, axis=0) - self.points
        self.along = ahead - whole_turns(ahead, self.turns)
        bend = np.linalg.norm(self.along - np.roll(self.along, 1, axis=0), axis=1)
        #: Greatest distance of the way from its chords.
        self.bulge = float(bend.max(initial=0.0)) / 8.0
        self.length = np.maximum((self.along**2).sum(axis=1), 1e-300)
        self.tree = cKDTree(self.points, boxsize=self.turns)

    def nearest(self, states: Array) -> Array:
        """Distances of states from the nearest points; infinite of NaN."""
        at = self._inside(states)
        good = np.isfinite(at).all(axis=1)
        found = np.full(len(at), np.inf)
        found[good] = self.tree.query(at[good])[0]
        return found

    def distance(self, states: Array) -> Array:
        """Distances of states from the chords next to the nearest point; infinite of NaN."""
        at = self._inside(states)
        good = np.isfinite(at).all(axis=1)
        found = np.full(len(at), np.inf)
        _, near = self.tree.query(at[good])
        best = found[good]
        for i in (near, near - 1):
            off = at[good] - self.points[i]
            off -= whole_turns(off, self.turns)
            part = np.clip((off * self.along[i]).sum(axis=1) / self.length[i], 0.0, 1.0)
            across = np.linalg.norm(off - part[:, None] * self.along[i], axis=1)
            best = np.minimum(best, across)
        found[good] = best
        return found

    def _inside(self, states: Array) -> Array:
        """States in units, angles within the first turn."""
        off = (states - self.low) / self.units
        turned = off - self.turns * np.floor(off / np.where(self.turns > 0.0, self.turns, 1.0))
        turned = np.where(turned < self.turns, turned, 0.0)
        return np.asarray(np.where(self.turns > 0.0, turned, off))
