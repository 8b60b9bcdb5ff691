"""Methods by kind and name. A method lives in its own file and enters by `@register(kind, name)`."""

import importlib
import pkgutil

from sim.errors import ConfigError

_METHODS: dict[str, dict[str, type]] = {}
_FOLDERS = ("sim.search", "sim.fluid", "sim.cloth", "sim.coupling", "sim.wetting")


def register(kind: str, name: str):
    """Class decorator: make `cls` selectable in a scene as `name` among the methods of `kind`."""

    def enter(cls: type) -> type:
        methods = _METHODS.setdefault(kind, {})
        if methods.get(name, cls) is not cls:
            raise ValueError(f"{kind} method {name} is registered twice")
        methods[name] = cls
        cls.kind, cls.name = kind, name
        return cls

    return enter


def discover() -> None:
    """Import the method folders, so that every `@register` in them has run."""
    for folder in _FOLDERS:
        package = importlib.import_module(folder)
        for module in pkgutil.walk_packages(package.__path__, folder + "."):
            importlib.import_module(module.name)


def methods(kind: str) -> dict[str, type]:
    """Every method of `kind` by name, sorted by name."""
    return dict(sorted(_METHODS.get(kind, {}).items()))


def kinds() -> list[str]:
    """Every kind that has a method."""
    return sorted(_METHODS)


def method(kind: str, name: str) -> type:
    """The class registered for `name`; ConfigError naming the choices if there is none."""
    found = _METHODS.get(kind, {})
    if name not in found:
        raise ConfigError(f"{kind}: no method {name!r}; choose from {', '.join(sorted(found)) or 'none'}")
    return found[name]
