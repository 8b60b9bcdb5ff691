"""Kernel calls: known ones are launched at once, all others are Taichi's own, and both do the same."""

import gc

import pytest
import taichi as ti
import taichi.math as tm
from spawned import spawn


@ti.data_oriented
class Adder:
    """Kernels of each kind."""

    def __init__(self, size: int = 4):
        self.total = ti.field(float, shape=size)

    @ti.kernel
    def add(self, much: float, times: ti.i32) -> float:
        for k in range(self.total.shape[0]):
            self.total[k] += much * times
        return self.total[0]

    @ti.kernel
    def length(self, of: ti.template()) -> ti.i32:
        return of.shape[0]

    @ti.kernel
    def power(self, exponent: ti.template()) -> ti.i32:
        return 3**exponent

    @ti.kernel
    def aslant(self, way: tm.vec3) -> float:
        return way.sum()

    def known(self, name: str) -> int:
        """How many calls of a kernel go the short way."""
        return len(getattr(type(self), name)._primal.known)


@ti.kernel
def twice(x: float) -> float:
    return 2.0 * x


def _refused(call, *args) -> str:
    try:
        return f"took {args}: {call(*args)}"
    except Exception:  # whatever Taichi says
        return ""


def _calls() -> dict:
    from sim import runtime

    runtime.start(threads=1)
    one, two = Adder(), Adder()
    found = {
        "sums": [one.add(0.5, 3) for _ in range(3)] + [two.add(0.5, 2) for _ in range(2)],
        "owners": two.known("add"),
    }
    found["lengths"], found["passing"] = [], []
    for size in range(1, 40):  # a list that did not fit and its owner are gone: the next may have their ids
        field, owner = ti.field(ti.i32, shape=size), Adder(size)
        found["lengths"] += [one.length(field), one.length(field)]
        found["passing"] += [owner.add(1.0, 1), owner.add(1.0, 1)]
        del field, owner
        gc.collect()
    found["doubled"] = [twice(1.0), twice(2.0)]
    found["powers"] = [one.power(k) for k in (1, 2, 1, 3)]
    found["numbers known"] = one.known("power")
    found["vectors"] = [one.aslant(tm.vec3(1.0, 2.0, k)) for k in (3.0, 4.0)]
    found["refused"] = [_refused(one.add, *args) for args in ((0.5,), (0.5, 1.5), ("much", 1))]
    ti.reset()
    ti.init(arch=ti.cpu, log_level=ti.ERROR)
    after = Adder()
    found["after a reset"] = [after.add(1.0, 1), after.add(1.0, 1), twice(4.0)]
    return found


@pytest.fixture(scope="module")
def calls():
    return spawn(_calls)


def test_numbers_go_in_and_come_out(calls):
    assert calls["sums"] == [1.5, 3.0, 4.5, 1.0, 2.0]
    assert calls["owners"] == 2


def test_what_is_gone_is_not_taken_for_what_came_in_its_place(calls):
    assert calls["lengths"] == [size for size in range(1, 40) for _ in range(2)]
    assert calls["passing"] == [1.0, 2.0] * 39


def test_what_a_kernel_is_compiled_for_may_be_a_number(calls):
    assert calls["powers"] == [3, 9, 3, 27]
    assert calls["numbers known"] == 0


def test_other_calls_are_taichis_own(calls):
    assert calls["vectors"] == [6.0, 7.0]


def test_a_known_kernel_takes_no_wrong_number(calls):
    assert calls["refused"] == ["", "", ""]


def test_a_new_start_forgets(calls):
    assert calls["doubled"] == [2.0, 4.0]
    assert calls["after a reset"] == [1.0, 2.0, 8.0]
