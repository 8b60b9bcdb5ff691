"""The sheet against the scene's solids: half a thickness away, Coulomb friction."""

import taichi as ti

from sim.bodies import PLANE, Bodies
from sim.cloth.board import Board


@ti.data_oriented
class SolidContact:
    """For each primitive: mark whether the sheet can reach it in this step, then correct nodes in each substep.

    touch[place], if remembered: normal of the solid that pushed a node in this substep, else 0.

    Nodes, and the middles of their links but on planes, so that a rim does not stand out between two of them by more
    than an eighth of a mesh width. The distance to a
    solid that moves is taken where it was at the step's start, less the way that it came since.
    """

    def __init__(self, bodies: Bodies, thickness: float, board: Board, spacing: float, remember: bool = False):
        self.half_patch = 0.75 * spacing
        self.bodies, self.board, self.offset, self.remember = bodies, board, 0.5 * thickness, remember
        self.near = ti.field(ti.i32, max(bodies.count, 1))
        if remember:
            self.touch = ti.Vector.field(3, board.real, board.half)

    @ti.func
    def mark(self, low, high, dt):
        """near[k] = the box low..high, where every node will stay during this step of dt, reaches primitive k."""
        centre, half = 0.5 * (low + high), 0.5 * (high - low)
        for k in range(self.bodies.count):
            across = ti.abs(self.bodies.turn[k].transpose()) @ half
            r = self.bodies.inside(k, centre)
            gap = (ti.abs(r) - across - self.bodies.half[k]).max()
            if self.bodies.shape[k] == PLANE:
                gap = r[2] - across[2]
            if ti.static(self.bodies.moves):
                arm = half.norm() + (centre - self.bodies.centre[k]).norm()
                gap -= dt * (self.bodies.linear[k].norm() + arm * self.bodies.angular[k].norm())
            self.near[k] = gap < self.offset

    @ti.func
    def project(self, h, since):
        """Push nodes out of every solid they can reach, in a substep of h [s] that ends `since` the step's start."""
        if ti.static(self.remember):
            for at in range(self.board.half):
                self.touch[at] = 0.0
        if ti.static(self.bodies.count > 0):
            for k in range(self.bodies.count):
                if self.near[k]:
                    samples = 4 if self.bodies.shape[k] != PLANE else 1
                    for i in range(self.board.ni):
                        for j in range(self.board.nj):
                            at = i * self.board.pitch + j
                            reach = self.offset + (samples > 1) * self.half_patch
                            if self._at_least(k, self.board.vector(self.board.x, at), since) < reach:
                                for s in range(samples):
                                    other_i, other_j = i + s % 2, j + s // 2
                                    if other_i < self.board.ni and other_j < self.board.nj:
                                        self._push(k, at, other_i * self.board.pitch + other_j, h, since)

    @ti.func
    def _at_least(self, k, x, since):
        """A distance [m] that the true one does not fall below."""
        r = self.bodies.inside(k, x)
        bound = (ti.abs(r) - self.bodies.half[k]).max()
        if self.bodies.shape[k] == PLANE:
            bound = r[2]
        if ti.static(self.bodies.moves):
            bound -= since * self.bodies.velocity(k, x).norm()
        return bound

    @ti.func
    def _push(self, k, at, other, h, since):
        """The middle of two nodes, or one node given twice: out along the normal, then back along the surface by at
        most friction times as much. Each moves by its share, half its weight over the mean of both.

        Depth that was there at the substep's start is undone there too, so that it becomes no speed.
        """
        board = self.board
        x = 0.5 * (board.vector(board.x, at) + board.vector(board.x, other))
        nd, way = self.bodies.distance(k, x), self.bodies.velocity(k, x)
        normal = nd.xyz
        depth, resist = self.offset - nd[3] + since * way.dot(normal), 0.5 * (board.w[at] + board.w[other])
        if depth > 0.0 and resist > 0.0:
            start = 0.5 * (board.vector(board.start, at) + board.vector(board.start, other))
            before = self.bodies.distance(k, start)[3] - (since - h) * way.dot(normal)
            was = ti.min(ti.max(self.offset - before, 0.0), depth)
            past = x + depth * normal - (start + was * normal) - h * way
            slide = past - past.dot(normal) * normal
            hold = self.bodies.friction[k] * (depth - was)
            move = depth * normal - slide * ti.min(1.0, hold / ti.max(slide.norm(), 1e-12))
            self._shift(at, board.w[at] / resist, move, was * normal)
            if other != at:
                self._shift(other, board.w[other] / resist, move, was * normal)
            elif ti.static(self.remember):
                self.touch[at] = normal

    @ti.func
    def _shift(self, at, share, move, undone):
        self.board.set_vector(self.board.x, at, self.board.vector(self.board.x, at) + share * move)
        self.board.set_vector(self.board.start, at, self.board.vector(self.board.start, at) + share * undone)
