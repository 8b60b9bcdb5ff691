"""Where the sheet is before time begins: clips stood nearer than the cloth is long, and a smooth sag between them."""

from typing import Any

import numpy as np

from sim.errors import ConfigError


def frame_axes(normal: Any) -> np.ndarray:
    """Rows e_u, e_v, n: right-handed, e_u as near to +x as a plane across `normal` allows (+y if n is along x)."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    guide = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    e_u = guide - guide.dot(n) * n
    e_u /= np.linalg.norm(e_u)
    return np.stack([e_u, np.cross(n, e_u), n])


def clip_nodes(pins: dict[str, Any], uv: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(n,) the node at the heart of the clip that holds each node, -1 where none does.

    A clip holds every node within `clip` of its heart, measured on the flat sheet; on the edges each node is a heart.
    """
    index = np.arange(len(uv)).reshape(shape)
    owner = np.full(len(uv), -1)
    nearest = np.full(len(uv), np.inf)
    for name, pin in pins.items():
        for heart in _hearts(name, pin.where, index):
            distance = np.linalg.norm(uv - uv[heart], axis=1)
            reach = 0.0 if pin.where == "edges" else pin.clip
            held = (distance <= reach + 1e-9) & (distance < nearest)
            owner[held], nearest[held] = heart, distance[held]
    return owner


def hang(cloth: Any, uv: np.ndarray, shape: tuple[int, int], owner: np.ndarray) -> np.ndarray:
    """(n, 3) places in the sheet's own axes, its middle at the origin; clips lie in the plane z = 0.

    Between clips the sheet sags towards -z as z(u) + z(v), so that every structural spring has its own length; a sheet
    held all round less deep, so that none is longer: taut ones would throw it up to a dome that stands.
    """
    flat = uv - 0.5 * np.asarray(cloth.size)
    if cloth.fold is not None:
        return folded(flat, cloth.fold)
    if not cloth.slack or not np.any(owner >= 0):
        return np.column_stack([flat, np.zeros(len(uv))])
    clip = max(0.0 if pin.where == "edges" else pin.clip for pin in cloth.pins.values())
    (x, zu), (y, zv) = (_sag(n, cloth.spacing, clip, cloth.slack) for n in shape)
    i, j = np.divmod(np.arange(len(uv)), shape[1])
    sag = np.column_stack([x[i], y[j], zu[i] + zv[j]])
    hearts = np.unique(owner[owner >= 0])
    held_at = np.column_stack([(1.0 - cloth.slack) * flat[hearts], np.zeros(len(hearts))])
    place = sag + _blend(uv, uv[hearts]) @ (held_at - sag[hearts])
    border = np.ones(shape, bool)
    border[1:-1, 1:-1] = False
    if (owner.reshape(shape)[border] >= 0).all():
        place[:, 2] *= _shallower(place.reshape(*shape, 3), cloth.spacing)
    held = np.flatnonzero(owner >= 0)
    rank = np.searchsorted(hearts, owner[held])
    place[held] = held_at[rank] + np.column_stack([uv[held] - uv[owner[held]], np.zeros(len(held))])
    return place


def _shallower(place: np.ndarray, spacing: float) -> float:
    """Share of its depth, at most 1, at which no thread is longer than its links."""
    links = np.concatenate([np.diff(place, axis=k).reshape(-1, 3) for k in (0, 1)])
    flat_sq, deep_sq = (links[:, :2] ** 2).sum(1), links[:, 2] ** 2
    too_long = flat_sq + deep_sq > (spacing * (1.0 + 1e-6)) ** 2
    room_sq = np.maximum(spacing**2 - flat_sq[too_long], 0.0)
    return float(np.sqrt(np.min(room_sq / deep_sq[too_long], initial=1.0)))


def folded(flat: np.ndarray, gap: float) -> np.ndarray:
    """(n, 3) in half along the first side: two layers `gap` apart, joined by half a turn; its middle at x > 0."""
    radius = 0.5 * gap
    beyond = np.abs(flat[:, 0]) - 0.5 * np.pi * radius
    angle = np.clip(flat[:, 0] / radius, -0.5 * np.pi, 0.5 * np.pi)
    x = np.where(beyond > 0.0, -beyond, radius * np.cos(angle))
    place = np.column_stack([x, flat[:, 1], radius * np.sin(angle)])
    return place - [0.5 * place[:, 0].min(), 0.0, 0.0]


def _hearts(name: str, where: Any, index: np.ndarray) -> list[int]:
    ni, nj = index.shape
    if where == "corners":
        return [index[0, 0], index[-1, 0], index[0, -1], index[-1, -1]]
    if where == "edges":
        border = np.ones(index.shape, bool)
        border[1:-1, 1:-1] = False
        return list(index[border])
    if isinstance(where, str):
        return list({"left": index[0], "right": index[-1], "front": index[:, 0], "back": index[:, -1]}[where])
    for i, j in where:
        if i >= ni or j >= nj:
            raise ConfigError(f"cloth.pins.{name}.where = [{i}, {j}]: the last node is [{ni - 1}, {nj - 1}]")
    return [index[i, j] for i, j in where]


def _sag(count: int, spacing: float, clip: float, slack: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (x, z) of a row of links hung from two flat clips: slope angle theta0 sin(2 pi t) between them.

    theta0 by bisection, so that the ends stand (1 - slack) of the row apart.
    """
    length = spacing * (count - 1)
    free = length - 2.0 * clip
    chord = (1.0 - slack) * length - 2.0 * clip
    if chord <= 0.0:
        raise ConfigError(f"cloth.slack = {slack:g}: two clips of {clip:g} m do not fit into what is left of a side")
    t = np.clip((spacing * (np.arange(count - 1) + 0.5) - clip) / free, 0.0, 1.0)
    low, high = 0.0, 2.4  # the mean of cos(theta0 sin) falls from 1 to 0 over this range: Bessel's J0
    for _ in range(60):
        theta = 0.5 * (low + high) * np.sin(2.0 * np.pi * t)
        wide = spacing * np.cos(theta).sum() > (1.0 - slack) * length
        low, high = (0.5 * (low + high), high) if wide else (low, 0.5 * (low + high))
    x = np.concatenate([[0.0], np.cumsum(spacing * np.cos(theta))])
    z = np.concatenate([[0.0], np.cumsum(-spacing * np.sin(theta))])
    return x - 0.5 * x[-1], z


def _blend(uv: np.ndarray, hearts: np.ndarray) -> np.ndarray:
    """(n, hearts) inverse-distance weights (Shepard 1968, power 4), 1 at a heart itself, rows summing to 1."""
    gap_sq = ((uv[:, None] - hearts[None]) ** 2).sum(-1)
    weight = 1.0 / np.maximum(gap_sq, 1e-12) ** 2
    return weight / weight.sum(1, keepdims=True)
