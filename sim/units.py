"""Numbers with units: "60 ml/s" -> 6e-5 and its dimension. SI inside, everywhere."""

from __future__ import annotations

import math
import re

Dimension = tuple[int, int, int, int]
"""Exponents of metre, kilogram, second and radian."""

_M, _KG, _S, _RAD = (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)
_NONE: Dimension = (0, 0, 0, 0)
_VOLUME, _FORCE, _PRESSURE = (3, 0, 0, 0), (1, 1, -2, 0), (-1, 1, -2, 0)

UNITS: dict[str, tuple[float, Dimension]] = {
    "m": (1.0, _M),
    "cm": (1e-2, _M),
    "mm": (1e-3, _M),
    "um": (1e-6, _M),
    "s": (1.0, _S),
    "ms": (1e-3, _S),
    "us": (1e-6, _S),
    "min": (60.0, _S),
    "h": (3600.0, _S),
    "kg": (1.0, _KG),
    "g": (1e-3, _KG),
    "mg": (1e-6, _KG),
    "l": (1e-3, _VOLUME),
    "ml": (1e-6, _VOLUME),
    "N": (1.0, _FORCE),
    "mN": (1e-3, _FORCE),
    "uN": (1e-6, _FORCE),
    "Pa": (1.0, _PRESSURE),
    "kPa": (1e3, _PRESSURE),
    "MPa": (1e6, _PRESSURE),
    "J": (1.0, (2, 1, -2, 0)),
    "Hz": (1.0, (0, 0, -1, 0)),
    "rad": (1.0, _RAD),
    "deg": (math.pi / 180.0, _RAD),
    "%": (1e-2, _NONE),
    "1": (1.0, _NONE),
}
"""Symbol -> (factor to SI, dimension)."""

DIMENSIONS: dict[str, tuple[Dimension, str, str]] = {
    "number": (_NONE, "a number", "0.5"),
    "length": (_M, "a length", "2 mm"),
    "area": ((2, 0, 0, 0), "an area", "5e-12 m^2"),
    "time": (_S, "a time", "2 ms"),
    "mass": (_KG, "a mass", "2 g"),
    "angle": (_RAD, "an angle", "15 deg"),
    "speed": ((1, 0, -1, 0), "a speed", "0.8 m/s"),
    "acceleration": ((1, 0, -2, 0), "an acceleration", "9.81 m/s^2"),
    "rate": ((0, 0, -1, 0), "a rate", "0.2 1/s"),
    "per_length": ((-1, 0, 0, 0), "a number per length", "12 1/m"),
    "flow": ((3, 0, -1, 0), "a volume per time", "60 ml/s"),
    "density": ((-3, 1, 0, 0), "a density", "1000 kg/m^3"),
    "area_density": ((-2, 1, 0, 0), "a mass per area", "150 g/m^2"),
    "pressure": (_PRESSURE, "a pressure", "2 kPa"),
    "force": (_FORCE, "a force", "2 N"),
    "tension": ((0, 1, -2, 0), "a force per length", "72 mN/m"),
    "moment": ((2, 1, -2, 0), "a force times a length", "1e-5 N m"),
    "kinematic_viscosity": ((2, 0, -1, 0), "a kinematic viscosity", "1e-6 m^2/s"),
    "dynamic_viscosity": ((-1, 1, -1, 0), "a dynamic viscosity", "1e-3 Pa s"),
    "specific_energy": ((2, 0, -2, 0), "an energy per mass", "20 m^2/s^2"),
    "compliance": ((0, -1, 2, 0), "a length per force", "1e-6 m/N"),
}
"""Name -> (dimension, its words in an error line, an example)."""

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\d.])\s*(.*?)\s*$")
_POWER = re.compile(r"(1|%|[a-zA-Z]+)(?:\^(-?\d))?$")


def parse(text: str) -> tuple[float, Dimension]:
    """`"60 ml/s"` -> (6e-5, (3, 0, -1, 0)). Products by a space or *, one or more /, powers by ^. ValueError if not."""
    match = _NUMBER.match(text)
    if not match:
        raise ValueError(f'"{text}" is not a number with a unit')
    factor, exponents = _unit(match[2]) if match[2] else (1.0, _NONE)
    return _scaled(match[1], factor), exponents


def _scaled(digits: str, factor: float) -> float:
    """digits * factor; for powers of ten rounded once, so that "2.5 mm" is the float 0.0025 itself."""
    power = round(math.log10(factor))
    if not math.isclose(factor, 10.0**power, rel_tol=1e-12):
        return float(digits) * factor
    mantissa, _, exponent = digits.lower().partition("e")
    return float(f"{mantissa}e{int(exponent or 0) + power}")


def dimension(name_or_unit: str) -> str:
    """The name in DIMENSIONS of a dimension given by name ("speed") or by a unit ("m/s")."""
    if name_or_unit in DIMENSIONS:
        return name_or_unit
    _, exponents = _unit(name_or_unit)
    return name_of(exponents)


def needs(name: str) -> str:
    """What a key of this dimension needs, as the end of an error line."""
    _, words, example = DIMENSIONS[name]
    return f"needs {words}" if name == "number" else f'needs {words}, such as "{example}"'


def name_of(exponents: Dimension) -> str:
    """The name in DIMENSIONS of these exponents; ValueError if it has none."""
    for name, (known, _, _) in DIMENSIONS.items():
        if known == exponents:
            return name
    raise ValueError(f"no name for the dimension {exponents}")


def _unit(text: str) -> tuple[float, Dimension]:
    """`"g/m^2"` -> (1e-3, (-2, 1, 0, 0))."""
    factor, exponents = 1.0, [0, 0, 0, 0]
    for place, group in enumerate(text.split("/")):
        sign = 1 if place == 0 else -1
        for word in group.replace("*", " ").split():
            match = _POWER.match(word)
            if not match or match[1] not in UNITS:
                raise ValueError(f'unknown unit "{word}"')
            power = sign * int(match[2] or 1)
            scale, base = UNITS[match[1]]
            factor *= scale**power
            exponents = [e + power * b for e, b in zip(exponents, base)]
    return factor, tuple(exponents)
