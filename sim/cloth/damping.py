"""Damping of what is not rigid motion, so that a falling, turning sheet keeps its momentum."""

import taichi as ti
import taichi.math as tm

from sim.model import Model, quantity

FLAT = 1e-9
"""[m] Three nodes that are in line to within this bend in no direction."""


class Damped(Model):
    """What every solver reads of it."""

    damping: float = quantity("0.2 1/s", ge=0, why="of velocity relative to the sheet's own rigid motion")
    drag: float = quantity("0 1/s", ge=0, why="of all motion: damping alone lets a clipped sheet swing for ever")
    bending_retardation: float = quantity(
        "0 s", "time", ge=0, why="tau of the moment B (kappa + tau dkappa/dt): 1 ms stills folds a mesh wide in 0.1 s"
    )


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


@ti.func
def damp_bending(board: ti.template(), viscosity):
    """Moments B tau dkappa/dt along and across, over one step; viscosity: B tau dt/a^2 [kg].

    Of three nodes in a row d = x_a - 2 x_b + x_c is the curvature times a^2, and |d| changes by s = n . (v_a - 2 v_b
    + v_c), n = d/|d|. Impulses -+ s viscosity along n, implicit one by one: they take energy at every dt and leave
    linear and angular momentum as they are. The rate goes by the fourth power of a fold's width.
    Kelvin-Voigt; a viscous moment of fabrics in bending: Lahey & Heppler 2004.
    """
    for turn in range(2):
        down, step = 2 - 2 * turn, board.pitch if turn == 0 else 1
        for i in range(board.ni - down):
            for j in range(board.nj - 2 + down):
                a, b, c = i * board.pitch + j, i * board.pitch + j + step, i * board.pitch + j + 2 * step
                d = board.vector(board.x, a) - 2.0 * board.vector(board.x, b) + board.vector(board.x, c)
                wa, wb, wc = board.w[a], board.w[b], board.w[c]
                change = board.vector(board.v, a) - 2.0 * board.vector(board.v, b) + board.vector(board.v, c)
                flat = d.dot(d) * (1.0 + viscosity * (wa + 4.0 * wb + wc))
                push = -viscosity * change.dot(d) / ti.max(flat, FLAT * FLAT) * d
                board.set_vector(board.v, a, board.vector(board.v, a) + wa * push)
                board.set_vector(board.v, b, board.vector(board.v, b) - 2.0 * wb * push)
                board.set_vector(board.v, c, board.vector(board.v, c) + wc * push)
