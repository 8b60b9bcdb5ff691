"""A scene file -> Config: layers laid over each other, cards inlined, every key checked, methods' Params read.

Order, later wins, key by key, a list replaces a list: `extends` chain < file < [quick] < overrides.
"""

from __future__ import annotations

import difflib
import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from sim import explain, fit, preset, registry, toml
from sim.errors import ConfigError
from sim.explain import Problem
from sim.model import Model
from sim.schema import VERSION, Config
from sim.shapes import Mesh

CONFIGS = Path(__file__).resolve().parents[1] / "configs"


class Choice(NamedTuple):
    """A key that names registered methods; their tables stand beside it, their Params go to `target`."""

    section: str
    key: str
    kind: str
    target: str | None


CHOICES = (
    Choice("fluid", "method", "fluid.pressure", "params"),
    Choice("fluid", "mover", "fluid.mover", None),
    Choice("fluid", "search", "search", None),
    Choice("fluid", "terms", "fluid.term", "term_params"),
    Choice("cloth", "method", "cloth.solver", "params"),
    Choice("cloth", "bending", "cloth.bending", "bending_params"),
    Choice("cloth", "self_contact", "cloth.self_contact", "self_contact_params"),
    Choice("cloth", "search", "search.boxes", None),
    Choice("coupling", "contact", "coupling.contact", "params"),
    Choice("coupling", "search", "search.boxes", None),
    Choice("wetting", "processes", "wetting", "params"),
)
"""Every choice of a method in a scene."""

CARDS = {"fluid": ("liquid", "liquids", "water"), "cloth": ("fabric", "fabrics", "cotton")}
"""Section -> (its table, folder of cards, the card taken when none is named)."""


@dataclass
class _Reading:
    """A scene on its way to a Config. origins: dotted key -> the file or option that wrote it last."""

    label: str
    raw: dict[str, Any] = field(default_factory=dict)
    origins: dict[str, str] = field(default_factory=dict)
    tables: dict[str, dict] = field(default_factory=dict)
    overridden: list[str] = field(default_factory=list)

    def refuse(self, found: list[Problem]) -> None:
        """Raise the first problem as one line, with the number of the others."""
        if not found:
            return
        key, text = found[0]
        value = self._value(key)
        shown = "" if value is None or isinstance(value, dict) else f" = {_short(toml.literal(value))}"
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise ConfigError(f"{self._origin(key)}: {key}{shown}: {text}{more}")

    def _value(self, key: str) -> Any:
        value: Any = self.raw
        for part in key.split("."):
            if not isinstance(value, dict):
                return None
            value = value.get(part, self.tables.get(key.split(".")[0], {}).get(part))
        return value

    def _origin(self, key: str) -> str:
        return self.origins.get(key, self.label)


def load(scene: str | Path, overrides: Iterable[str] = (), quick: bool = False, registry=registry) -> Config:
    """The frozen Config of a scene, SI throughout.

    scene: a name in configs/scenes, or a path. overrides: "key=value" texts, as of --set. registry: where methods are
    looked up; its folders are imported only once all else is right, so that a wrong key is told without Taichi.
    Raises ConfigError: one line that names file, key, value, and what it must be.
    """
    path = find("scenes", scene)
    reading = _Reading(_label(path))
    _read_layers(reading, path, overrides, quick)
    _read_cards(reading, path)
    config = _read_schema(reading)
    config = _find_meshes(reading, config, path.parent)
    reading.refuse(fit.problems(config))
    config = preset.filled_in(_wetted(_read_methods(reading, config, registry)))
    return config.model_copy(update={"warnings": fit.warnings(config)})


