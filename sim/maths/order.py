"""The smaller and the larger of two numbers in one instruction each; ti.min and ti.max take three, to sort NaN out."""

import taichi as ti


@ti.func
def less(a, b):
    """a where it is less than b, else b; also where one is NaN."""
    return ti.select(a < b, a, b)


@ti.func
def more(a, b):
    """a where it is more than b, else b; also where one is NaN."""
    return ti.select(a > b, a, b)
