"""What follows from a scene's own numbers: how fast its water can get, and what methods make of that."""

from __future__ import annotations

import math
from typing import Any


def expected_speed(config: Any) -> float:
    """Fastest that this scene can make water or cloth [m/s]: as fluid.expected_speed says, or inflow, wind, moving
    solids and clips, and a fall through the whole domain.

    Tension draws back the thinnest film there can be, of one spacing, at sqrt(2 gamma/(rho dx)) (Culick 1960).
    """
    if config.fluid and config.fluid.expected_speed is not None:
        return config.fluid.expected_speed
    speeds = [emitter.speed for emitter in config.emitter.values()]
    speeds += [solid.path.top_speed for solid in config.solid.values() if solid.path]
    speeds += [math.hypot(*solid.slide) for solid in config.solid.values()]
    if config.cloth:
        speeds += [pin.path.top_speed for pin in config.cloth.pins.values() if pin.path]
        speeds += [math.hypot(*config.space.wind)] if config.space.wind else []
    if config.fluid:
        speeds += [math.hypot(*block.velocity) + block.vortices for block in config.fluid.block.values()]
        speeds += [math.hypot(*ball.velocity) for ball in config.fluid.ball.values()]
        if "surface_tension" in config.fluid.terms:
            liquid = config.fluid.liquid
            speeds.append(math.sqrt(2.0 * liquid.surface_tension / (liquid.rest_density * config.fluid.spacing)))
    gravity = math.sqrt(sum(g * g for g in config.space.gravity))
    if config.fluid:
        fall = config.space.high[2] - config.space.low[2]
    else:
        fall = max(config.cloth.size) + abs(config.cloth.centre[2])
    return math.sqrt(max(speeds, default=0.0) ** 2 + 2.0 * gravity * fall)


def filled_in(config: Any) -> Any:
    """The config with its expected speed, and with what its pressure method leaves to that (its `follow`)."""
    fluid = config.fluid
    if not fluid:
        return config
    fluid = fluid.model_copy(update={"expected_speed": expected_speed(config)})
    if hasattr(fluid.params, "follow"):
        fluid = fluid.model_copy(update={"params": fluid.params.follow(fluid)})
    return config.model_copy(update={"fluid": fluid})