def find(folder: str, name: str | Path, beside: Path | None = None) -> Path:
    """The file of a name in configs/<folder>, or of a path (relative to the file `beside`, else to where we are)."""
    text = os.fspath(name)
    if text.endswith(".toml") or os.sep in text:
        path = (beside.parent if beside else Path()) / text
        if not path.is_file():
            raise ConfigError(f"{text}: no such file")
        return path
    path = CONFIGS / folder / f"{text}.toml"
    if not path.is_file():
        there = names(folder)
        near = difflib.get_close_matches(text, there, 1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ConfigError(f"{text}: no such {folder[:-1]}; {hint}there are {', '.join(there) or 'none'}")
    return path


def names(folder: str) -> list[str]:
    """The names in configs/<folder>: scenes, fabrics, liquids or studies."""
    return sorted(p.stem for p in (CONFIGS / folder).glob("*.toml"))


def card(folder: str, name: str, model: type[Model]) -> Any:
    """A card by itself, as its model: `card("fabrics", "silk", Fabric)`."""
    path = find(folder, name)
    table = toml.read(path, _label(path))
    reading = _Reading(_label(path), table)
    try:
        return model.model_validate({"name": path.stem, **table})
    except ValidationError as error:
        reading.refuse([explain.problem(e, model, table) for e in error.errors()])


def resolved_toml(config: Config) -> str:
    """The complete scene as TOML: extends, [quick], cards and defaults inlined; `load` of it gives an equal Config."""
    table = config.model_dump(exclude={"warnings"}, exclude_none=True)
    for choice in CHOICES:
        section, chosen = getattr(config, choice.section), choice.target
        if section is None or chosen is None:
            continue
        params = getattr(section, chosen)
        table[choice.section].pop(chosen, None)
        if getattr(section, choice.key) is None:
            continue
        named = params if isinstance(params, dict) else {getattr(section, choice.key): params}
        table[choice.section].update({name: p.model_dump(exclude_none=True) for name, p in named.items() if p})
    first = {key: table.pop(key) for key in ("name", "title", "overridden")}
    return toml.write({"schema": VERSION, **first, **{k: v for k, v in table.items() if v != {}}})


def differences(one: Config, other: Config, ignore: tuple[str, ...] = ()) -> list[str]:
    """Dotted keys, with both values, in which two configs differ."""
    left, right = (_flat(c.model_dump(exclude={"warnings"})) for c in (one, other))
    keys = [k for k in {**left, **right} if left.get(k) != right.get(k) and k not in ignore]
    there, here = (
        {k: toml.literal(side[k]) if side.get(k) is not None else "absent" for k in keys} for side in (left, right)
    )
    return [f"{k} = {there[k]} there, {here[k]} here" for k in keys]


def _flat(table: dict, key: str = "") -> dict[str, Any]:
    flat = {}
    for name, value in table.items():
        dotted = f"{key}.{name}" if key else name
        flat.update(_flat(value, dotted) if isinstance(value, dict) else {dotted: value})
    return flat


def _label(path: Path) -> str:
    """The path as the user would type it."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _read_layers(reading: _Reading, path: Path, overrides: Iterable[str], quick: bool) -> None:
    """extends < file < [quick] < overrides, into reading.raw."""
    chain = _extends_chain(path)
    for table, label in chain:
        reading.raw = toml.lay_over(reading.raw, table, label, reading.origins)
    reading.raw["name"] = chain[-1][0].get("name", path.stem)
    over = reading.raw.pop("quick", {})
    if quick and isinstance(over, dict):
        reading.raw = toml.lay_over(reading.raw, over, reading.label, reading.origins)
    for text in overrides:
        reading.raw = toml.lay_over(reading.raw, toml.assignment(text), "--set", reading.origins)


def _extends_chain(path: Path) -> list[tuple[dict, str]]:
    """Tables and labels from the farthest base to the file itself, `schema` checked and `extends` taken out."""
    chain, seen = [], set()
    while path:
        label = _label(path)
        if path.resolve() in seen:
            raise ConfigError(f"{label}: extends: goes round in a circle")
        seen.add(path.resolve())
        table = toml.read(path, label)
        _check_version(table.pop("schema", None), label)
        base = table.pop("extends", None)
        if base is not None and not isinstance(base, str):
            raise ConfigError(f"{label}: extends = {toml.literal(base)}: needs the name or path of a scene")
        chain.append((table, label))
        path = _named("scenes", base, path, f"{label}: extends") if base else None
    return chain[::-1]


def _check_version(version: Any, label: str) -> None:
    if version is None:
        raise ConfigError(f"{label}: schema: missing; write schema = {VERSION}")
    if isinstance(version, bool) or not isinstance(version, int) or not 1 <= version <= VERSION:
        raise ConfigError(f"{label}: schema = {toml.literal(version)}: this program reads schema {VERSION}")


def _named(folder: str, name: str, beside: Path, context: str) -> Path:
    try:
        return find(folder, name, beside)
    except ConfigError as error:
        raise ConfigError(f"{context} = {error}") from None


def _read_cards(reading: _Reading, path: Path) -> None:
    """Lay each section's own keys over its card. A table with a `name` is whole: its card is inlined already."""
    for section, (table, folder, default) in CARDS.items():
        above = reading.raw.get(section)
        if not isinstance(above, dict) or not isinstance(above.setdefault(table, {}), dict):
            continue
        inline = above[table]
        card = inline.pop("card", None if "name" in inline else default)
        if card is None:
            continue
        key = f"{section}.{table}"
        context = f"{reading._origin(key + '.card')}: {key}.card"
        if not isinstance(card, str):
            raise ConfigError(f"{context} = {toml.literal(card)}: needs the name of a card in configs/{folder}")
        file = _named(folder, card, path, context)
        below = toml.read(file, _label(file))
        below.setdefault("name", file.stem)
        reading.overridden += [f"{key}.{k}" for k, v in inline.items() if k in below and below[k] != v]
        of_card: dict[str, str] = {}
        above[table] = toml.lay_over(toml.lay_over({}, below, _label(file), of_card, key), inline, "", {})
        reading.origins.update({k: v for k, v in of_card.items() if k.rsplit(".", 1)[1] not in inline})


def _read_schema(reading: _Reading) -> Config:
    """Validate everything but the methods' own tables, which are set aside in reading.tables."""
    raw = dict(reading.raw)
    found = [Problem(k, explain.unknown(k, Config)) for k in raw if k in explain.derived(Config)]
    for section in {choice.section for choice in CHOICES}:
        if isinstance(raw.get(section), dict):
            model = explain.model_at(Config, [section], raw)
            keys = explain.keys(model)
            reading.tables[section] = {
                k: v
                for k, v in raw[section].items()
                if k not in keys and (isinstance(v, dict) or k in explain.derived(model))
            }
            raw[section] = {k: v for k, v in raw[section].items() if k not in reading.tables[section]}
    reading.refuse(found)
    if reading.overridden:
        raw["overridden"] = [*raw.get("overridden", ()), *reading.overridden]
    try:
        return Config.model_validate(raw)
    except ValidationError as error:
        reading.refuse([explain.problem(e, Config, raw) for e in error.errors()])
        raise


def _find_meshes(reading: _Reading, config: Config, beside: Path) -> Config:
    """The file and digest of every mesh. A run's folder has its own in meshes/, by the name of the solid."""
    found: list[Problem] = []
    solids = dict(config.solid)
    for name, solid in solids.items():
        if not isinstance(solid, Mesh):
            continue
        own = beside / "meshes" / f"{name}{Path(solid.file).suffix}"
        there = [f for f in (own, beside / solid.file, CONFIGS / "meshes" / solid.file) if f.is_file()]
        if not there:
            found.append(Problem(f"solid.{name}.file", "no such file beside the scene or in configs/meshes"))
            continue
        digest = hashlib.sha256(there[0].read_bytes()).hexdigest()
        if solid.digest not in ("", digest):
            found.append(Problem(f"solid.{name}.file", "is not the mesh that this scene was resolved with"))
        solids[name] = solid.model_copy(update={"found": str(there[0].resolve()), "digest": digest})
    reading.refuse(found)
    return config.model_copy(update={"solid": solids})


def _read_methods(reading: _Reading, config: Config, registry) -> Config:
    """Every choice is a registered method; every method's table is read by its Params."""
    registry.discover()
    found: list[Problem] = []
    for section in dict.fromkeys(choice.section for choice in CHOICES):
        chosen = getattr(config, section)
        if chosen is None:
            continue
        tables = dict(reading.tables.get(section, {}))
        update: dict[str, Any] = {}
        known: list[str] = []
        for choice in (c for c in CHOICES if c.section == section):
            methods = registry.methods(choice.kind)
            params = {}
            if choice.target:
                known += methods
                params = {n: _params(f"{section}.{n}", m, tables.pop(n, {}), found) for n, m in methods.items()}
            picked = getattr(chosen, choice.key)
            if picked is None:
                continue
            found += _not_there(f"{section}.{choice.key}", picked, methods)
            if choice.target:
                many = not isinstance(picked, str)
                update[choice.target] = {n: params.get(n) for n in picked} if many else params.get(picked)
        found += [Problem(f"{section}.{k}", explain.unknown(f"{section}.{k}", type(chosen), known)) for k in tables]
        config = config.model_copy(update={section: chosen.model_copy(update=update)})
    reading.refuse(found)
    return config


def _wetted(config: Config) -> Config:
    """What the fabric leaves to physics, once its liquid is known: suction and break-through pressure."""
    if not (config.cloth and config.fluid):
        return config
    fabric, tension = config.cloth.fabric, config.fluid.liquid.surface_tension
    by_form = {"capillary_pressure": fabric.capillary(tension), "break_through": fabric.threshold(tension)}
    missing = {key: value for key, value in by_form.items() if getattr(fabric, key) is None}
    cloth = config.cloth.model_copy(update={"fabric": fabric.model_copy(update=missing)})
    return config.model_copy(update={"cloth": cloth})


def _not_there(key: str, picked: str | tuple[str, ...], methods: dict[str, type]) -> list[Problem]:
    choices = [*methods, "none"] if key == "cloth.bending" else list(methods)
    wrong = [n for n in ((picked,) if isinstance(picked, str) else picked) if n not in choices]
    return [Problem(key, f"no method {toml.literal(n)}; choose from {', '.join(choices) or 'none'}") for n in wrong]


def _params(key: str, method: type, table: Any, found: list[Problem]) -> Model | None:
    model = getattr(method, "Params", Model)
    try:
        return model.model_validate(table)
    except ValidationError as error:
        found += [explain.problem(e, model, table, key) for e in error.errors()]
        return None
