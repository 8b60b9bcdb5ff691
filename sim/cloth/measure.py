"""What is said of the sheet as a whole. A maximum and a serial sum: the same bits on any number of threads."""

import numpy as np
import taichi as ti

from sim.scene.cloth import Sheet, spring_list


@ti.data_oriented
class Measure:
    """Of the rows x, v, mass and the springs of a sheet."""

    def __init__(self, sheet: Sheet, x, v, mass):
        self.x, self.v, self.mass, self.node_count = x, v, mass, len(sheet.x)
        springs = spring_list(sheet, ("structural_u", "structural_v", "shear_1", "shear_2"))
        self.spring_count = len(springs.rest)
        self.ends = ti.Vector.field(2, ti.i32, self.spring_count)
        self.rest = ti.field(float, self.spring_count)
        self.ends.from_numpy(springs.ends.astype(np.int32))
        self.rest.from_numpy(springs.rest.astype(np.float32))

    def max_strain(self) -> float:
        """max length/rest - 1."""
        return self._max_strain()

    def kinetic_energy(self) -> float:
        """sum m v^2/2 [J]."""
        return self._kinetic_energy()

    @ti.kernel
    def _max_strain(self) -> float:
        largest = -1.0
        for s in range(self.spring_count):
            a, b = self.ends[s]
            ti.atomic_max(largest, (self.x[b] - self.x[a]).norm() / self.rest[s] - 1.0)
        return largest

    @ti.kernel
    def _kinetic_energy(self) -> float:
        total = 0.0
        ti.loop_config(serialize=True)
        for n in range(self.node_count):
            total += 0.5 * self.mass[n] * self.v[n].dot(self.v[n])
        return total
