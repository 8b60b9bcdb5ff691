"""Damping of what is not rigid motion, so that a falling, turning sheet keeps its momentum."""

import taichi as ti
import taichi.math as tm

from sim.model import Model, quantity


class Damped(Model):
    """What every solver reads of it."""

    damping: float = quantity("0.2 1/s", ge=0, why="of velocity relative to the sheet's own rigid motion")
    drag: float = quantity("0 1/s", ge=0, why="of all motion: damping alone lets a clipped sheet swing for ever")


@ti.func
def largest_speed(board: ti.template()):
    """max |v| [m/s]."""
    fastest_sq = ti.cast(0.0, board.real)
    for i in range(board.ni):
        for j in range(board.nj):
            v = board.vector(board.v, i * board.pitch + j)
            fastest_sq = ti.max(fastest_sq, v.dot(v))
    return ti.sqrt(fastest_sq)


@ti.func
def damp_relative(board: ti.template(), kept):
    """v <- u + kept (v - u), u = V + omega x (x - c) the rigid motion with the free nodes' momentum.

    V = sum m v/M, c = sum m x/M, omega = I^-1 sum m (x - c) x v: linear and angular momentum stay (Mueller 2007, 3.5).
    """
    zero = ti.Vector.zero(board.real, 3)
    mass, centre, momentum = ti.cast(0.0, board.real), zero, zero
    for i in range(board.ni):
        for j in range(board.nj):
            at = i * board.pitch + j
            if board.w[at] > 0.0:
                m = 1.0 / board.w[at]
                mass += m
                centre += m * board.vector(board.x, at)
                momentum += m * board.vector(board.v, at)
    if mass > 0.0:
        centre /= mass
        mean = momentum / mass
        spin = _spin(board, centre)
        for i in range(board.ni):
            for j in range(board.nj):
                at = i * board.pitch + j
                if board.w[at] > 0.0:
                    rigid = mean + tm.cross(spin, board.vector(board.x, at) - centre)
                    board.set_vector(board.v, at, rigid + kept * (board.vector(board.v, at) - rigid))


@ti.func
def _spin(board: ti.template(), centre):
    """omega = I^-1 L about `centre` [rad/s]; about a line of nodes, none along it."""
    angular = ti.Vector.zero(board.real, 3)
    inertia = ti.Matrix.zero(board.real, 3, 3)
    for i in range(board.ni):
        for j in range(board.nj):
            at = i * board.pitch + j
            if board.w[at] > 0.0:
                r = board.vector(board.x, at) - centre
                m = 1.0 / board.w[at]
                angular += m * tm.cross(r, board.vector(board.v, at))
                inertia += m * (r.dot(r) * ti.Matrix.identity(board.real, 3) - r.outer_product(r))
    scale = inertia.trace()
    spin = ti.Vector.zero(board.real, 3)
    if inertia.determinant() > 1e-9 * scale**3:
        spin = inertia.inverse() @ angular
    return spin
