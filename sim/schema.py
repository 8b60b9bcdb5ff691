"""Every section of a scene file as a frozen model: keys, defaults, units, ranges. SI once read."""

from __future__ import annotations

import math
import re
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from sim.model import REQUIRED, Model, fault, option, quantity
from sim.shapes import AnySolid, Path, Vector, nonzero

VERSION = 1
"""Of the scene format; a file that asks for a newer one is refused."""


def derived(default: Any = None) -> Any:
    """A field that loading fills in from the methods chosen; no key of this name is read from a scene."""
    return Field(default, json_schema_extra={"derived": True})


def _low_below_high(table: Any) -> Any:
    if table.low and table.high and not all(a < b for a, b in zip(table.low, table.high)):
        raise fault("low must be below high on every axis")
    return table


class Run(Model):
    """[run]: how long, how finely, on what."""

    duration: float = quantity(REQUIRED, "time", gt=0)
    fps: int = quantity(30, ge=1, le=10000, why="frame n stands at n/fps exactly")
    seed: int = quantity(1, ge=-(2**31), le=2**31 - 1, why="jitter of the emitters")
    arch: Literal["cpu", "cuda", "vulkan", "metal"] = option("cpu", why="where kernels run")
    threads: int = quantity(0, ge=0, le=4096, why="0 takes every core; the bits are the same")
    precision: Literal["f32", "f64"] = option("f32", why="of every real in the state")
    dt_max: float = quantity("2 ms", "time", gt=0, why="upper cap; the stages' own limits decide below it")
    dt_min: float = quantity("1 us", "time", gt=0, why="below this the guard stops the run: starving")
    dt_limits: bool = option(True, why="false: dt_max whatever the stages ask for, to see what that leads to")
    checkpoint: int = quantity(1, ge=0, why="frames between checkpoints; 0 = at the end and on Ctrl-C")

    @property
    def frame_count(self) -> int:
        """Frames after frame 0: duration * fps, rounded."""
        return round(self.duration * self.fps)


class Space(Model):
    """[space]: gravity, and the box that water lives in; what leaves it is booked as drained."""

    gravity: Vector = quantity((0.0, 0.0, -9.81), "acceleration", why="z up")
    wind: Vector | None = quantity(None, "speed", why="on cloth; absent = no air, [0, 0, 0] = still air, which drags")
    low: Vector | None = quantity(None, "length")
    high: Vector | None = quantity(None, "length")
    periodic: tuple[Literal["x", "y", "z"], ...] = option((), why="axes that close on themselves: nothing leaves there")

    _order = model_validator(mode="after")(_low_below_high)


class Liquid(Model):
    """[fluid.liquid]: from a card in configs/liquids, or whole in the scene."""

    name: str = option("", why="of the card")
    rest_density: float = quantity(REQUIRED, "density", gt=0, le=1e5)
    nu: float = quantity(REQUIRED, "kinematic_viscosity", ge=0)
    surface_tension: float = quantity(REQUIRED, "tension", ge=0)
    absorption: Vector = quantity(
        (12.0, 3.0, 1.8), "per_length", ge=0, why="of red, green and blue, as drawn: thirty times pure water's"
    )

    @property
    def mu(self) -> float:
        """Dynamic viscosity mu = rho0 nu [Pa s]."""
        return self.rest_density * self.nu


class Block(Model):
    """[fluid.block.NAME]: a box of water that is there at t = 0."""

    low: Vector = quantity(REQUIRED, "length")
    high: Vector = quantity(REQUIRED, "length")
    velocity: Vector = quantity((0.0, 0.0, 0.0), "speed", why="at rest")
    vortices: float = quantity("0 m/s", "speed", ge=0, why="top speed of Taylor and Green's four, added to velocity")

    _order = model_validator(mode="after")(_low_below_high)

    @property
    def volume(self) -> float:
        """Of the box [m^3]."""
        return math.prod(b - a for a, b in zip(self.low, self.high))


