"""Pinhole view: world <-> pixel. One matrix and one lens describe the camera and, from far away, the sun alike."""

import math

import numpy as np
import taichi as ti

VEC3 = ti.types.vector(3, ti.f32)
VIEW = ti.types.matrix(4, 3, ti.f32)
BOX = ti.types.vector(4, ti.i32)


def look_at(eye, target) -> np.ndarray:
    """Rows right, up, forward (unit, z-up world) and eye: (4, 3) f32."""
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    pole = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, pole)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward, eye]).astype(np.float32)


def lens(size, fov: float) -> np.ndarray:
    """(focal length, centre x, centre y) in pixels for a vertical field of view `fov` [rad]."""
    width, height = size
    return np.array([0.5 * height / math.tan(0.5 * fov), 0.5 * width, 0.5 * height], np.float32)


def box_of(x: np.ndarray, view, lens, size, margin: float) -> np.ndarray:
    """Pixel box (x0, y0, x1, y1) i32 that holds the points x (n, 3) and `margin` [m] about each; the whole picture
    if any of them is not in front of the eye."""
    r = (x - view[3]) @ view[:3].T
    if r[:, 2].min(initial=1.0) < 0.01:
        return np.array([0, 0, *size], np.int32)
    scale = lens[0] / r[:, 2:]
    at = lens[1:] + scale * r[:, :2] * np.array([1.0, -1.0], np.float32)
    edge = margin * scale + 3.0
    low, high = np.floor((at - edge).min(axis=0)), np.ceil((at + edge).max(axis=0))
    return np.concatenate([np.clip(low, 0, size), np.clip(high, 0, size)]).astype(np.int32)


@ti.func
def row(view, i: ti.template()):
    """Row i of a view: right, up, forward, eye."""
    return ti.Vector([view[i, 0], view[i, 1], view[i, 2]])


@ti.func
def ray(view, lens, u, v):
    """Direction d through image point (u, v) [pixels], scaled so that d.forward = 1: depth z is at eye + z d."""
    return row(view, 2) + ((u - lens[1]) / lens[0]) * row(view, 0) - ((v - lens[2]) / lens[0]) * row(view, 1)


@ti.func
def project(view, lens, x):
    """World point [m] -> (u, v, depth): pixels, pixels, metres along forward."""
    r = x - row(view, 3)
    depth = r.dot(row(view, 2))
    scale = lens[0] / ti.max(depth, 1e-6)
    return ti.Vector([lens[1] + scale * r.dot(row(view, 0)), lens[2] - scale * r.dot(row(view, 1)), depth])
