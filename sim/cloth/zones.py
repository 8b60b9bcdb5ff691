"""Nodes that hang together, as trees in one field: zone[n] leads towards the root of n's zone, a root to itself."""

import taichi as ti


@ti.func
def root(zone: ti.template(), n):
    """The lowest node of n's zone."""
    r = n
    while zone[r] != r:
        r = zone[r]
    return r


@ti.func
def join(zone: ti.template(), a, b):
    """One zone of a's and b's; the lower root becomes that of both."""
    ra, rb = root(zone, a), root(zone, b)
    zone[ti.max(ra, rb)] = ti.min(ra, rb)
    zone[a], zone[b] = ti.min(ra, rb), ti.min(ra, rb)  # shorter ways for the next
