"""[cloth] -> Sheet: nodes, masses, springs from the fabric, clips, triangles. NumPy only.

Node (i, j) has index i*nj + j and material coordinates u = i*spacing, v = j*spacing; i runs along `size[0]`.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from sim.scene.hang import clip_nodes, frame_axes, hang


class Family(NamedTuple):
    """Springs of one kind: (i, j) + first -- (i, j) + second for every i, j that stays on the sheet.

    rest is their length [m]; a spring's stiffness is row[i] * column[j] [N/m] (a product, so that a solver needs no
    number a spring). No two springs with the same i share a node (with the same j, if `across`).
    """

    name: str
    first: tuple[int, int]
    second: tuple[int, int]
    rest: float
    row: np.ndarray
    column: np.ndarray
    across: bool


class Springs(NamedTuple):
    """A flat list: ends (s, 2) node numbers, rest (s,) [m], stiffness (s,) [N/m], family (s,) names."""

    ends: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray
    family: np.ndarray


@dataclass(frozen=True)
class Sheet:
    """The cloth before time begins. SI units.

    shape        (ni, nj)      nodes along each side
    spacing      ()            mesh width [m]
    thickness    ()            [m]
    bending      ()            plate stiffness B of isometric bending, 0 with another kind [N m]
    x            (n, 3)        initial place, clips where they hold it [m]
    uv           (n, 2)        material coordinates, from corner (0, 0) [m]
    mass         (n,)          lumped dry mass: border nodes half, corners a quarter [kg]
    inv_mass     (n,)          1/mass, 0 where a clip holds [1/kg]
    triangles    (t, 3) i32    two a patch, seen counter-clockwise from the side `normal` points to
    patches      (p, 4) i32    nodes of each quad, the same way round
    families     tuple         springs, stretch kinds first
    pins         (k,) i32      nodes held
    pin_nearest  (n,) i32      the held node nearest on the flat sheet; -1 without pins
    pin_distance (n,)          how far that is: a straight line, for a flat rectangle is convex [m]
    """

    shape: tuple[int, int]
    spacing: float
    thickness: float
    bending: float
    x: np.ndarray
    uv: np.ndarray
    mass: np.ndarray
    inv_mass: np.ndarray
    triangles: np.ndarray
    patches: np.ndarray
    families: tuple[Family, ...]
    pins: np.ndarray
    pin_nearest: np.ndarray
    pin_distance: np.ndarray


def build_sheet(cloth: Any) -> Sheet:
    """From config.cloth. ConfigError if a pin names a node that is not there."""
    shape, a = cloth.node_counts, cloth.spacing
    index = np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape)
    uv = np.stack(np.meshgrid(*(a * np.arange(n) for n in shape), indexing="ij"), -1).reshape(-1, 2)
    mass = cloth.fabric.area_density * a**2 * np.outer(_ends_half(shape[0]), _ends_half(shape[1])).ravel()
    owner = clip_nodes(cloth.pins, uv, shape)
    pins = np.flatnonzero(owner >= 0).astype(np.int32)
    nearest, distance = _nearest_pin(uv, pins)
    patches = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4)
    return Sheet(
        shape=shape,
        spacing=a,
        thickness=cloth.fabric.thickness,
        bending=cloth.fabric.bending if cloth.bending == "isometric" else 0.0,
        x=hang(cloth, uv, shape, owner) @ frame_axes(cloth.normal) + np.asarray(cloth.centre),
        uv=uv,
        mass=mass,
        inv_mass=np.where(owner >= 0, 0.0, 1.0 / mass),
        triangles=_triangles(patches, shape),
        patches=patches,
        families=_families(cloth, shape),
        pins=pins,
        pin_nearest=nearest,
        pin_distance=distance,
    )


def spring_list(sheet: Sheet, families: tuple[str, ...] | None = None) -> Springs:
    """Every spring of the named families (all, if None), one by one."""
    index = np.arange(len(sheet.x)).reshape(sheet.shape)
    ends, rest, stiffness, names = [], [], [], []
    for f in sheet.families:
        if families is not None and f.name not in families:
            continue
        rows, columns = len(f.row), len(f.column)
        sides = [index[o[0] : o[0] + rows, o[1] : o[1] + columns].ravel() for o in (f.first, f.second)]
        ends.append(np.stack(sides, -1))
        stiffness.append(np.outer(f.row, f.column).ravel())
        rest.append(np.full(rows * columns, f.rest))
        names.append(np.full(rows * columns, f.name))
    return Springs(*(np.concatenate(part) for part in (ends, rest, stiffness, names)))


def flexion_stiffness(bending: float, stretch: float, spacing: float) -> float:
    """k_f = 64 B / a^2 [N/m], and at most Y/16, so that the structural springs stay the stiffest.

    Bent to curvature kappa, inextensible links let a flexion spring shorten by a^3 kappa^2/4; it then stores
    k_f a^6 kappa^4/32, a plate B a^2 kappa^2/2. The two agree at the sharpest bend the mesh shows, kappa = 1/(2 a).
    Gentler bends are softer than the plate's: a flat row of springs has no linear bending stiffness.
    """
    return min(64.0 * bending / spacing**2, stretch / 16.0)


def _families(cloth: Any, shape: tuple[int, int]) -> tuple[Family, ...]:
    """Isotropic in the plane: k_h = 3 Y/8, k_s + 4 k_f = 2 k_h; then nu = 1/3 and Y = (8/3) k_h.

    The end link of every row carries k_s + 2 k_f, for only one flexion spring spans it; border springs carry half.
    """
    ni, nj = shape
    a, stretch = cloth.spacing, cloth.fabric.stretch
    kh = 3.0 * stretch / 8.0
    kf = flexion_stiffness(cloth.fabric.bending, stretch, a) if cloth.bending == "flexion" else 0.0
    ks = 2.0 * kh - 4.0 * kf

    def links(n: int) -> np.ndarray:
        k = np.full(n - 1, ks)
        k[0] += 2.0 * kf
        k[-1] += 2.0 * kf
        return k

    diagonal, one = a * np.sqrt(2.0), np.ones
    half_i, half_j = _ends_half(ni), _ends_half(nj)
    found = [
        Family("structural_u", (0, 0), (1, 0), a, links(ni), half_j, False),
        Family("structural_v", (0, 0), (0, 1), a, half_i, links(nj), True),
        Family("shear_1", (0, 0), (1, 1), diagonal, kh * one(ni - 1), one(nj - 1), False),
        Family("shear_2", (0, 1), (1, 0), diagonal, kh * one(ni - 1), one(nj - 1), False),
    ]
    if kf > 0.0:
        found += [
            Family("flexion_u", (0, 0), (2, 0), 2.0 * a, kf * one(ni - 2), half_j, False),
            Family("flexion_v", (0, 0), (0, 2), 2.0 * a, half_i, kf * one(nj - 2), True),
        ]
    return tuple(found)


def _ends_half(n: int) -> np.ndarray:
    weight = np.ones(n)
    weight[[0, -1]] = 0.5
    return weight


def _triangles(patches: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Two a patch; the diagonal alternates like a chess board's colours, so that no direction is preferred."""
    i, j = np.divmod(np.arange(len(patches)), shape[1] - 1)
    even = ((i + j) % 2 == 0)[:, None]
    a, b, c, d = (patches[:, k] for k in range(4))
    first = np.where(even, np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(even, np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    return np.stack([first, second], 1).reshape(-1, 3).astype(np.int32)


def _nearest_pin(uv: np.ndarray, pins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if not len(pins):
        return np.full(len(uv), -1, np.int32), np.zeros(len(uv))
    nearest, distance = np.full(len(uv), -1, np.int32), np.full(len(uv), np.inf)
    for pin in pins:
        gap = np.linalg.norm(uv - uv[pin], axis=1)
        nearer = gap < distance
        nearest[nearer], distance[nearer] = pin, gap[nearer]
    return nearest, distance
