"""What this machine can do."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
from pathlib import Path

from sim import run
from sim.errors import SeepError

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
