"""Pictures: geometry, light and water of render.draw, drawn in other processes."""

import multiprocessing
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pytest

from render.draw import Look, draw
from sim import runtime
from sim.frame import Frame, Static

ROOT = Path(__file__).parent.parent
SIZE = (160, 90)
SPACING = 0.0025
LIMIT = 120  # [s] for a picture, the first of a size included


def far_draw(frame: Frame, look: Look, static: Static) -> np.ndarray:
    """draw, in the process of the fixture below."""
    return draw(frame, look, static)


def _far(pool, what, *scene):
    return pool.apply_async(what, scene).get(LIMIT)


@pytest.fixture(scope="module")
def render():
    """Look and draw; pictures are drawn in one other process, so that no Taichi runs in this one."""
    with multiprocessing.get_context("spawn").Pool(1, runtime.start, ("cpu", 2)) as pool:
        far = {name: partial(_far, pool, what) for name, what in (("draw", far_draw), ("depths", depths_of))}
        yield SimpleNamespace(Look=Look, **far)


def empty() -> tuple[Frame, Static]:
    static = Static(np.float32(0), np.float32(-0.005), np.array([0.69, 0.13, 0.04], np.float32))
    return Frame(np.float64(0)), static


def sheet(saturation: float, side: float = 0.12, z: float = 0.1, n: int = 9) -> tuple[Frame, Static]:
    """A level square of cloth."""
    frame, static = empty()
    axis = np.linspace(-side / 2, side / 2, n)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    static.cloth_triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    static.cloth_uv = np.stack([u, v], -1).reshape(-1, 2).astype(np.float32)
    frame.cloth_x = np.stack([u, v, np.full_like(u, z)], -1).reshape(-1, 3).astype(np.float32)
    frame.cloth_saturation = np.full(n * n, saturation, np.float32)
    frame.cloth_film = np.zeros(n * n, np.float32)
    return frame, static


def pour(frame: Frame, static: Static, x: np.ndarray, mass: float = 1000.0 * SPACING**3) -> None:
    """Add water particles."""
    static.spacing = np.float32(SPACING)
    static.fluid_absorption = np.float32((12.0, 3.0, 1.8))
    frame.fluid_id = np.arange(len(x), dtype=np.int32)
    frame.fluid_x, frame.fluid_v = x.astype(np.float32), np.zeros(x.shape, np.float32)
    frame.fluid_mass = np.full(len(x), mass, np.float32)


def slab(side: float, depth: float, z: float) -> np.ndarray:
    """A lattice of particles, side x side x depth, its floor at z."""
    level = np.arange(-side / 2 + SPACING / 2, side / 2, SPACING)
    height = z + np.arange(SPACING / 2, depth, SPACING)
    return np.stack(np.meshgrid(level, level, height, indexing="ij"), -1).reshape(-1, 3)


def pixel_of(draw, look, point) -> tuple[int, int]:
    """(row, column) at which a world point is drawn, by plain NumPy."""
    from render.camera import lens, look_at

    view, (focal, cx, cy) = look_at(look.eye, look.target), lens(look.size, look.fov)
    u, v, depth = view[:3] @ (np.asarray(point) - view[3])
    return int(cy - focal * v / depth), int(cx + focal * u / depth)


def test_empty_scene_is_ground_below_and_sky_above(render):
    look = render.Look(size=SIZE, target=(0.0, 0.0, 0.33), fov=1.0)
    frame, static = empty()
    picture = render.draw(frame, look, static).astype(int)
    assert picture.shape == (90, 160, 3)
    assert picture[:10].std(axis=1).max() < 3.0
    assert picture[-30:].max() - picture[-30:].min() > 25 and picture.min() > 60


def test_cloth_is_where_it_is_projected(render):
    frame, static = sheet(0.0)
    look = render.Look(size=SIZE)
    picture = render.draw(frame, look, static).astype(int)
    for x in ((0.0, 0.0, 0.1), (0.055, 0.055, 0.1), (-0.055, 0.055, 0.1), (0.055, -0.055, 0.1)):
        red, green, blue = picture[pixel_of(render, look, x)]
        assert red > green + 40 and green > blue
    for x in ((0.075, 0.0, 0.1), (0.0, -0.075, 0.1)):
        red, _, blue = picture[pixel_of(render, look, x)]
        assert abs(red - blue) < 30


