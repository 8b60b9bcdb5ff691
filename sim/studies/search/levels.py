"""The boxes of a tree over a sheet, level by level."""

from pathlib import Path

import numpy as np

from sim.errors import ConfigError, RunError


def write(path: Path, frame, static) -> None:
    """Boxes of the report's tree over the cloth of a frame, as .npz: level (k,), low, high (k, 3) [m]; leaves last.

    As in the report's Figures 2 and 3 a patch's box is at least as thick as the fabric. Taichi must have been started.
    """
    if frame.cloth_x is None:
        raise ConfigError("compare tree: this run has no cloth")
    import taichi as ti

    from sim.search.bvh import BoxBvh

    corners = frame.cloth_x[static.cloth_triangles].reshape(-1, 6, 3)
    thin = np.maximum(0.5 * (static.cloth_thickness - np.ptp(corners, axis=1)), 0.0)
    low, high = (ti.Vector.field(3, float, shape=len(corners)) for _ in range(2))
    low.from_numpy((corners.min(1) - thin).astype(np.float32))
    high.from_numpy((corners.max(1) + thin).astype(np.float32))
    tree = BoxBvh(len(corners))
    tree.build(low, high)
    nodes = tree.node.to_numpy()
    level = np.zeros(tree.node_count, np.int32)
    for i in np.flatnonzero(nodes["leaf"] < 0):  # a node stands before its children
        level[[i + 1, nodes["skip"][i + 1]]] = level[i] + 1
    try:
        np.savez(path, level=level, low=nodes["low"], high=nodes["high"])
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror}") from error
