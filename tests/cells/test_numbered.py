"""What is said of values that could not be computed."""

import warnings
from typing import NamedTuple

import numpy as np

from phasekit.cells.numbered import _told

NAN = np.nan


class Found(NamedTuple):
    period: np.ndarray
    action: np.ndarray
    period_error: np.ndarray
    action_error: np.ndarray


class Pass:
    def resolved(self, *arrays):
        return Found(*map(np.array, arrays))


def test_actions_that_are_not_known_are_told():
    with warnings.catch_warnings(record=True, action="always") as caught:
        _told(Pass(), "V", [1.0, NAN, NAN], [NAN, NAN, NAN], [0.0, 0.1, NAN], [0.2, 0.3, NAN])
    said = [str(warning.message) for warning in caught]
    assert len(said) == 2
    assert (
        said[0] == "period of V: 1 of 3 values are NaN, because their error may be as large as 0.1"
    )
    assert said[1].endswith("their error may be as large as 0.2")