def test_edges_are_smooth(render):
    frame, static = sheet(0.0)
    picture = render.draw(frame, render.Look(size=SIZE), static).astype(int)
    redness = picture[..., 0] - picture[..., 2]
    inside = redness.max()
    part = ((redness > 0.15 * inside) & (redness < 0.6 * inside)).sum()
    assert part > 25  # pixels partly covered, along an outline of some 150


def test_wet_cloth_is_darker_and_between_dry_and_soaked(render):
    look = render.Look(size=SIZE)
    levels = []
    for saturation in (0.0, 0.5, 1.0):
        frame, static = sheet(saturation)
        row, column = pixel_of(render, look, (0.0, 0.0, 0.1))
        patch = render.draw(frame, look, static)[row - 4 : row + 4, column - 4 : column + 4]
        levels.append(((patch / 255.0) ** 2.2).mean(axis=(0, 1)))
    assert levels[0][0] > levels[1][0] > levels[2][0]
    assert 0.3 < levels[2][0] / levels[0][0] < 0.75
    assert levels[2][1] / levels[2][0] < levels[0][1] / levels[0][0]  # and more saturated


def test_particles_are_balls_coloured_by_speed_and_hidden_by_cloth(render):
    look = render.Look(size=SIZE, water="particles")
    frame, static = sheet(0.0)
    places = np.array([[0.03, -0.03, 0.105], [-0.03, -0.03, 0.105], [0.0, 0.0, 0.09]])
    pour(frame, static, places, mass=1e-3)
    frame.fluid_v[1] = 3.0
    slow, fast, under = (render.draw(frame, look, static)[pixel_of(render, look, x)].astype(int) for x in places)
    assert slow[2] > slow[0] + 40
    assert fast.min() > slow.max()
    assert under[0] > under[2] + 40


def test_water_is_clear_not_teal(render):
    frame, static = empty()
    look = render.Look(size=SIZE, target=(0.0, 0.0, 0.0))
    dry = render.draw(frame, look, static).astype(float)
    pour(frame, static, slab(0.12, 0.01, -0.005))
    wet = render.draw(frame, look, static).astype(float)
    row, column = pixel_of(render, look, (0.0, 0.0, 0.005))
    here = np.s_[row - 5 : row + 5, column - 10 : column + 10]
    shift = wet[here].mean(axis=(0, 1)) - dry[here].mean(axis=(0, 1))
    assert np.abs(wet - dry).max() > 8  # it is seen
    assert np.abs(shift - shift.mean()).max() < 14 and np.abs(shift).max() < 45


def test_still_water_mirrors_more_at_a_grazing_angle(render):
    shine = []
    for eye in ((0.0, -0.10, 0.5), (0.0, -0.5, 0.20)):
        frame, static = sheet(1.0, z=0.0)
        look = render.Look(size=SIZE, eye=eye, target=(0.0, 0.0, 0.01), fov=0.15)
        dry = render.draw(frame, look, static).astype(float)
        pour(frame, static, slab(0.10, 0.01, 0.0005))
        blue = (render.draw(frame, look, static) - dry)[35:55, 60:100, 2]
        shine.append(blue.mean())
    assert shine[1] > shine[0] + 60


def test_ground_away_from_a_moving_cloth_keeps_its_bits(render):
    look, pictures = render.Look(size=SIZE), []
    for lift in (0.0, 0.002):
        frame, static = sheet(0.0)
        frame.cloth_x[:, 2] += lift
        pictures.append(render.draw(frame, look, static))
    changed = (pictures[0] != pictures[1]).any(axis=2)
    assert changed.any() and not changed[:, -30:].any() and not changed[:, :10].any()


