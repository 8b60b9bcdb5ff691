"""A dam that breaks against a box, held against the arrivals and the pressure measured at MARIN."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point

GATE = 1.228
"""[m] from the reservoir's end."""
COLUMNS = {"first": (0.504, 0.218), "second": (1.000, 0.368), "third": (1.496, 0.920)}
"""Way from the gate [m], and when water stands there [s].   Kleefsman et al. 2005; Issa & Violeau 2006"""
MIDDLE = 0.5
"""[m] y of the columns."""
FRONT, P1 = 2.3955, np.array([0.4745, 0.021])
"""[m] x of the box's front; y and z of the gauge on it."""
P1_RISE, P1_PEAK = 0.41, 10.11e3
"""[s] When the gauge rises; [Pa] its highest mean over 10 ms. Its highest reading, at 1 kHz, is 11.24 kPa."""
WINDOW = 0.01
"""[s] Over which pressure is meant."""
PATCH = (0.2, 0.042)
"""[m] Width and height of the wall that is read for the gauge, at least: half of the box, along which the pressure
hardly changes (a quarter of it reads 3 % more), and as high as lies evenly about the gauge."""
END = 1.3
"""[s] The last arrival, and 40 % more."""


def measure(world: Any) -> dict[str, float]:
    """Relative errors of three arrivals, of the gauge's rise and of its peak; `error`: their root mean square.

    Water has arrived where 1.5 spacings of it stand in a column 4 spacings wide.
    """
    from sim.studies.water.gauge import Gauge, depth, on_patch

    gauge, dx = Gauge(world), world.config.fluid.spacing
    patch = np.maximum(PATCH, (4.0 * dx, 2.0 * dx))
    centre = np.array([P1[0], max(P1[1], 0.5 * patch[1])])
    times, impulses = [0.0], [0.0]
    arrived = dict.fromkeys(COLUMNS, np.inf)
    while times[-1] < END:
        world.step()
        dt = world.clock.time - times[-1]
        x, force = gauge.read(dt)
        for name, (way, _) in COLUMNS.items():
            if depth(x, (GATE + way, MIDDLE), 4.0 * dx, dx) > 1.5 * dx:
                arrived[name] = min(arrived[name], world.clock.time)
        at = np.abs(x[:, 0] - FRONT) < 1.5 * dx
        impulses.append(dt * (force[at, 0] * on_patch(x[at, 1:], centre, patch, dx)).sum())
        times.append(world.clock.time)
    rise, peak = _rise_and_peak(np.array(times), np.cumsum(impulses) / patch.prod())
    errors = {name: arrived[name] / seen - 1.0 for name, (_, seen) in COLUMNS.items()}
    errors |= {"rise": rise / P1_RISE - 1.0, "peak": peak / P1_PEAK - 1.0}
    return {**errors, "error": float(np.sqrt(np.mean(np.square(list(errors.values())))))}


def _rise_and_peak(times: np.ndarray, impulse: np.ndarray) -> tuple[float, float]:
    """(when the mean over WINDOW passes half of its highest [s], its highest [Pa]); impulse [N s/m^2] so far."""
    middle = np.arange(0.5 * WINDOW, times[-1] - 0.5 * WINDOW, 1e-3)
    at_end, at_start = (np.interp(middle + s * 0.5 * WINDOW, times, impulse) for s in (1.0, -1.0))
    mean = (at_end - at_start) / WINDOW
    return float(middle[np.argmax(mean > 0.5 * mean.max())]), float(mean.max())


CASE = Case(
    name="dam_break_box",
    scene="dam_break_box",
    reference="SPHERIC test 2: Kleefsman et al. 2005; Issa & Violeau 2006",
    bounds={"first": 0.15, "second": 0.06, "third": 0.10, "rise": 0.06, "peak": 0.30},
    measure=measure,
    full=(Point(("fluid.spacing=0.016666666666666666",)),),
    quick=(
        Point(("fluid.spacing=0.05",), bounds={"first": 0.5, "second": 0.4, "third": 0.4, "rise": 0.2, "peak": 1.0}),
    ),
)