class Ball(Model):
    """[fluid.ball.NAME]: a ball of water that is there at t = 0; stretched, an ellipsoid along the axes."""

    centre: Vector = quantity(REQUIRED, "length")
    radius: float = quantity(REQUIRED, "length", gt=0)
    stretch: Vector = quantity((1.0, 1.0, 1.0), gt=0, why="round; its half axes over the radius")
    velocity: Vector = quantity((0.0, 0.0, 0.0), "speed", why="at rest")

    @property
    def half_axes(self) -> Vector:
        """radius times stretch [m]."""
        return tuple(self.radius * s for s in self.stretch)

    @property
    def low(self) -> Vector:
        """Low corner of the box around it [m]."""
        return tuple(c - a for c, a in zip(self.centre, self.half_axes))

    @property
    def high(self) -> Vector:
        """High corner of the box around it [m]."""
        return tuple(c + a for c, a in zip(self.centre, self.half_axes))

    @property
    def volume(self) -> float:
        """4/3 pi times the half axes [m^3]."""
        return 4.0 / 3.0 * math.pi * math.prod(self.half_axes)


class Fluid(Model):
    """[fluid]: smoothed particle hydrodynamics; particle mass is rest_density spacing^3."""

    spacing: float = quantity(REQUIRED, "length", gt=0)
    support: float = quantity(2.0, ge=1.5, le=4, why="support radius over spacing; 3 to validate")
    kernel: Literal["wendland_c2", "cubic_spline", "mueller"] = option("wendland_c2", why="never pairs")
    method: str = option("dfsph", why="incompressible at large steps")
    mover: str = option("symplectic_euler", why="keeps energy near what it was")
    search: str = option("grid", why="linear in the particles")
    terms: tuple[str, ...] = option(("viscosity",), why="compiled in; [] for none")
    expected_speed: float | None = quantity(None, "speed", gt=0, why="absent = by inflow, moving solids and a fall")
    particles_max: Literal["auto"] | int = quantity("auto", ge=1, le=2**31 - 1, why="rate x time + bodies + 5 %")
    liquid: Liquid
    block: dict[str, Block] = Field(default_factory=dict)
    ball: dict[str, Ball] = Field(default_factory=dict)
    params: Any = derived()
    term_params: dict[str, Any] = derived({})

    @model_validator(mode="before")
    @classmethod
    def _whole_methods(cls, table: Any) -> Any:
        """Mueller's method has kernels and viscosity of its own."""
        own = {"kernel": "mueller", "terms": ()} if isinstance(table, dict) and table.get("method") == "mueller" else {}
        return {**own, **table} if own else table

    @property
    def bodies(self) -> tuple[Block | Ball, ...]:
        """All water that is there at t = 0: blocks, then balls."""
        return (*self.block.values(), *self.ball.values())

    @property
    def support_radius(self) -> float:
        """h = support * spacing [m]; kernels vanish beyond it."""
        return self.support * self.spacing


class Emitter(Model):
    """[emitter.NAME]: a round stream."""

    centre: Vector = quantity(REQUIRED, "length")
    direction: Vector = quantity((0.0, 0.0, -1.0), why="down; its length does not matter")
    speed: float = quantity(REQUIRED, "speed", gt=0)
    rate: float = quantity(REQUIRED, "flow", gt=0)
    start: float = quantity("0 s", "time", ge=0)
    stop: float | None = quantity(None, "time", gt=0, why="absent = to the end of the run")
    repeat: bool = option(False, why="begin again at every stop, pausing for `start` each time")

    _nonzero = field_validator("direction")(nonzero)

    @property
    def diameter(self) -> float:
        """Of the nozzle: sqrt(4 rate / (pi speed)) [m]."""
        return math.sqrt(4.0 * self.rate / (math.pi * self.speed))

    @model_validator(mode="after")
    def _times(self) -> Emitter:
        if self.stop is not None and self.stop <= self.start:
            raise fault("stop must be later than start")
        if self.repeat and self.stop is None:
            raise fault("repeat needs a stop")
        return self


class Drain(Model):
    """[drain.NAME]: a box that swallows water; booked as drained."""

    low: Vector = quantity(REQUIRED, "length")
    high: Vector = quantity(REQUIRED, "length")

    _order = model_validator(mode="after")(_low_below_high)


def _colour(value: str | None) -> str | None:
    if value is not None and not re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        raise fault('needs a colour such as "#d9673b"')
    return value


