"""What this machine can do, and what a scene asks of it: which limit binds the time step, and why a run failed."""

from __future__ import annotations

import importlib.metadata
import math
import os
import platform
import shutil
from pathlib import Path

from sim import config, guard, run
from sim.errors import SeepError
from sim.schema import Config

PACKAGES = ("taichi", "numpy", "pydantic", "imageio-ffmpeg", "matplotlib")


def machine() -> str:
    """Ten lines about this machine, each with what to do where something is missing."""
    rows = {
        "python": f"{platform.python_version()}, {platform.system()} {platform.machine()}",
        "packages": ", ".join(f"{name} {_version(name)}" for name in PACKAGES),
        "cores": f"{os.cpu_count()}",
        "memory": _memory(),
        "taichi": _taichi(),
        "arch": _archs(),
        "film": _encoder(),
        "window": "a display is there" if _display() else "no display: use view --capture DIR",
        "kernels": _cache(),
        "disk": f"{shutil.disk_usage(run.OUTPUTS.parent).free / 1e9:.1f} GB free for {run.OUTPUTS.name}/",
    }
    return "\n".join(f"{name:9} {text}" for name, text in rows.items())


def scene(name: str) -> str:
    """What a scene costs and which limit of the time step binds, before anything is run."""
    conf = config.load(name)
    rows = [("scene", f"{conf.name}: {conf.title}"), ("frames", f"{conf.run.frame_count} at {conf.run.fps} per second")]
    if conf.fluid:
        water = conf.fluid
        rows.append(("water", f"about {_particles(conf):,} particles of {1e3 * water.spacing:g} mm, {water.method}"))
    if conf.cloth:
        across, along = conf.cloth.node_counts
        triangles = 2 * (across - 1) * (along - 1)
        rows.append(("cloth", f"{across} x {along} nodes, {triangles:,} triangles, {conf.cloth.method}"))
    speed = guard.expected_speed(conf)
    rows.append(("speed", f"{speed:.2g} m/s expected; {guard.EXPLODING:g} times that is called exploding"))
    limits = sorted(_limits(conf).items(), key=lambda item: item[1])
    rows += [("dt", f"{seconds:.2g} s by {what}") for what, seconds in limits]
    rows.append(("binds", limits[0][0]))
    rows += [("warning", text) for text in conf.warnings]
    failed = [folder for folder in run.runs(conf.name)[-1:] if folder.record().get("state") == "diverged"]
    rows += [("last run", f"{folder.label}: {folder.record().get('reason')}") for folder in failed]
    return "\n".join(f"{title:9} {text}" for title, text in rows)


def _limits(conf: Config) -> dict[str, float]:
    """Bounds of the time step at the speed expected [s]."""
    limits = {"run.dt_max": conf.run.dt_max, "one frame": 1.0 / conf.run.fps}
    if conf.fluid:
        water, speed = conf.fluid, guard.expected_speed(conf)
        smoothing = 0.5 * water.support_radius
        if sound := getattr(water.params, "sound_speed", None):
            limits["sound speed, 0.25 h/(c + U)"] = 0.25 * smoothing / (sound + speed)
        if cfl := getattr(water.params, "cfl", None):
            limits["water moving, cfl dx/U"] = cfl * water.spacing / speed
        if water.liquid.nu > 0:
            limits["viscosity, 0.125 h^2/nu"] = 0.125 * smoothing**2 / water.liquid.nu
    return limits


def _particles(conf: Config) -> int:
    """Those of blocks, and all that the streams pour until the end."""
    volume = sum(math.prod(b - a for a, b in zip(block.low, block.high)) for block in conf.fluid.block.values())
    for stream in conf.emitter.values():
        end = conf.run.duration if stream.repeat or stream.stop is None else min(stream.stop, conf.run.duration)
        volume += stream.rate * max(0.0, end - stream.start)
    return round(volume / conf.fluid.spacing**3)


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "missing (make)"


def _memory() -> str:
    try:
        pages, free = os.sysconf("SC_PHYS_PAGES"), os.sysconf("SC_AVPHYS_PAGES")
        size = os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return "unknown"
    return f"{pages * size / 1e9:.1f} GB, {free * size / 1e9:.1f} GB free"


def _taichi() -> str:
    try:
        from sim import runtime

        runtime.start()
    except ImportError as error:
        return f"does not load: {error}; install libX11 (Debian: apt install libx11-6)"
    except SeepError as error:
        return str(error)
    return "runs on the cpu"


def _archs() -> str:
    """Backends whose driver Taichi finds here; a scene chooses by --arch."""
    try:
        from taichi._lib import core
    except ImportError:
        return "none"
    found = [name for name in ("cuda", "vulkan", "metal") if getattr(core, f"with_{name}", lambda: False)()]
    return ", ".join(["cpu", *found])


def _encoder() -> str:
    try:
        import imageio_ffmpeg

        return f"H.264 by {Path(imageio_ffmpeg.get_ffmpeg_exe()).name}"
    except (ImportError, RuntimeError) as error:
        return f"no encoder: {error}"


def _display() -> bool:
    return platform.system() != "Linux" or bool(os.environ.get("DISPLAY"))


def _cache() -> str:
    try:
        from sim import runtime
    except ImportError:
        return "none kept"
    folder = runtime.cache_folder()
    size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()) if folder.is_dir() else 0
    return f"{size / 1e6:.0f} MB compiled, kept in {folder}"
