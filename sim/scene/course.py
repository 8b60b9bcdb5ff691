"""A path as a function of time: smooth through its entries, at rest before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

LOOKS = 33
"""Moments of a stretch between two entries at which its speed is looked at: cubic, so none is far between them."""


class Course:
    """place(t) = (shift (3,) [m], angle [rad]), by monotone cubic Hermite splines: never beyond the entries, velocity
    continuous, zero at an entry where it turns back.   Fritsch & Butland 1984
    """

    def __init__(self, path: Any):
        self.times = np.array(path.times)
        still = np.zeros((len(self.times), 4))
        if path.shift is not None:
            still[:, :3] = path.shift
        if path.angle is not None:
            still[:, 3] = path.angle
        self.values, self.repeat = still, path.repeat
        self.slopes = _slopes(self.times, still, path.repeat)
        self.axis = np.array(path.axis) / np.linalg.norm(path.axis)

    def place(self, t: float) -> tuple[np.ndarray, float]:
        """(shift, angle) at time t [s]."""
        first, last = self.times[0], self.times[-1]
        turns = 0.0
        if self.repeat and t > last:
            rounds, t = divmod(t - first, last - first)
            turns, t = rounds * (self.values[-1, 3] - self.values[0, 3]), t + first
        k = int(np.clip(np.searchsorted(self.times, t) - 1, 0, len(self.times) - 2))
        h = self.times[k + 1] - self.times[k]
        s = min(max((t - self.times[k]) / h, 0.0), 1.0)
        left, right = self.values[k], self.values[k + 1]
        bend = s * (1.0 - s) * ((1.0 - s) * (h * self.slopes[k]) - s * (h * self.slopes[k + 1]))
        at = left + s * s * (3.0 - 2.0 * s) * (right - left) + bend
        return at[:3], float(at[3] + turns)

    def top_speed(self, begin: float, end: float, arm: float) -> float:
        """Fastest that a point `arm` [m] from the axis moves between two times [m/s]."""
        t = np.linspace(begin, end, LOOKS)
        at = np.array([np.append(*self.place(a)) for a in t])
        rate = np.diff(at, axis=0) / np.diff(t)[:, None]
        return float((np.linalg.norm(rate[:, :3], axis=1) + arm * np.abs(rate[:, 3])).max())

    def fastest(self, arm: float) -> float:
        """The same over all of the path [m/s]."""
        return max(self.top_speed(a, b, arm) for a, b in zip(self.times, self.times[1:]))


def _slopes(times: np.ndarray, values: np.ndarray, repeat: bool) -> np.ndarray:
    """At each entry the weighted harmonic mean of the slopes beside it, 0 where they differ in sign."""
    step = np.diff(times)
    rise = np.diff(values, axis=0) / step[:, None]
    slopes = np.zeros_like(values)
    for k in range(1, len(step)):
        slopes[k] = _mean(rise[k - 1], rise[k], step[k - 1], step[k])
    if repeat:
        slopes[0] = slopes[-1] = _mean(rise[-1], rise[0], step[-1], step[0])
    return slopes


def _mean(a: np.ndarray, b: np.ndarray, before: float, after: float) -> np.ndarray:
    same = a * b > 0.0
    w, v = 2.0 * after + before, after + 2.0 * before
    return np.where(same, (w + v) * a * b / np.where(same, w * b + v * a, 1.0), 0.0)
