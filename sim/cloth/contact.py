"""Nodes of the sheet against the scene's solids: half a thickness away, Coulomb friction."""

import numpy as np
import taichi as ti
import taichi.math as tm

from sim.cloth.board import Board
from sim.maths.distance import box_distance, plane_distance, sphere_distance
from sim.scene.solids import Primitive

SHAPES = ("plane", "box", "sphere")


@ti.data_oriented
class SolidContact:
    """For each primitive: mark whether the sheet can reach it in this step, then correct nodes in each substep.

    Nodes only: between two of them an edge of a box may stand out by less than half a mesh width.
    """

    def __init__(self, primitives: tuple[Primitive, ...], thickness: float, board: Board):
        self.board, self.offset, self.count = board, 0.5 * thickness, len(primitives)
        size = max(self.count, 1)
        self.near, self.shape = ti.field(ti.i32, size), ti.field(ti.i32, size)
        self.a, self.b = ti.Vector.field(3, board.real, size), ti.Vector.field(3, board.real, size)
        self.friction = ti.field(board.real, size)
        if primitives:
            self.shape.from_numpy(np.array([SHAPES.index(p.shape) for p in primitives], np.int32))
            self.a.from_numpy(np.array([p.a for p in primitives], board.numpy_real))
            self.b.from_numpy(np.array([p.b for p in primitives], board.numpy_real))
            self.friction.from_numpy(np.array([p.friction for p in primitives], board.numpy_real))

    @ti.func
    def mark(self, low, high):
        """near[k] = the box low..high, where every node will stay during this step, reaches primitive k."""
        centre, half = 0.5 * (low + high), 0.5 * (high - low)
        for k in range(self.count):
            gap = self._at_least(k, centre)
            if self.shape[k] == 1:
                gap = (ti.abs(centre - self.a[k]) - half - self.b[k]).max()
            else:
                gap -= half.norm()
            self.near[k] = gap < self.offset

    @ti.func
    def project(self):
        """Push nodes out of every solid they can reach."""
        if ti.static(self.count > 0):
            for k in range(self.count):
                if self.near[k]:
                    for i in range(self.board.ni):
                        for j in range(self.board.nj):
                            at = i * self.board.pitch + j
                            if self._at_least(k, self.board.vector(self.board.x, at)) < self.offset:
                                self._push(k, at)

    @ti.func
    def _at_least(self, k, x):
        """A distance [m] that the true one does not fall below; exact for planes and spheres."""
        r = x - self.a[k]
        bound = (ti.abs(r) - self.b[k]).max()
        if self.shape[k] == 0:
            bound = r.dot(self.b[k])
        elif self.shape[k] == 2:
            bound = r.norm() - self.b[k][0]
        return bound

    @ti.func
    def _push(self, k, at):
        """Out along the normal, then back along the surface by at most friction times as much.

        Depth that was there at the substep's start is undone there too, so that it becomes no speed.
        """
        x, start = self.board.vector(self.board.x, at), self.board.vector(self.board.start, at)
        normal, distance = self._distance(k, x)
        depth = self.offset - distance
        if depth > 0.0 and self.board.w[at] > 0.0:
            _, before = self._distance(k, start)
            was = ti.min(ti.max(self.offset - before, 0.0), depth)
            start += was * normal
            x += depth * normal
            slide = (x - start) - (x - start).dot(normal) * normal
            hold = self.friction[k] * (depth - was)
            x -= slide * ti.min(1.0, hold / ti.max(slide.norm(), 1e-12))
            self.board.set_vector(self.board.x, at, x)
            self.board.set_vector(self.board.start, at, start)

    @ti.func
    def _distance(self, k, x):
        """(outward normal, signed distance [m])."""
        found = tm.vec4(0.0)
        if self.shape[k] == 0:
            found = plane_distance(x, self.a[k], self.b[k])
        elif self.shape[k] == 1:
            found = box_distance(x, self.a[k], self.b[k])
        else:
            found = sphere_distance(x, self.a[k], self.b[k][0])
        return found.xyz, found[3]
