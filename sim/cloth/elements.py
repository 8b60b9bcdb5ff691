"""The sheet's nodes and edges dealt out to its patches, so that two patches say which of them may meet, each once."""

import numpy as np
import taichi as ti

from sim.maths.ccd import EDGES, POINT
from sim.scene.cloth import Sheet


@ti.data_oriented
class Elements:
    """Each node and edge belongs to the lowest patch that has it (Curtis, Tamstorf & Manocha 2008).

    count(p, q)     how many tests patches p <= q ask for: nodes of one against triangles of the other, edges of both
    test(p, q, t)   (POINT or EDGES, four nodes, whether it is one: no node shared, no pair twice)
    """

    def __init__(self, sheet: Sheet):
        nodes, edges = dealt_out(np.asarray(sheet.triangles), len(sheet.patches))
        self.corner = _table(np.asarray(sheet.triangles))
        self.own_nodes, self.node_start = _flat(nodes, 1)
        self.own_edges, self.edge_start = _flat(edges, 2)

    @ti.func
    def count(self, p, q):
        tests = 2 * self._nodes(p) + self._edges(p) * self._edges(q)
        if p != q:
            tests += 2 * self._nodes(q)
        return tests

    @ti.func
    def _nodes(self, p):
        return self.node_start[p + 1] - self.node_start[p]

    @ti.func
    def _edges(self, p):
        return self.edge_start[p + 1] - self.edge_start[p]

    @ti.func
    def test(self, p, q, t):
        kind, four, fits = POINT, ti.Vector([0, 0, 0, 0]), True
        first = 2 * self._nodes(p)
        both = first
        if p != q:
            both += 2 * self._nodes(q)
        if t < both:
            owner, other, at = p, q, t
            if t >= first:
                owner, other, at = q, p, t - first
            node, corner = self.own_nodes[self.node_start[owner] + at // 2], self.corner[2 * other + at % 2]
            four = ti.Vector([node[0], corner[0], corner[1], corner[2]])
            fits = node[0] != corner[0] and node[0] != corner[1] and node[0] != corner[2]
        else:
            kind, at = EDGES, t - both
            m, n = self.edge_start[p] + at // self._edges(q), self.edge_start[q] + at % self._edges(q)
            e, f = self.own_edges[m], self.own_edges[n]
            four = ti.Vector([e[0], e[1], f[0], f[1]])
            fits = m < n and e[0] != f[0] and e[0] != f[1] and e[1] != f[0] and e[1] != f[1]
        return kind, four, fits


def dealt_out(triangles: np.ndarray, patch_count: int) -> tuple[list, list]:
    """(nodes, edges) of each patch that no lower patch has; triangles 2p and 2p + 1 are patch p's."""
    nodes, edges = [[] for _ in range(patch_count)], [[] for _ in range(patch_count)]
    seen: set = set()
    for t, corners in enumerate(triangles.tolist()):
        for k in range(3):
            node, edge = corners[k], tuple(sorted((corners[k], corners[k - 1])))
            if node not in seen:
                seen.add(node)
                nodes[t // 2].append([node])
            if edge not in seen:
                seen.add(edge)
                edges[t // 2].append(list(edge))
    return nodes, edges


def _flat(lists: list, width: int):
    """One list after another as a field of vectors, and where each begins."""
    flat = np.array([entry for entries in lists for entry in entries], np.int32).reshape(-1, width)
    start = ti.field(ti.i32, len(lists) + 1)
    start.from_numpy(np.cumsum([0] + [len(entries) for entries in lists]).astype(np.int32))
    return _table(flat), start


def _table(values: np.ndarray):
    field = ti.Vector.field(values.shape[1], ti.i32, shape=len(values))
    field.from_numpy(values.astype(np.int32))
    return field
