"""A dam that breaks against a box, held against the arrivals and the pressure measured at MARIN."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.studies.case import Case, Point

GATE = 1.228
"""[m] from the reservoir's end."""
COLUMNS = {"first": (0.504, 0.218), "second": (1.000, 0.368), "third": (1.496, 0.920)}
"""Way from the gate [m], and when the water came there [s].   SPHERIC test 2, file of 2006"""
P1 = (2.3955, 0.4745, 0.021)
"""[m] The gauge on the box's front; its normal is -x."""
P1_RISE, P1_PEAK = 0.41, 10.11e3
"""[s] When the gauge rises; [Pa] its highest mean over 10 ms (its highest reading at 1 kHz is 11.24 kPa)."""
WINDOW = 0.01
"""[s] Over which pressure is meant."""
END = 1.1
"""[s] The last arrival, and 20 % more."""


def measure(world: Any) -> dict[str, float]:
    """Relative errors of three arrivals, of the gauge's rise and of its peak; the largest over its bound is `error`."""
    from sim.studies.water.gauge import Gauge, depth

    gauge, dx = Gauge(world), world.config.fluid.spacing
    times, impulses = [0.0], [0.0]
    arrived = dict.fromkeys(COLUMNS, np.inf)
    side = max(2.0 * dx, 0.05)
    while world.clock.time < END:
        before = world.clock.time
        world.step()
        x, force = gauge.read(world.clock.time - before)
        for name, (way, _) in COLUMNS.items():
            if depth(x, (GATE + way, 0.5), 2.0 * dx, dx) > 1.5 * dx:
                arrived[name] = min(arrived[name], world.clock.time)
        near = (
            (np.abs(x[:, 1] - P1[1]) < 0.5 * side)
            & (x[:, 2] < max(2.0 * P1[2], dx))
            & (np.abs(x[:, 0] - P1[0]) < 1.5 * dx)
        )
        impulses.append(force[near, 0].sum() * (world.clock.time - before))
        times.append(world.clock.time)
    rise, peak = _front(np.array(times), np.cumsum(impulses) / (side * max(2.0 * P1[2], dx)))
    return {
        **{name: arrived[name] / seen - 1.0 for name, (_, seen) in COLUMNS.items()},
        "rise": rise / P1_RISE - 1.0,
        "peak": peak / P1_PEAK - 1.0,
    }


def _front(times, impulse):
    centre = np.arange(0.2, times[-1] - WINDOW, 1e-3)
    mean = (np.interp(centre + WINDOW / 2, times, impulse) - np.interp(centre - WINDOW / 2, times, impulse)) / WINDOW
    return float(centre[np.argmax(mean > 0.5 * mean.max())]), float(mean.max())


if __name__ == "__main__":
    import sys

    sys.path.insert(0, ".")
    from tests.spawned import open_world

    w = open_world("dam_break_box", *sys.argv[1:])
    print(w.state.count[None], measure(w), w.clock.step, sum(w.seconds.values()), w.iterations)
