"""Movers: which velocity carries a particle through a step."""

import taichi as ti

from sim.registry import register
from sim.schema import Model
from sim.stage import Build, Suspect
from sim.state import Row


@register("fluid.mover", "symplectic_euler")
@ti.data_oriented
class SymplecticEuler:
    """v += dt a, then x += dt v: the new velocity moves the particle. Stable to dt = 2/omega, undamped.

    way: field [m/s] of a method that moves particles by another velocity than the one they keep, else None; of its
    entries x, y, z count.
    """

    class Params(Model):
        """None."""

    order = 1
    rows = ("fluid.x", "fluid.v")
    scratch = ()

    def __init__(self, build: Build, way=None):
        self.walls = build.parts["walls"]
        self.x, self.v = build.state["fluid.x"], build.state["fluid.v"]
        self.way, self.own_way = way, way is not None

    @ti.func
    def begin(self, i):
        """Before forces: the velocity that is about to change is not needed again."""

    @ti.func
    def move(self, i, dt):
        """x and v of particle i, kept out of solids; v loses what a solid took from the way."""
        if ti.static(self.own_way):
            way = self.way[i].xyz
            x, u = self.walls.move(i, way, dt)
            self.x[i] = x
            self.v[i] += u - way
        else:
            self.x[i], self.v[i] = self.walls.move(i, self.v[i], dt)


@register("fluid.mover", "explicit_euler")
@ti.data_oriented
class ExplicitEuler:
    """x += dt v, then v += dt a: the old velocity moves the particle, as in Higgins & Zhang 2019.

    An oscillation of angular frequency omega grows by sqrt(1 + omega^2 dt^2) a step, however small dt is. Not for a
    method with a way of its own: sim.fit refuses it.
    """

    class Params(Model):
        """None."""

    order = 1
    rows = ("fluid.x", "fluid.v")
    scratch = (Row("fluid.explicit_euler.before", "v", "m/s", "velocity before this step's forces", saved=False),)

    def __init__(self, build: Build, way=None):
        self.walls = build.parts["walls"]
        self.x, self.v = build.state["fluid.x"], build.state["fluid.v"]
        self.before = build.state[self.scratch[0].name]

    @ti.func
    def begin(self, i):
        """Before forces: keep the velocity."""
        self.before[i] = self.v[i]

    @ti.func
    def move(self, i, dt):
        """x by the old velocity, kept out of solids; v loses what a solid took from the old one."""
        x, stopped = self.walls.move(i, self.before[i], dt)
        self.x[i] = x
        self.v[i] += stopped - self.before[i]

    def suspects(self) -> tuple[Suspect, ...]:
        """Settings that are known to fail, for the guard."""
        return (Suspect("exploding", 'fluid.mover = "explicit_euler" adds energy, take "symplectic_euler"'),)
