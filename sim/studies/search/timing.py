"""One search over the boxes of a sheet, timed: build, refit, queries; what it met, and the memory it holds."""

import time
from collections.abc import Callable
from statistics import median

import numpy as np
import taichi as ti

from sim import registry
from sim.coupling.sides import segment_hits
from sim.search.boxes import overlap
from sim.studies.search.meetings import FRAMES, Meeting

GROWN = 0.25
"""[patch] The least thickness of a patch's box, halved."""
REPEATS = 5
WAYS = ("path", "end", "reach")
"""A query is the box of a particle's path; where it ends, as the report asked; the longest path all about its end."""


@ti.data_oriented
class Bench:
    """Fields for `patches` boxes and `points` queries, shared by the searches over them."""

    def __init__(self, patches: int, points: int):
        self.side = round(np.sqrt(patches))
        vec3 = ti.types.vector(3, float)
        self.low, self.high = (vec3.field(shape=self.side**2) for _ in range(2))
        self.node = vec3.field(shape=(self.side + 1, self.side + 1))
        self.x, self.x1 = (vec3.field(shape=points) for _ in range(2))
        self.points = points

    def place(self, met: Meeting, frame: int) -> None:
        """Boxes and nodes of a frame."""
        low, high = met.boxes(frame, GROWN * met.patch)
        self.low.from_numpy(low)
        self.high.from_numpy(high)
        self.node.from_numpy(met.nodes[frame].astype(np.float32))

    def fill(self, met: Meeting) -> None:
        """Water of a meeting, which may be less than there is space for."""
        for field, values in ((self.x, met.x), (self.x1, met.x1)):
            whole = np.zeros((self.points, 3), np.float32)
            whole[: len(values)] = values
            field.from_numpy(whole)

    def search(self, name: str) -> "Asked":
        """A search by name over these boxes."""
        return Asked(self, name)


@ti.data_oriented
class Asked:
    """A search and the kernel that asks it, compiled together."""

    def __init__(self, bench: Bench, name: str):
        self.bench, self.name = bench, name
        self.boxes = registry.method("search.boxes", name)(bench.side**2)

    @ti.kernel
    def ask(self, count: ti.i32, way: ti.i32, reach: float) -> ti.types.vector(3, ti.i64):
        """(boxes tried, boxes met, crossings found) by asking in one of WAYS; the last grows the end by `reach` [m]."""
        tried, met, hits = ti.i64(0), ti.i64(0), ti.i64(0)
        for i in range(count):
            x, x1 = self.bench.x[i], self.bench.x1[i]
            low, high = ti.min(x, x1), ti.max(x, x1)
            if way > 0:
                low, high = x1, x1
            if way > 1:
                low, high = x1 - reach, x1 + reach
            walk = self.boxes.begin(low, high)
            while walk[0] < walk[1]:
                walk, first, last = self.boxes.next(walk, low, high)
                tried += last - first
                for s in range(first, last):
                    p = self.boxes.slots[s]
                    if overlap(low, high, self.bench.low[p], self.bench.high[p]):
                        met += 1
                        hits += self._crossed(x, x1, p)
        return ti.Vector([tried, met, hits])

    @ti.func
    def _crossed(self, x, x1, p):
        """How many of a patch's two triangles the path passes."""
        i, j = p // self.bench.side, p % self.bench.side
        a, d = self.bench.node[i, j], self.bench.node[i + 1, j + 1]
        hits = 0
        for k in range(2):
            b = self.bench.node[i + 1 - k, j + k]
            hits += ti.cast(segment_hits(x, x1, a, b, d), ti.i32)
        return hits

    def figures(self, met: Meeting) -> dict[str, float]:
        """build, refit (over a sheet that moves), query [CPU s], and the counts of `ask`; a kernel's start left out of
        the query."""
        bench, count = self.bench, len(met.x)
        bench.place(met, 0)
        build = timed(lambda: self.boxes.build(bench.low, bench.high))
        refits = []
        for frame in range(1, FRAMES):
            bench.place(met, frame)
            refits.append(timed(lambda: self.boxes.refit(bench.low, bench.high), 1))
        tried, found, hits = self.ask(count, 0, 0.0)
        return {
            "build": build,
            "refit": sum(refits) / len(refits),
            "query": self.asked(count, 0, 0.0),
            "tried": tried,
            "candidates": found,
            "hits": hits,
            "memory": memory(self.boxes),
        }

    def asked(self, count: int, way: int, reach: float) -> float:
        """CPU seconds of asking, a kernel's start left out."""
        began = timed(lambda: self.ask(0, way, reach))
        return max(timed(lambda: self.ask(count, way, reach)) - began, 1e-6)

    def accuracy(self, met: Meeting) -> list[dict[str, float]]:
        """Of each way to ask: query [CPU s], candidates, hits; over the sheet as it stands and the boxes last built."""
        count, reach, rows = len(met.x), float(np.abs(met.x1 - met.x).max()), []
        for way, name in enumerate(WAYS):
            _, found, hits = self.ask(count, way, reach)
            rows.append({"asked": name, "query": self.asked(count, way, reach), "candidates": found, "hits": hits})
        return rows


def timed(act: Callable[[], object], repeats: int = REPEATS) -> float:
    """Median CPU seconds, which another program on the machine changes little."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        act()
        spent.append(time.process_time() - began)
    return median(spent)


def memory(search) -> int:
    """Bytes of the fields that a search holds, those of its parts too."""
    total = 0
    for value in vars(search).values():
        if isinstance(value, ti.StructField):
            total += sum(_bytes(value.get_member_field(key)) for key in value.keys)
        elif isinstance(value, ti.Field):
            total += _bytes(value)
        elif type(value).__module__.startswith("sim.search"):
            total += memory(value)
    return total


def _bytes(field) -> int:
    width = {ti.i64: 8, ti.f64: 8}.get(field.dtype, 4)
    return int(np.prod(field.shape, initial=1)) * width * getattr(field, "n", 1) * getattr(field, "m", 1)
