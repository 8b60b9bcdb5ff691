"""How a sheet resists bending. The choice is built into the sheet: see sim.scene.cloth and sim.cloth.isometric."""

from sim.model import Model
from sim.registry import register


@register("cloth.bending", "flexion")
class Flexion:
    """Springs [i,j]-[i+2,j], [i,j]-[i,j+2]; energy ~ curvature^4: folds hold, gentle bends are free.   Provot 1995"""

    class Params(Model):
        """None: their stiffness follows from the fabric's bending stiffness and the mesh."""


@register("cloth.bending", "isometric")
class IsometricBending:
    """E = (B/2) sum a^2 (|dxx x|^2 + |dyy x|^2 + 2 |dxy x|^2): a plate's, at every mesh width.   Bergou et al. 2006"""

    class Params(Model):
        """None: B is the fabric's."""


@register("cloth.bending", "none")
class NoBending:
    """No resistance to bending at all."""

    class Params(Model):
        """None."""
