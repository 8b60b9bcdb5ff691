"""Does a moving point meet a moving triangle, or an edge an edge: in rational arithmetic, by signs at roots."""

from fractions import Fraction

import numpy as np


def meets(query: np.ndarray, edges: bool = False) -> bool | None:
    """query (8, 3): v, f0, f1, f2 at t0, then at t1, taken as they stand. None: the triangle has no area there.

    The point is in the plane where f(t) = q . (u x v) vanishes, and in the triangle where its three barycentric
    weights times |u x v|^2 are not negative. Always in the plane: the weights' own roots, and times between them.
    edges: of v, f0 and of f1, f2. The weights are the two places along them, and what is left. None: parallel there.
    """
    x = [[Fraction(float(c)) for c in point] for point in query]
    path = [[[a, b - a] for a, b in zip(x[k], x[k + 4])] for k in range(4)]
    q, u, v = (_minus(path[k], path[m]) for k, m in ([(2, 0), (1, 0), (3, 2)] if edges else [(0, 1), (2, 1), (3, 1)]))
    n = _cross(u, v)
    f = _dot(q, n)
    if edges:
        weights = [_dot(_cross(q, v), n), _dot(_cross(q, u), n)]
        weights += [_add(_dot(n, n), [-a for a in w]) for w in weights]
    else:
        weights = [_dot(_cross(q, v), n), _dot(_cross(u, q), n)]
        weights.append(_add(_dot(n, n), [-a for a in _add(*weights)]))
    times = _times(_trim(f), [_trim(w) for w in weights])
    signs = [[_sign_at(_trim(p), time) for p in (*weights, _dot(n, n))] for time in times]
    if any(area > 0 and min(w) >= 0 for *w, area in signs):
        return True
    return None if any(area == 0 for *_, area in signs) else False


def _times(f: list, weights: list) -> list[tuple]:
    """Where to look: (polynomial, low, high) with one root in (low, high], or (None, t, t)."""
    if f:
        return _isolated(f)
    found = [(None, Fraction(0), Fraction(0)), (None, Fraction(1), Fraction(1))]
    for w in weights:
        found += _isolated(w) if w else []
    between = sorted({time for _, low, high in found for time in (low, high)})
    return found + [(None, (a + b) / 2, (a + b) / 2) for a, b in zip(between, between[1:])]


def _isolated(p: list) -> list[tuple]:
    """Distinct roots of p in [0, 1], each as (square-free p, low, high), low < root <= high."""
    p = _divide(p, _gcd(p, _slope(p)))[0]
    chain = _sturm(p)
    stack, found = [(Fraction(-1, 7), Fraction(1))], []
    while stack:
        low, high = stack.pop()
        count = _changes(chain, low) - _changes(chain, high)
        if count == 1:
            found.append((p, low, high))
        elif count > 1:
            middle = (low + high) / 2
            stack += [(low, middle), (middle, high)]
    return [root for root in (_beyond(*r, Fraction(0)) for r in found) if root]


def _beyond(p: list, low, high, least):
    """The root if it is not below `least`, else None."""
    if low >= least:
        return p, low, high
    if _at(p, least) == 0 and _changes(_sturm(p), low) - _changes(_sturm(p), least) == 1:
        return None, least, least
    chain = _sturm(p)
    return (p, least, high) if _changes(chain, least) - _changes(chain, high) == 1 else None


def _sign_at(w: list, time: tuple) -> int:
    """Sign of w at that time."""
    p, low, high = time
    if not w:
        return 0
    if p is None:
        return _sign(_at(w, low))
    common = _gcd(p, w)
    if len(common) > 1:
        chain = _sturm(common)
        if _changes(chain, low) - _changes(chain, high) == 1:
            return 0
    simple = _divide(w, _gcd(w, _slope(w)))[0]
    chain_p, chain_w = _sturm(p), _sturm(simple)
    while _changes(chain_w, low) != _changes(chain_w, high) or _at(w, high) == 0:
        middle = (low + high) / 2
        inside = _changes(chain_p, low) - _changes(chain_p, middle) == 1
        low, high = (low, middle) if inside else (middle, high)
        if _at(p, high) == 0 and _at(w, high) != 0:
            break
    return _sign(_at(w, high))


def _sign(value) -> int:
    return (value > 0) - (value < 0)


def _trim(p: list) -> list:
    while p and p[-1] == 0:
        p = p[:-1]
    return p


def _add(a: list, b: list) -> list:
    size = max(len(a), len(b))
    return [(a[k] if k < len(a) else 0) + (b[k] if k < len(b) else 0) for k in range(size)]


def _times_of(a: list, b: list) -> list:
    found = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            found[i + j] += x * y
    return found


def _minus(a: list, b: list) -> list:
    return [_add(p, [-c for c in r]) for p, r in zip(a, b)]


def _cross(a: list, b: list) -> list:
    def part(i, j):
        return _add(_times_of(a[i], b[j]), [-c for c in _times_of(a[j], b[i])])

    return [part(1, 2), part(2, 0), part(0, 1)]


def _dot(a: list, b: list) -> list:
    total = [Fraction(0)]
    for p, r in zip(a, b):
        total = _add(total, _times_of(p, r))
    return total


def _at(p: list, t) -> Fraction:
    value = Fraction(0)
    for c in reversed(p):
        value = value * t + c
    return value


def _slope(p: list) -> list:
    return [k * c for k, c in enumerate(p)][1:]


def _divide(a: list, b: list) -> tuple[list, list]:
    a, quotient = list(a), [Fraction(0)] * max(len(a) - len(b) + 1, 0)
    while len(a) >= len(b):
        factor, shift = a[-1] / b[-1], len(a) - len(b)
        quotient[shift] = factor
        a = _trim(_add(a, [0] * shift + [-factor * c for c in b])[:-1])
    return quotient, a


def _gcd(a: list, b: list) -> list:
    a, b = _trim(a), _trim(b)
    while b:
        a, b = b, _divide(a, b)[1]
    return [c / a[-1] for c in a]


def _sturm(p: list) -> list[list]:
    chain = [p, _trim(_slope(p))]
    while chain[-1]:
        chain.append([-c for c in _divide(chain[-2], chain[-1])[1]])
    return chain[:-1]


def _changes(chain: list[list], t) -> int:
    """Of sign along Sturm's chain; roots in (a, b] number changes(a) - changes(b)."""
    signs = [s for s in (_sign(_at(p, t)) for p in chain) if s]
    return sum(a != b for a, b in zip(signs, signs[1:]))
