"""How water lies on cloth, for what rubs and for what wets."""

import math

TOUCH = 0.65
"""[dx] A particle nearer than this touches: it wets the sheet and feels its friction."""
THINNEST = 5e-4
"""[m] Film of a spreading jet; no puddle is taken as thinner, however well the cloth is wetted."""


def film_height(config, dx: float) -> float:
    """Height of the puddle that a touching particle stands for [m]: 2 l_c sin(theta/2) (de Gennes 1985), at most dx.

    What depends on how water lies on cloth, its friction and the area it wets, then does not depend on dx.
    """
    liquid, fabric = config.fluid.liquid, config.cloth.fabric
    gravity = math.sqrt(sum(g * g for g in config.space.gravity))
    capillary_length = math.sqrt(liquid.surface_tension / (liquid.rest_density * max(gravity, 1e-9)))
    return min(dx, max(2.0 * capillary_length * math.sin(0.5 * fabric.contact_angle), THINNEST))
