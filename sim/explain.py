"""What is wrong with a scene, in the user's words: pydantic's findings turned into keys and plain text."""

from __future__ import annotations

import difflib
import typing
from collections.abc import Iterable
from typing import Any, NamedTuple

from sim import units
from sim.model import Model, range_of
from sim.schema import Config
from sim.shapes import SHAPES


class Problem(NamedTuple):
    """A dotted key and what is wrong with it, as the end of an error line."""

    key: str
    text: str


def problem(error: dict, model: type[Model], raw: Any, prefix: str = "") -> Problem:
    """What pydantic found, in the user's words."""
    path = _path(error["loc"], raw)
    key = ".".join([prefix, *path] if prefix else path)
    here = model_at(model, path[:-1], raw) if path else model
    kind, context = error["type"], error.get("ctx", {})
    if kind == "extra_forbidden":
        return Problem(key, unknown(key, here))
    if kind == "missing":
        bounds = range_of(here, path[-1]) if here and path[-1] in here.model_fields else None
        return Problem(key, f"missing; {units.needs(bounds.dimension)}" if bounds else "missing")
    if kind == "literal_error":
        return Problem(key, f"choose from {context['expected'].replace(' or ', ', ').replace(chr(39), '')}")
    if kind.startswith("union_tag"):
        return Problem(f"{key}.shape", f"choose from {', '.join(SHAPES)}")
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return Problem(key, f"must be a table: [{key}]")
    if kind == "tuple_type":
        return Problem(key, 'must be a list, such as ["a", "b"]')
    return Problem(key, error["msg"][:1].lower() + error["msg"][1:] if kind != "seep" else error["msg"])


def _path(loc: tuple, raw: Any) -> list[str]:
    """The keys of a location, without the union tags and list places that pydantic adds."""
    path: list[str] = []
    table = raw
    for part in loc:
        if isinstance(part, int) or (isinstance(table, dict) and part not in table and part == table.get("shape")):
            continue
        path.append(str(part))
        table = table.get(part) if isinstance(table, dict) else None
    return path


def unknown(key: str, model: type[Model] | None, more: Iterable[str] = ()) -> str:
    """'unknown key; did you mean fluid.spacing?': the nearest beside it, else the same name anywhere in a scene."""
    table, _, name = key.rpartition(".")
    beside = [*keys(model), *more] if model else list(more)
    near = difflib.get_close_matches(name, beside, 1, 0.6)
    if near:
        return f"unknown key; did you mean {table + '.' if table else ''}{near[0]}?"
    elsewhere = [k for k in _all_keys(Config) if k.rpartition(".")[2] == name]
    if elsewhere:
        return f"unknown key; did you mean {elsewhere[0]}?"
    return f"unknown key; {table or 'a scene'} has {', '.join(beside) or 'no keys'}"


def keys(model: type[Model]) -> list[str]:
    """The keys that a scene may write in this table."""
    return [name for name in model.model_fields if name not in derived(model)]


def derived(model: type[Model]) -> list[str]:
    """The fields that loading fills in."""
    extras = {name: f.json_schema_extra for name, f in model.model_fields.items()}
    return [name for name, extra in extras.items() if isinstance(extra, dict) and extra.get("derived")]


def _all_keys(model: type[Model], key: str = "") -> list[str]:
    found = []
    for name in keys(model):
        dotted = f"{key}.{name}" if key else name
        found.append(dotted)
        for below, named in _models(model.model_fields[name].annotation):
            found += _all_keys(below, f"{dotted}.NAME" if named else dotted)
    return list(dict.fromkeys(found))


def _models(annotation: Any, named: bool = False) -> list[tuple[type[Model], bool]]:
    """Every Model in an annotation, and whether it stands in a dict of named tables."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        return [(annotation, named)]
    named = named or typing.get_origin(annotation) is dict
    return [found for part in typing.get_args(annotation) for found in _models(part, named)]


def model_at(model: type[Model], path: list[str], raw: Any) -> type[Model] | None:
    """The Model of the table at a path; among shapes the one that the scene names."""
    here: type[Model] | None = model
    waiting: list[type[Model]] = []
    for part in path:
        raw = raw.get(part) if isinstance(raw, dict) else None
        if waiting:
            shape = raw.get("shape") if isinstance(raw, dict) else None
            here = next((m for m in waiting if m.__name__.lower() == shape), waiting[0])
            waiting = []
            continue
        if here is None or part not in here.model_fields:
            return None
        below = _models(here.model_fields[part].annotation)
        waiting = [m for m, named in below if named]
        here = below[0][0] if below else None
    return here