class Fabric(Model):
    """[cloth.fabric]: from a card in configs/fabrics, or whole in the scene."""

    name: str = option("", why="of the card")
    area_density: float = quantity(REQUIRED, "area_density", gt=0)
    thickness: float = quantity(REQUIRED, "length", gt=0)
    stretch: float = quantity(REQUIRED, "tension", gt=0)
    bending: float = quantity(REQUIRED, "moment", ge=0)
    porosity: float = quantity(REQUIRED, gt=0, lt=1)
    fibre_diameter: float = quantity(REQUIRED, "length", gt=0)
    pore_radius: float = quantity(REQUIRED, "length", gt=0)
    permeability_through: float = quantity(REQUIRED, "area", ge=0)
    permeability_along: float = quantity(REQUIRED, "area", ge=0)
    contact_angle: float = quantity(REQUIRED, "angle", ge=0, lt=math.pi)
    capillary_form: Literal["tube", "bed_across", "bed_along"] = option("tube", why="the laws differ threefold")
    capillary_pressure: float | None = quantity(None, "pressure", why="absent = by the form, from the liquid")
    break_through: float | None = quantity(None, "pressure", ge=0, why="absent = by contact angle and pore")
    colour: str = option("#d9673b", why="sRGB, dry; of pictures, where the scene names none")

    _hex = field_validator("colour")(_colour)

    def capillary(self, surface_tension: float) -> float:
        """Suction of the dry cloth by its form [Pa]; surface_tension gamma [N/m].

        tube        2 gamma cos(theta) / pore_radius         (Washburn 1921)
        bed_across  gamma cos(theta) psi / (phi r_fibre)     psi = 1 - phi, phi porosity; along a bed twice that
        """
        pull = surface_tension * math.cos(self.contact_angle)
        if self.capillary_form == "tube":
            return 2.0 * pull / self.pore_radius
        across = pull * (1.0 - self.porosity) / (self.porosity * 0.5 * self.fibre_diameter)
        return across if self.capillary_form == "bed_across" else 2.0 * across

    def threshold(self, surface_tension: float) -> float:
        """Pressure that a water-repellent cloth holds back: -2 gamma cos(theta) / pore_radius [Pa], else 0."""
        return max(0.0, -2.0 * surface_tension * math.cos(self.contact_angle) / self.pore_radius)

    @model_validator(mode="after")
    def _possible(self) -> Fabric:
        solid = self.area_density / (self.thickness * (1.0 - self.porosity))
        if not 200.0 <= solid <= 4000.0:
            raise fault(
                f"area_density / (thickness (1 - porosity)) = {solid:.0f} kg/m^3 is no fibre's density; "
                "textile fibres have 900 to 2600"
            )
        if self.fibre_diameter > self.thickness:
            raise fault("fibre_diameter must not be above thickness")
        return self


WORDS = ("corners", "edges", "left", "right", "front", "back")
"""For the nodes that a pin holds."""


class Pin(Model):
    """[cloth.pins.NAME]: clips that hold nodes; each takes in the nodes within `clip`. left, right: i = 0 and the last;
    front, back: j = 0 and the last; a clip of n spacings along them holds n + 1 rows.
    """

    where: Literal["corners", "edges", "left", "right", "front", "back"] | tuple[tuple[int, int], ...] = option(
        REQUIRED
    )
    clip: float = quantity("15 mm", "length", ge=0, why="a clip, not a point: a point pin strains without bound")
    path: Path | None = Field(None, description="absent = it stays; its centre: absent = the middle of what it holds")
    force: float | None = quantity(None, "force", gt=0, why="gives way to a stronger pull; absent = goes its way")

    @field_validator("where", mode="before")
    @classmethod
    def _where(cls, value: Any) -> Any:
        if value in WORDS:
            return value
        if isinstance(value, (list, tuple)) and value and all(_is_node(v) for v in value):
            return tuple((int(i), int(j)) for i, j in value)
        words = ", ".join(f'"{word}"' for word in WORDS)
        raise fault(f"choose {words} or a list of nodes such as [[0, 0], [40, 0]]")

    @model_validator(mode="after")
    def _moves(self) -> Pin:
        if self.force is not None and self.path is None:
            raise fault("force: a clip without a path stays where it is; leave it out")
        return self


def _is_node(value: Any) -> bool:
    whole = isinstance(value, (list, tuple)) and len(value) == 2
    return whole and all(isinstance(v, int) and not isinstance(v, bool) and v >= 0 for v in value)


