"""Regions of a plane on a grid: connected parts, and how far inside each cell lies."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def components(codes: npt.NDArray[np.int_]) -> npt.NDArray[np.int_]:
    """Number the connected parts of equal codes: each cell by the greatest index of its part."""
    labels = np.arange(codes.size).reshape(codes.shape)
    along = codes[1:] == codes[:-1], codes[:, 1:] == codes[:, :-1]
    while True:
        before = labels.copy()
        for axis, same in enumerate(along):
            view, joined = (labels, same) if axis == 0 else (labels.T, same.T)
            # One sweep each way carries a label to the end of its column.
            for k in (*range(1, len(view)), *range(-2, -len(view) - 1, -1)):
                other = k - 1 if k > 0 else k + 1
                link = joined[k - 1] if k > 0 else joined[k + 1]
                view[k] = np.where(link, np.maximum(view[k], view[other]), view[k])
        if np.array_equal(before, labels):
            return labels


def depths(labels: npt.NDArray[np.int_], clear: npt.NDArray[np.bool_]) -> npt.NDArray[np.int_]:
    """Number of cells from each cell to the next one that is not clear or of another part."""
    alive = np.zeros(np.add(labels.shape, 2), bool)
    alive[1:-1, 1:-1] = clear
    alive[1:-2, 1:-1] &= labels[1:] == labels[:-1]
    alive[1:-1, 1:-2] &= labels[:, 1:] == labels[:, :-1]
    depth = alive.astype(int)
    while alive.any():
        alive[1:-1, 1:-1] &= alive[:-2, 1:-1] & alive[2:, 1:-1] & alive[1:-1, :-2] & alive[1:-1, 2:]
        depth += alive
    return depth[1:-1, 1:-1]
