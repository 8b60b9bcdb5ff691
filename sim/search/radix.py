"""Numbers in order of their keys, by counting digits."""

import taichi as ti

BITS = 11
DIGITS = 1 << BITS


@ti.data_oriented
class Radix:
    """Stable least-digit-first sort of `count` u32 keys in three passes, O(n), serial.

    key     u32 field (count,); fill before, sorted after
    order   i32 field (count,); after: the number that each key came with (0.. in the order of filling)
    """

    def __init__(self, count: int):
        self.count = count
        self.key, self._key = (ti.field(ti.u32, shape=max(count, 1)) for _ in range(2))
        self.order, self._order = (ti.field(ti.i32, shape=max(count, 1)) for _ in range(2))
        self.place = ti.field(ti.i32, shape=(3, DIGITS))

    @ti.func
    def sort(self):
        """From a serial loop of a kernel."""
        for n, digit in ti.ndrange(3, DIGITS):
            self.place[n, digit] = 0
        for i in range(self.count):
            key = self.key[i]
            for n in ti.static(range(3)):
                self.place[n, _digit(key, n)] += 1
        for n in range(3):
            total = 0
            for digit in range(DIGITS):
                count = self.place[n, digit]
                self.place[n, digit] = total
                total += count
        for i in range(self.count):
            self._put(0, i, i, self.key[i], self._key, self._order)
        for i in range(self.count):
            self._put(1, i, self._order[i], self._key[i], self.key, self.order)
        for i in range(self.count):
            self._put(2, i, self.order[i], self.key[i], self._key, self._order)
        for i in range(self.count):
            self.key[i] = self._key[i]
            self.order[i] = self._order[i]

    @ti.func
    def _put(self, n: ti.template(), i, number, key, to_key: ti.template(), to_order: ti.template()):
        digit = _digit(key, n)
        to = self.place[n, digit]
        self.place[n, digit] = to + 1
        to_key[to] = key
        to_order[to] = number


@ti.func
def _digit(key, n: ti.template()):
    return ti.cast((key >> (BITS * n)) & (DIGITS - 1), ti.i32)


@ti.func
def rising(x):
    """u32 that is in the order of the f32 x: the sign bit flipped, negative numbers inverted."""
    bits = ti.bit_cast(ti.cast(x, ti.f32), ti.u32)
    key = bits | ti.u32(0x80000000)
    if bits >> 31 == 1:
        key = ~bits
    return key
