"""Contact between water and cloth: sides before the step, the layer inside it, the last step after it."""

from sim.coupling.catch import SHORT, Catch
from sim.coupling.layer import Layer
from sim.coupling.sheet import SheetGeometry
from sim.coupling.sides import Sides
from sim.maths.ccd import first_hit
from sim.model import Model
from sim.registry import register
from sim.stage import Build, Stage


@register("coupling.contact", "ccd")
class Contact:
    """Water rests on, slides along and never crosses the sheet.   shared model: see sim.coupling.layer and .catch

    parts left for others: "contact" (this; .sheet, .sides, .layer, .catch, .took_back), a guest for the cloth solver.
    """

    class Params(Model):
        """No constants of its own: restitution and friction stand in [coupling]."""

    rows = (
        "fluid.x", "fluid.v", "fluid.mass", "fluid.id", "fluid.acceleration", "fluid.pressure_acceleration",
        "fluid.expected_pull", "fluid.triangle", "fluid.side", "cloth.x", "cloth.v", "cloth.inv_mass",
        "cloth.push_front", "cloth.push_back",
    )  # fmt: skip
    scratch = ()
    conserves = ("momentum",)
    narrow = staticmethod(first_hit)
    tight = True
    short = SHORT

    def __init__(self, build: Build, params: "Contact.Params"):
        config = build.config
        reach = config.fluid.support * config.fluid.spacing
        self.sheet = SheetGeometry(build, reach)
        self.sides = Sides(build, self.sheet, reach)
        self.layer = Layer(build, self.sheet)
        self.catch = Catch(build, self.sheet, self.sides.gap)
        self.touched, self.took_back = self.layer.touched, False
        build.parts["contact"] = self
        build.parts.setdefault("guests", []).append(self.layer)

    def stages(self) -> tuple[Stage, ...]:
        """Side and catch; the layer moves inside the cloth's own stage."""
        return (
            Stage(
                "contact.sides",
                "side",
                self._begin,
                reads=("fluid.x", "fluid.v", "fluid.id", "cloth.x", "cloth.v"),
                writes=("fluid.triangle", "fluid.side"),
            ),
            Stage(
                "contact.catch",
                "catch",
                self._end,
                reads=("fluid.x", "fluid.v", "fluid.mass", "cloth.x", "cloth.v", "cloth.inv_mass"),
                writes=("fluid.x", "fluid.v", "cloth.x", "cloth.v"),
            ),
        )

    def _begin(self, dt: float) -> None:
        self.sides.run(dt)
        self.catch.begin()

    def _end(self, dt: float) -> None:
        self.took_back = self.catch.run(dt)

    def counts(self) -> dict[str, int]:
        """Totals so far: `leaks`, how often the last step acted, steps that it took back, particles that it tied."""
        return {name: int(field[None]) for name, field in self.catch.totals().items()}

    def counters(self) -> dict:
        """0-D fields that a saved state keeps."""
        return {**self.catch.totals(), "touched": self.touched}
