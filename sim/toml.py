"""TOML in and out: files read with plain error lines, tables laid over each other, text that reads back equal."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from sim.errors import ConfigError

Table = dict[str, Any]


def read(path: Path, label: str) -> Table:
    """The tables of a file. ConfigError, with the line, if it is not TOML."""
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8"))
    except UnicodeDecodeError:
        raise ConfigError(f"{label}: not TOML: not UTF-8 text") from None
    except OSError as error:
        raise ConfigError(f"{label}: cannot read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{label}: {_plain(str(error))}") from None


def _plain(message: str) -> str:
    """'Expected ... (at line 14, column 3)' -> 'line 14: not TOML: expected ...'."""
    match = re.fullmatch(r"(.*) \(at line (\d+), column \d+\)", message)
    text, line = (match[1], f"line {match[2]}: ") if match else (message.removesuffix(" (at end of document)"), "")
    return f"{line}not TOML: {text[:1].lower()}{text[1:]}"


def assignment(text: str) -> Table:
    """`fluid.spacing=2 mm` -> {"fluid": {"spacing": "2 mm"}}. What is no TOML value is taken as a text."""
    key, equals, value = text.partition("=")
    parts = [part.strip() for part in key.split(".")]
    if not equals or not all(parts):
        raise ConfigError(f"--set {text}: needs KEY=VALUE, such as fluid.spacing=2mm")
    try:
        read_value = tomllib.loads(f"value = {value}")
        table = read_value["value"] if list(read_value) == ["value"] else value.strip()
    except tomllib.TOMLDecodeError:
        table = value.strip()
    for part in reversed(parts):
        table = {part: table}
    return table


def lay_over(below: Table, above: Table, label: str, origins: dict[str, str], key: str = "") -> Table:
    """`above` over `below`, key by key; a list replaces a list. origins: dotted key -> label of who
    wrote it last (of a table: first)."""
    merged = dict(below)
    for name, value in above.items():
        dotted = f"{key}.{name}" if key else name
        if not isinstance(value, dict):
            origins[dotted] = label
        else:
            origins.setdefault(dotted, label)
            under = merged.get(name)
            value = lay_over(under if isinstance(under, dict) else {}, value, label, origins, dotted)
        merged[name] = value
    return merged


def write(table: Table) -> str:
    """The text of a table; floats to the last bit, None and empty tables left out, in the order given."""
    return "\n".join(_lines(table, "")).lstrip("\n") + "\n"


def _lines(table: Table, key: str) -> list[str]:
    plain = {k: v for k, v in table.items() if v is not None and not isinstance(v, dict)}
    lines = [f"{_name(k)} = {literal(v)}" for k, v in plain.items()]
    if key and lines:
        lines = ["", f"[{key}]", *lines]
    for name, value in table.items():
        if isinstance(value, dict):
            lines += _lines(value, f"{key}.{_name(name)}" if key else _name(name))
    return lines


def literal(value: Any) -> str:
    """One value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(literal(v) for v in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_name(k)} = {literal(v)}" for k, v in value.items()) + " }"
    return repr(value) if isinstance(value, (int, float)) else str(value)


def _name(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else literal(key)
