"""The 2019 report's contact: water that changed sides of a patch's plane is sent back the way it came."""

import taichi as ti

from sim.coupling.catch import Catch
from sim.coupling.sheet import SheetGeometry
from sim.maths.facet import plane_crossing
from sim.model import Model
from sim.registry import register
from sim.search.boxes import overlap
from sim.stage import Build, Stage


@register("coupling.contact", "plane_reflect")
@ti.data_oriented
class PlaneReflect:
    """v' = v - 2 (v . n) n, x' = x before the step, where a near patch's plane was crossed; no momentum to the cloth.

    Higgins & Zhang 2019, the baseline. Near is a patch whose box, at least one thickness thick, holds the particle now
    (the report does not say which box it asked with; its cloth asked with a point). The first patch and triangle that
    answer decide. It leaks: each trajectory that crosses the moving sheet is counted, and none is undone.
    """

    class Params(Model):
        """None; the boxes are as thick as the fabric."""

    rows = ("fluid.x", "fluid.v", "fluid.mass", "cloth.x", "cloth.v", "cloth.inv_mass")
    scratch = ()
    conserves = ()
    narrow = staticmethod(plane_crossing)
    tight = False
    took_back = False

    def __init__(self, build: Build, params: "PlaneReflect.Params"):
        state = build.state
        self.count, self.x, self.v = state.count, state["fluid.x"], state["fluid.v"]
        self.thickness = build.scene.sheet.thickness
        self.sheet = SheetGeometry(build, build.config.fluid.support_radius)
        self.boxes = self.sheet.boxes
        self.low, self.high = (ti.Vector.field(3, float, shape=self.sheet.patch_count) for _ in range(2))
        unknown = ti.field(float, shape=state.sizes["fluid"])  # 0: everybody is asked
        self.catch = Catch(build, self.sheet, unknown)
        self.touched = self.catch.acts
        build.parts["contact"] = self

    def stages(self) -> tuple[Stage, ...]:
        """Remember where all stand; when all has moved, reflect."""
        return (
            Stage("contact.begin", "side", self._begin, reads=("fluid.x", "cloth.x")),
            Stage(
                "contact.reflect",
                "catch",
                self._run,
                reads=("fluid.x", "fluid.v", "cloth.x"),
                writes=("fluid.x", "fluid.v"),
            ),
        )

    def counts(self) -> dict[str, int]:
        """Totals so far: `leaks`, and how often it reflected."""
        return {"leaks": int(self.catch.leaks[None]), "caught": int(self.catch.acts[None])}

    def counters(self) -> dict:
        """0-D fields that a saved state keeps."""
        return {"acts": self.catch.acts, "leaks": self.catch.leaks}

    def _begin(self, dt: float) -> None:
        self.sheet.begin()
        self.catch.begin()

    def _run(self, dt: float) -> None:
        self._bound()
        self.boxes.build(self.low, self.high)
        self._reflect()
        self.sheet.sort()
        self.catch.find()
        self.catch.count_leaks()

    @ti.kernel
    def _bound(self):
        """Boxes of the patches as they stand, at least one thickness thick."""
        for p in range(self.sheet.patch_count):
            low, high = self.sheet.box(p)
            grown = ti.max(0.5 * (self.thickness - (high - low)), 0.0)
            self.low[p] = low - grown
            self.high[p] = high + grown

    @ti.kernel
    def _reflect(self):
        for i in range(self.count[None]):
            x0, x1 = self.catch.x0[i], self.x[i]
            found = 2 * self.sheet.patch_count
            walk = self.boxes.begin(x1, x1)
            while walk[0] < walk[1]:
                walk, first, last = self.boxes.next(walk, x1, x1)
                for s in range(first, last):
                    p = self.boxes.slots[s]
                    if overlap(x1, x1, self.low[p], self.high[p]):
                        for t in range(2 * p, 2 * p + 2):
                            a, b, c = self.sheet.points(t)
                            if t < found and plane_crossing(x0, x1, a, a, b, b, c, c, 0.0)[0] <= 1.0:
                                found = t
            if found < 2 * self.sheet.patch_count:
                n = self.sheet.face_normal(found)
                self.v[i] -= 2.0 * self.v[i].dot(n) * n
                self.x[i] = x0
                self.catch.acts[None] += 1
