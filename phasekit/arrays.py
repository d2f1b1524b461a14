"""Types of arrays, by what they hold."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Index = npt.NDArray[np.int64]
#: What numpy's searches and sorts return.
Ints = npt.NDArray[np.intp]
Complex = npt.NDArray[np.complex128]
Codes = npt.NDArray[np.int8]