@pytest.mark.parametrize("volume", [1.0, 8.0])
def test_a_lone_drop_is_as_large_as_its_mass(render, volume):
    frame, static = empty()
    look = render.Look(size=(320, 180), eye=(0.0, -0.16, 0.22), target=(0.0, 0.0, 0.1), fov=0.2)
    dry = render.draw(frame, look, static).astype(int)
    pour(frame, static, np.array([[0.0, 0.0, 0.1]]), volume * 1000.0 * SPACING**3)
    changed = np.abs(render.draw(frame, look, static).astype(int) - dry).max(axis=2) > 2
    radius = (3.0 * volume / (4.0 * np.pi)) ** (1.0 / 3.0) * SPACING * 90.0 / np.tan(0.1) / 0.2
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    height, width = np.ptp(rows) + 1, np.ptp(columns) + 1
    assert abs(width - 2 * radius) <= 2 and abs(height - 2 * radius) <= 3


def test_water_behind_cloth_is_not_seen(render):
    frame, static = sheet(0.0, side=0.2)
    look = render.Look(size=SIZE, target=(0.0, 0.0, 0.1))
    dry = render.draw(frame, look, static)
    pour(frame, static, slab(0.05, 0.01, 0.088))
    assert np.abs(render.draw(frame, look, static).astype(int) - dry).max() <= 1


def test_water_between_solids_is_seen_through_the_near_wall(render):
    frame, static = empty()
    look = render.Look(size=SIZE, target=(0.0, 0.0, 0.02))
    boxes = [
        box_between((-0.074, -0.074, -0.004), (0.074, 0.074, 0.0)),
        box_between((-0.074, -0.074, 0.018), (0.074, -0.07, 0.022)),
    ]
    static.solid_x = np.concatenate([b[0] for b in boxes]).astype(np.float32)
    static.solid_triangles = np.concatenate([b[1] + 8 * n for n, b in enumerate(boxes)]).astype(np.int32)
    dry = render.draw(frame, look, static).astype(int)
    pour(frame, static, slab(0.13, 0.006, 0.0))
    wet = render.draw(frame, look, static).astype(int)
    row, column = pixel_of(render, look, (0.0, -0.06, 0.006))
    assert np.abs(wet - dry)[row - 2 : row + 3, column - 4 : column + 4].max() > 3


@pytest.mark.parametrize("stands_out, seen", [(0.002, False), (0.008, True)], ids=["a rim", "a block"])
def test_a_rim_does_not_come_through_the_cloth_over_it(render, stands_out, seen):
    frame, static = sheet(0.0)  # meshes of 15 mm, whose facets lie up to 2 mm below a rim
    look = render.Look(size=SIZE)
    static.solid_x, static.solid_triangles = box_between((-0.03, -0.03, 0.05), (0.03, 0.03, 0.1 + stands_out))
    static.solid_x, static.solid_opaque = static.solid_x.astype(np.float32), np.int32(12)
    row, column = pixel_of(render, look, (0.0, 0.0, 0.1))
    red, _, blue = render.draw(frame, look, static).astype(int)[row, column]
    assert (red < blue + 30) if seen else (red > blue + 40)


def box_between(low, high) -> tuple[np.ndarray, np.ndarray]:
    """Corners and triangles, outwards, of a box of glass."""
    corners = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    low, high = np.array(low, float), np.array(high, float)
    return low + corners * (high - low), np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def test_images_stand_behind_each_wall_and_behind_corners():
    from render.walls import images

    floor, left = box_between((-1, -1, -0.1), (1, 1, 0)), box_between((-0.1, -1, 0), (0, 1, 1))
    points, triangles = np.concatenate([floor[0], left[0]]), np.concatenate([floor[1], left[1] + 8])
    x = np.array([[0.03, 0.2, 0.04], [0.5, 0.2, 0.05], [0.5, 0.2, 0.5]])
    rows, places, planes = images(x, 0.1, points, triangles)
    found = sorted((int(r), *np.round(p.astype(float), 6).tolist()) for r, p in zip(rows, places))
    expected = [(0, -0.03, 0.2, -0.04), (0, -0.03, 0.2, 0.04), (0, 0.03, 0.2, -0.04), (1, 0.5, 0.2, -0.05)]
    assert found == expected
    gaps = {(int(r), round(float(p[3]), 6)) for r, p in zip(rows, planes)}
    assert gaps >= {(0, 0.03), (0, 0.04), (1, 0.05)}
    assert len(images(x, 0.7, points, triangles)[0]) == 0  # walls narrower than four spacings


