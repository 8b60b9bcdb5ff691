"""What there is to choose from, as text: scenes, methods with their parameters, a fabric and what follows from it."""

from __future__ import annotations

import math

from sim import config, registry, toml
from sim.constants import GRAVITY
from sim.model import Model, range_of
from sim.schema import Fabric, Liquid


def scenes() -> str:
    """The demo scenes, a line each."""
    names = config.names("scenes")
    width = max(map(len, names), default=0)
    tables = (toml.read(config.CONFIGS / "scenes" / f"{name}.toml", name) for name in names)
    return "\n".join(f"{name:{width}}  {table.get('title', '')}" for name, table in zip(names, tables))


def methods() -> str:
    """Every method that a scene can name, by kind, with its parameters, their defaults, ranges and reasons."""
    registry.discover()
    chosen_by: dict[str, list[str]] = {}
    for choice in config.CHOICES:
        chosen_by.setdefault(choice.kind, []).append(f"{choice.section}.{choice.key}")
    lines = []
    for kind, keys in chosen_by.items():
        lines.append(" and ".join(keys))
        for name, method in registry.methods(kind).items():
            lines.append(f"  {name:12} {' '.join((method.__doc__ or '').strip().partition(chr(10))[0].split())}")
            lines += _parameters(getattr(method, "Params", Model))
    return "\n".join(lines)


def _parameters(model: type[Model]) -> list[str]:
    lines = []
    for name, field in model.model_fields.items():
        bounds = range_of(model, name)
        limit = f"must {bounds.words()}; " if bounds and bounds.bounded() else ""
        unit = f"{bounds.dimension}, " if bounds and bounds.dimension != "number" else ""
        default = "absent" if field.default is None else toml.literal(field.default)
        lines.append(f"    {name} = {default}   {unit}{limit}{field.description or ''}".rstrip(" ;,"))
    return lines


def fabric(name: str) -> str:
    """A card with water, in SI, and what follows from it."""
    card = config.card("fabrics", name, Fabric)
    water = config.card("liquids", "water", Liquid)
    rho, mu, gamma, g = water.rest_density, water.mu, water.surface_tension, GRAVITY
    suction = card.capillary_pressure or card.capillary(gamma)
    held_back = card.threshold(gamma) if card.break_through is None else card.break_through
    lines = [f"{key} = {toml.literal(value)}" for key, value in card.model_dump(exclude_none=True).items()]
    lines += ["", "with water, from these:"]
    lines += [
        f"  suction of the dry cloth      {suction:.3g} Pa, a rise of {1e3 * suction / (rho * g):.3g} mm",
        f"  water that fills the pores    {card.porosity * card.thickness * rho * 1e3:.3g} g/m^2",
        f"  time to soak through          {_soak(card, mu, suction):.2g} s",
        f"  spread of a wet patch         {_diffusivity(card, mu, suction):.2g} m^2/s",
        f"  a pool drains with a time of  {_drain(card, mu, rho, g):.3g} s",
        f"  pressure that it holds back   {held_back:.3g} Pa, {1e3 * held_back / (rho * g):.3g} mm of water",
        f"  bending length (B/(rho_A g))^(1/3)  {1e3 * (card.bending / (card.area_density * g)) ** (1 / 3):.3g} mm",
    ]
    return "\n".join(lines)


def _soak(card: Fabric, mu: float, suction: float) -> float:
    """tau = phi t^2 mu / (2 K_through p_c)."""
    flow = 2.0 * card.permeability_through * suction
    return card.porosity * card.thickness**2 * mu / flow if flow > 0 else math.inf


def _diffusivity(card: Fabric, mu: float, suction: float) -> float:
    """D = K_along p_c / (phi mu)."""
    return card.permeability_along * suction / (card.porosity * mu)


def _drain(card: Fabric, mu: float, rho: float, g: float) -> float:
    """mu t / (K_through rho g): a pool on the sheet falls by the factor e, whatever its depth."""
    return mu * card.thickness / (card.permeability_through * rho * g) if card.permeability_through else math.inf
