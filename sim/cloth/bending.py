"""How a sheet resists bending. The choice is built into the sheet's springs: see sim.scene.cloth."""

from sim.model import Model
from sim.registry import register


@register("cloth.bending", "flexion")
class Flexion:
    """Springs [i,j]-[i+2,j], [i,j]-[i,j+2]; energy ~ curvature^4: folds hold, gentle bends are free.   Provot 1995"""

    class Params(Model):
        """None: their stiffness follows from the fabric's bending stiffness and the mesh."""


@register("cloth.bending", "none")
class NoBending:
    """No resistance to bending at all."""

    class Params(Model):
        """None."""