def depths_of(frame: Frame, look: Look, static: Static) -> np.ndarray:
    """Depth of the drawn water in each pixel [m]."""
    from render import draw as drawing

    draw(frame, look, static)
    return drawing._renderers[look.size].water.depths.to_numpy()


def test_water_fills_the_corner_behind_glass_and_lies_flat_on_it(render):
    """Seen straight through the near wall, its surface is the wall's inner face from corner to corner."""
    frame, static = empty()
    walls = (
        ((-0.04, -0.024, -0.004), (0.04, 0.024, 0.0)),
        ((-0.04, -0.024, 0.0), (0.04, -0.02, 0.06)),
        ((-0.04, 0.02, 0.0), (0.04, 0.024, 0.06)),
        ((-0.04, -0.02, 0.0), (-0.02, 0.02, 0.06)),
        ((0.02, -0.02, 0.0), (0.04, 0.02, 0.06)),
    )
    boxes = [box_between(*wall) for wall in walls]
    static.solid_x = np.concatenate([b[0] for b in boxes]).astype(np.float32)
    static.solid_triangles = np.concatenate([b[1] + 8 * n for n, b in enumerate(boxes)]).astype(np.int32)
    pour(frame, static, slab(0.04, 0.04, 0.0))
    look = render.Look(size=SIZE, eye=(0.0, -0.4, 0.02), target=(0.0, 0.0, 0.02), fov=0.15)
    depth = render.depths(frame, look, static)
    tall, wide = pixel_of(render, look, (0.0, -0.02, 0.001))[0], pixel_of(render, look, (0.0185, -0.02, 0.02))[1]
    seen = depth[90 - tall + 2 : tall, 160 - wide : wide]
    assert seen.size > 2000
    assert seen == pytest.approx(0.38, abs=1e-5)


SAME_BITS = """
import hashlib, sys
sys.path[:0] = [{root!r}, {tests!r}]
from sim import runtime
runtime.start(threads=int(sys.argv[1]))
from render import draw, ripple, splat, water
import test_render as t
frame, static = t.sheet(0.4)
if sys.argv[2] == "water":
    t.pour(frame, static, t.slab(0.06, 0.02, 0.1))
look = draw.Look(size=t.SIZE)
pictures = [draw.draw(frame, look, static).tobytes() for _ in range(2)]
assert pictures[0] == pictures[1]
kernels = [k._primal for m in (water, ripple, splat) for k in vars(m).values() if hasattr(k, "_primal")]
print(hashlib.sha256(pictures[0]).hexdigest(), sum(len(k.compiled_kernels) for k in kernels))
"""


def in_process(threads: int, what: str) -> list[str]:
    code = SAME_BITS.format(root=str(ROOT), tests=str(ROOT / "tests"))
    done = subprocess.run([sys.executable, "-c", code, str(threads), what], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_same_bits_on_one_and_two_threads():
    one, two = in_process(1, "water"), in_process(2, "water")
    assert one == two and int(one[1]) >= 5


def test_cloth_alone_compiles_no_water_kernel():
    assert in_process(1, "cloth")[1] == "0"


def test_png_and_film_have_the_very_size(tmp_path):
    from render.film import write_film
    from render.image import write_png
    from sim.errors import ConfigError

    pictures = [np.full((356, 634, 3), 20 * i, np.uint8) for i in range(5)]
    write_png(tmp_path / "a.png", pictures[3])
    assert np.array_equal(iio.imread(tmp_path / "a.png"), pictures[3])
    assert write_film(tmp_path / "a.mp4", iter(pictures), (634, 356), 30) == 5
    film = iio.imread(tmp_path / "a.mp4", plugin="FFMPEG")
    assert film.shape == (5, 356, 634, 3) and abs(int(film[3].mean()) - 60) < 6
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mp4", "a.png"]
    with pytest.raises(ConfigError, match="even"):
        write_film(tmp_path / "b.mp4", iter(pictures), (633, 356), 30)
