"""The base of every table in a scene: frozen, no unknown keys, numbers with units and ranges.

class Params(Model):
    sound_speed: float = quantity("30 m/s", "speed", gt=0, why="10 x the expected speed")
    iterations_max: int = quantity(100, ge=1, le=100000, why="a cap; the residual ends it sooner")
    warm_start: bool = option(True, why="starts from the last step's pressure")
    form: Literal["tube", "bed"] = option("tube", why="...")
"""

from __future__ import annotations

import math
import typing
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from sim import units

REQUIRED = ...
"""The default of a key that a scene must give."""


@dataclass(frozen=True)
class Range:
    """What a number must be: dimension (a name in sim.units.DIMENSIONS), and bounds, each None if it has none."""

    dimension: str = "number"
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def bounded(self) -> bool:
        """Whether there is any bound."""
        return (self.gt, self.ge, self.lt, self.le) != (None, None, None, None)

    def words(self) -> str:
        """As the user reads it: "lie in (0, 1)", "be > 0", ..."""
        low = self.gt if self.gt is not None else self.ge
        high = self.lt if self.lt is not None else self.le
        if low is not None and high is not None:
            return f"lie in {'(' if self.gt is not None else '['}{low:g}, {high:g}{')' if self.lt is not None else ']'}"
        if low is not None:
            return f"be {'>' if self.gt is not None else '>='} {low:g}"
        return f"be {'<' if self.lt is not None else '<='} {high:g}"

    def holds(self, value: float) -> bool:
        """Whether the value lies within every bound."""
        return (
            (self.gt is None or value > self.gt)
            and (self.ge is None or value >= self.ge)
            and (self.lt is None or value < self.lt)
            and (self.le is None or value <= self.le)
        )


def quantity(
    default: Any = REQUIRED,
    dimension: str | None = None,
    *,
    gt: float | None = None,
    ge: float | None = None,
    lt: float | None = None,
    le: float | None = None,
    why: str = "",
) -> Any:
    """A number, or a tuple of numbers (or of such tuples), by the field's annotation.

    dimension: a name ("speed") or a unit ("m/s"); left out, it is that of the default. Bounds are in SI. A string in
    a scene must carry a unit of this dimension; a bare number is SI. `why` is the reason of the default.
    """
    text = isinstance(default, str) and default[:1] in "+-.0123456789"
    if dimension is None:
        dimension = units.name_of(units.parse(default)[1]) if text else "number"
    bounds = Range(units.dimension(dimension), gt, ge, lt, le)
    if isinstance(default, (list, tuple)):
        default = tuple(_number(v, bounds) if isinstance(v, str) else v for v in default)
    elif text:
        default = _number(default, bounds)
    return Field(default, description=why, json_schema_extra={"range": bounds})


def option(default: Any = REQUIRED, *, why: str = "") -> Any:
    """A choice, a switch or a text: anything that is not a number."""
    return Field(default, description=why)


def fault(text: str) -> PydanticCustomError:
    """What a validator raises; `text` ends the error line."""
    return PydanticCustomError("seep", "{text}", {"text": text})


class Model(BaseModel):
    """A frozen table of a scene. Unknown keys are refused; numbers are read and checked by their `quantity`."""

    model_config = ConfigDict(frozen=True, extra="forbid", protected_namespaces=())

    @field_validator("*", mode="before")
    @classmethod
    def _read(cls, value: Any, info: ValidationInfo) -> Any:
        field = cls.model_fields[info.field_name]
        extra = field.json_schema_extra
        kind = _without_none(field.annotation)
        if isinstance(extra, dict) and "range" in extra and not _is_word(value, kind):
            return _shaped(value, kind, extra["range"])
        if kind is bool and not isinstance(value, bool):
            raise fault("must be true or false")
        if kind is str and not isinstance(value, str):
            raise fault('must be a text in quotes, such as "name"')
        return value


def range_of(model: type[Model], name: str) -> Range | None:
    """The Range of a field made by `quantity`; None for other fields."""
    extra = model.model_fields[name].json_schema_extra
    return extra.get("range") if isinstance(extra, dict) else None


def _without_none(annotation: Any) -> Any:
    rest = [a for a in typing.get_args(annotation) if a is not type(None)]
    optional = type(None) in typing.get_args(annotation)
    return rest[0] if optional and len(rest) == 1 else annotation


def _is_word(value: Any, kind: Any) -> bool:
    """Whether the annotation lets this very word stand for a number, as in `Literal["auto"] | int`."""
    words = [w for a in typing.get_args(kind) if typing.get_origin(a) is typing.Literal for w in typing.get_args(a)]
    return isinstance(value, str) and value in words


def _shaped(value: Any, kind: Any, bounds: Range) -> Any:
    if typing.get_origin(kind) is not tuple:
        return _number(value, bounds, kind is int or int in typing.get_args(kind))
    inner, length = typing.get_args(kind)[0], len(typing.get_args(kind))
    if typing.get_args(kind)[-1] is Ellipsis:
        if not isinstance(value, (list, tuple)) or not value:
            many = "lists of three, each" if typing.get_origin(inner) is tuple else "entries, each"
            raise fault(f"needs a list of {many} {units.DIMENSIONS[bounds.dimension][1]}")
        return tuple(_shaped(v, inner, bounds) for v in value)
    if not isinstance(value, (list, tuple)) or len(value) != length:
        raise fault(f"needs a list of {length}, each {units.DIMENSIONS[bounds.dimension][1]}")
    return tuple(_number(v, bounds, inner is int) for v in value)


def _number(value: Any, bounds: Range, whole: bool = False) -> float | int:
    """The value in SI, or a fault that says what it needs."""
    needs = units.needs(bounds.dimension)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise fault(needs)
    if isinstance(value, str):
        value = _with_unit(value, bounds.dimension, needs)
    if not math.isfinite(value):
        raise fault("must be finite")
    if whole and value != int(value):
        raise fault("needs a whole number")
    if not bounds.holds(value):
        raise fault(f"must {bounds.words()}")
    return int(value) if whole else float(value)


def _with_unit(text: str, dimension: str, needs: str) -> float:
    try:
        number, found = units.parse(text)
    except ValueError as error:
        raise fault(f"{error}; {needs}" if "unknown unit" in str(error) else needs) from None
    if found != units.DIMENSIONS[dimension][0]:
        raise fault(needs)
    return number