class Cloth(Model):
    """[cloth]: a rectangular sheet of springs."""

    size: tuple[float, float] = quantity(REQUIRED, "length", gt=0)
    spacing: float = quantity("5 mm", "length", gt=0)
    centre: Vector = quantity((0.0, 0.0, 0.0), "length")
    normal: Vector = quantity((0.0, 0.0, 1.0), why="lying flat")
    slack: float = quantity(0.0, ge=0, lt=0.9, why="clips stand (1 - slack) of the sheet's size apart")
    fold: float | None = quantity(None, "length", gt=0, why="folded in half, layers this far apart; absent = flat")
    settle: float = quantity("0 s", "time", ge=0, why="hang at rest before t = 0, in no ledger")
    method: str = option("xpbd", why="stable at every step")
    bending: str = option("flexion", why="springs over two meshes; isometric: a plate's, at every mesh; none")
    strain_limit: float | None = quantity(None, gt=0, le=1, why="Provot; absent = no limit")
    self_contact: str | None = option(None, why="absent = the sheet does not feel itself")
    search: str = option("grid", why="of self contact; linear in the patches")
    fabric: Fabric
    pins: dict[str, Pin] = Field(default_factory=dict)
    params: Any = derived()
    bending_params: Any = derived()
    self_contact_params: Any = derived()

    _nonzero = field_validator("normal")(nonzero)

    @property
    def node_counts(self) -> tuple[int, int]:
        """Nodes along each side."""
        return tuple(round(side / self.spacing) + 1 for side in self.size)

    @model_validator(mode="after")
    def _folds(self) -> Cloth:
        if self.fold is not None and self.slack:
            raise fault("fold: a folded sheet has no slack; leave one of them out")
        if self.fold is not None and self.fold > self.size[0] / math.pi:
            raise fault(
                f"fold must lie in (0, {self.size[0] / math.pi:.3g}]: half a turn of the first side is all there is"
            )
        return self


class Coupling(Model):
    """[coupling]: forces between water and cloth."""

    contact: str = option("ccd", why="continuous: nothing passes between two steps; plane_reflect leaks")
    search: str = option("grid", why="over the cloth's patches; linear in them")
    restitution: float = quantity(0.0, ge=0, le=1, why="water does not bounce")
    friction: float = quantity(0.2, ge=0, why="drag of a film on rough cloth, tau = friction rho u^2/2")
    params: Any = derived()


class Wetting(Model):
    """[wetting]: mass between water and cloth."""

    processes: tuple[str, ...] = option(("absorb", "wick", "seep", "drip"))
    params: dict[str, Any] = derived({})


class Camera(Model):
    """[render] camera: z up; fov is vertical."""

    eye: Vector = quantity((0.34, -0.38, 0.33), "length")
    target: Vector = quantity((0.0, 0.0, 0.13), "length")
    fov: float = quantity("32 deg", "angle", gt=0, lt=math.pi)

    @model_validator(mode="after")
    def _apart(self) -> Camera:
        if self.eye == self.target:
            raise fault("eye must not be at target")
        return self


class Light(Model):
    """[render] light: the direction it travels in."""

    direction: Vector = quantity((-0.5, -0.3, -1.0))

    _nonzero = field_validator("direction")(nonzero)


class Render(Model):
    """[render]: how frames are drawn."""

    size: tuple[int, int] = quantity((1280, 720), ge=16, le=8192, why="even numbers, as films need")
    look: Literal["film", "particles"] = option("film", why="one clear surface; or a ball for each particle")
    fps: int | None = quantity(None, ge=1, le=1000, why="of the film; run.fps if absent, less shows it slower")
    camera: Camera = Field(default_factory=Camera)
    light: Light = Field(default_factory=Light)
    cloth_colour: str | None = option(None, why="sRGB, dry; absent = the fabric's")

    _hex = field_validator("cloth_colour")(_colour)

    @field_validator("size")
    @classmethod
    def _even(cls, value: tuple[int, int]) -> tuple[int, int]:
        if value[0] % 2 or value[1] % 2:
            raise fault("needs two even numbers")
        return value


class Config(Model):
    """A whole scene. A section that is absent is None (or an empty dict of named tables) and is not modelled."""

    name: str
    title: str = ""
    run: Run
    space: Space = Field(default_factory=Space)
    fluid: Fluid | None = None
    emitter: dict[str, Emitter] = Field(default_factory=dict)
    drain: dict[str, Drain] = Field(default_factory=dict)
    cloth: Cloth | None = None
    solid: dict[str, AnySolid] = Field(default_factory=dict)
    coupling: Coupling | None = None
    wetting: Wetting | None = None
    render: Render = Field(default_factory=Render)
    overridden: tuple[str, ...] = option((), why="keys that the scene wrote over a card's; filled in by loading")
    warnings: tuple[str, ...] = derived(())
