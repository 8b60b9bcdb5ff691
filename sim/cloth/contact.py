"""Nodes of the sheet against the scene's solids: half a thickness away, Coulomb friction."""

import taichi as ti
import taichi.math as tm

from sim.cloth.board import Board
from sim.maths.distance import box_distance, plane_distance, sphere_distance
from sim.scene.solids import Primitive


@ti.data_oriented
class SolidContact:
    """For each primitive: mark whether the sheet can reach it in this step, then correct nodes in each substep."""

    def __init__(self, primitives: tuple[Primitive, ...], thickness: float, board: Board):
        self.primitives, self.board = primitives, board
        self.offset = 0.5 * thickness
        self.near = ti.field(ti.i32, max(len(primitives), 1))

    @ti.func
    def mark(self, low, high):
        """near[k] = the box low..high, where every node will stay during this step, reaches primitive k."""
        centre, half = 0.5 * (low + high), 0.5 * (high - low) + self.offset
        for k in ti.static(range(len(self.primitives))):
            primitive = ti.static(self.primitives[k])
            a, b = tm.vec3(primitive.a), tm.vec3(primitive.b)
            gap = 0.0
            if ti.static(primitive.shape == "plane"):
                gap = (centre - a).dot(b) - half.dot(ti.abs(b))
            elif ti.static(primitive.shape == "box"):
                gap = (ti.abs(centre - a) - half - b).max()
            else:
                gap = ti.max(ti.abs(centre - a) - half, 0.0).norm() - b[0]
            self.near[k] = gap < 0.0

    @ti.func
    def project(self):
        """Push nodes out of every solid they can reach."""
        for k in ti.static(range(len(self.primitives))):
            if self.near[k]:
                for i in range(self.board.ni):
                    for j in range(self.board.nj):
                        self._push(k, i * self.board.pitch + j)

    @ti.func
    def _push(self, k: ti.template(), at):
        """Out along the normal, then back along the surface by at most friction times as much.

        Depth that was there at the substep's start is undone there too, so that it becomes no speed.
        """
        x = self.board.vector(self.board.x, at)
        normal_distance = self._distance(k, x)
        depth = self.offset - normal_distance[3]
        if depth > 0.0 and self.board.w[at] > 0.0:
            normal = normal_distance.xyz
            start = self.board.vector(self.board.start, at)
            was = ti.min(ti.max(self.offset - self._distance(k, start)[3], 0.0), depth)
            start += was * normal
            x += depth * normal
            slide = (x - start) - (x - start).dot(normal) * normal
            length = slide.norm()
            hold = ti.static(self.primitives[k].friction) * (depth - was)
            if length > 0.0:
                x -= slide * ti.min(1.0, hold / length)
            self.board.set_vector(self.board.x, at, x)
            self.board.set_vector(self.board.start, at, start)

    @ti.func
    def _distance(self, k: ti.template(), x):
        primitive = ti.static(self.primitives[k])
        a, b = tm.vec3(primitive.a), tm.vec3(primitive.b)
        found = tm.vec4(0.0)
        if ti.static(primitive.shape == "plane"):
            found = plane_distance(x, a, b)
        elif ti.static(primitive.shape == "box"):
            found = box_distance(x, a, b)
        else:
            found = sphere_distance(x, a, b[0])
        return found
