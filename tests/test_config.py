"""Scene files: read in SI, in the order of layers, refused in one clear line."""

import math

import pytest

from sim import config, fit, units
from sim.config import load
from sim.errors import ConfigError
from sim.model import Model, quantity
from sim.schema import Fabric, Liquid

SCENES, FABRICS, LIQUIDS = (config.names(folder) for folder in ("scenes", "fabrics", "liquids"))


@pytest.mark.parametrize(
    "text, value",
    [("2.5 mm", 0.0025), ("60 ml/s", 6e-5), ("150 g/m^2", 0.15), ("2 kPa", 2000.0), ("1e-6 m^2/s", 1e-6),
     ("72.75 mN/m", 0.07275), ("7.9e-6 N m", 7.9e-6), ("0.2 1/s", 0.2), ("2ms", 0.002), ("90 deg", math.pi / 2)],
)  # fmt: skip
def test_units_are_read_to_the_nearest_float(text, value):
    assert units.parse(text)[0] == pytest.approx(value, rel=1e-15)


def test_units_know_their_dimension():
    assert units.name_of(units.parse("40 N/m")[1]) == "tension"
    assert units.dimension("m/s") == "speed"
    for wrong in ("", "mm", "2 miles", "two mm", "1e mm", "2..5 mm"):
        with pytest.raises(ValueError):
            units.parse(wrong)


def test_quantity_takes_its_dimension_from_its_default():
    class Params(Model):
        sound_speed: float = quantity("30 m/s", gt=0)
        passes: int = quantity(8, ge=1)

    assert Params().sound_speed == 30.0
    assert Params(sound_speed="3 cm/s").sound_speed == 0.03
    for wrong in ("2 s", "0 m/s", math.inf, math.nan, True):
        with pytest.raises(ValueError):
            Params(sound_speed=wrong)
    with pytest.raises(ValueError):
        Params(passes=1.5)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_loads_and_resolves_to_itself(name, quick, tmp_path):
    scene = load(name, quick=quick)
    assert scene.warnings == ()
    path = tmp_path / "config.toml"
    path.write_text(config.resolved_toml(scene))
    again = load(path)
    assert again == scene, config.differences(again, scene)
    assert config.resolved_toml(again) == path.read_text()


@pytest.mark.parametrize("name", FABRICS)
def test_every_fabric_card_follows_from_its_fibres(name):
    """Gebart's laws and the hydraulic radius give each card's own numbers back, within what rounding allows."""
    card = config.card("fabrics", name, Fabric)
    solid, radius = 1 - card.porosity, card.fibre_diameter / 2
    through = 0.400 * (math.sqrt(math.pi / 4 / solid) - 1) ** 2.5 * radius**2
    along = 8 * radius**2 / 57 * card.porosity**3 / solid**2
    assert card.permeability_through == pytest.approx(through, rel=0.03)
    assert card.permeability_along == pytest.approx(along, rel=0.03)
    assert card.pore_radius == pytest.approx(3.3 * card.porosity * card.fibre_diameter / (2 * solid), rel=0.03)
    assert card.threshold(0.072) == 0.0


def test_fabrics_bend_as_fabrics_do():
    """Bending lengths (B/(rho_A g))^(1/3) of 618 measured ones: 9 to 32 mm, percentiles 1 to 99 (Feng et al. 2022)."""
    cards = {name: config.card("fabrics", name, Fabric) for name in FABRICS}
    length = {name: (card.bending / (card.area_density * 9.81)) ** (1 / 3) for name, card in cards.items()}
    assert all(0.0087 < bent < 0.0325 for bent in length.values())
    assert sorted(length, key=length.get) == ["silk", "terry", "cotton", "nylon", "denim"]
    assert all(6e-7 < card.bending < 1.4e-4 and 0.02 < card.area_density < 0.7 for card in cards.values())


@pytest.mark.parametrize("name", LIQUIDS)
def test_every_liquid_card_reads(name):
    card = config.card("liquids", name, Liquid)
    assert card.mu == card.nu * card.rest_density


def test_layers_later_wins_and_a_list_replaces_a_list(scene_file):
    scene_file("schema = 1\ntitle = 'base'\n[run]\nduration = 1\nfps = 20\n[render]\nsize = [64, 64]\n", "base")
    path = scene_file(
        'schema = 1\nextends = "base.toml"\n[run]\nduration = 2\n[cloth]\nsize = [1, 1]\nspacing = 0.1\n'
        "[quick]\nrun.fps = 10\nrender.size = [32, 32]\nrun.duration = 3\n",
        "child",
    )
    plain, quick = load(path), load(path, ["run.duration=4"], quick=True)
    assert (plain.title, plain.run.duration, plain.run.fps, plain.render.size) == ("base", 2.0, 20, (64, 64))
    assert (quick.run.duration, quick.run.fps, quick.render.size) == (4.0, 10, (32, 32))
    assert plain.name == "child"


def test_cards_are_overridden_key_by_key_and_marked():
    scene = load("seep", ["cloth.fabric.thickness=0.35 mm", "fluid.liquid.card=oil"])
    assert scene.cloth.fabric.name == "cotton" and scene.cloth.fabric.thickness == 0.00035
    assert scene.overridden == ("cloth.fabric.thickness",)
    assert scene.fluid.liquid.name == "oil"
    oil = scene.fluid.liquid.surface_tension
    assert scene.cloth.fabric.capillary_pressure == scene.cloth.fabric.capillary(oil)


def test_what_is_absent_is_none():
    scene = load("tablecloth")
    assert (scene.fluid, scene.coupling, scene.wetting, scene.emitter, scene.drain) == (None, None, None, {}, {})


def test_fluid_and_cloth_without_coupling_warn(scene_file):
    path = scene_file(
        "schema = 1\n[run]\nduration = 1\n[space]\nlow = [-1, -1, -1]\nhigh = [1, 1, 1]\n"
        "[cloth]\nsize = [1, 1]\nspacing = 0.1\n[fluid]\nspacing = 0.1\n"
    )
    assert len(load(path).warnings) == 2
    assert "do not feel each other" in load(path).warnings[0]
    assert "has no water" in load(path).warnings[1]


WRONG = {
    "fluid.spcing=2 mm": 'fluid.spcing = "2 mm": unknown key; did you mean fluid.spacing?',
    "fluid.spacing=2 s": 'fluid.spacing = "2 s": needs a length, such as "2 mm"',
    "fluid.spacing=2 miles": 'unknown unit "miles"; needs a length',
    "fluid.gravity=3": "did you mean space.gravity?",
    "fluid.params=3": "fluid.params = 3: unknown key",
    "fluid.method=sphd": 'no method "sphd"; choose from dfsph',
    "fluid.dfsph.cfll=1": "did you mean fluid.dfsph.cfl?",
    "fluid.dfspg.cfl=1": "did you mean fluid.dfsph?",
    "fluid.dfsph.cfl=-1": "fluid.dfsph.cfl = -1: must lie in (0, 1]",
    'fluid.terms=["viscocity"]': 'no method "viscocity"; choose from',
    "fluid.terms=viscosity": "must be a list",
    "fluid.kernel=poly6": "choose from wendland_c2, cubic_spline",
    "fluid.kernel=mueller": 'is two kernels, of the method "mueller" alone',
    "fluid.mover=explicit_euler": 'the method "dfsph" solves for the way it goes; choose symplectic_euler',
    "fluid.mover=leapfrog": 'no method "leapfrog"; choose from explicit_euler, symplectic_euler',
    "fluid.mueller.gas_constant=3 m/s": 'needs an energy per mass, such as "20 m^2/s^2"',
    "fluid.particles_max=lots": "needs a number",
    "cloth.fabric.porosity=1.4": "cloth.fabric.porosity = 1.4: must lie in (0, 1)",
    "cloth.fabric.thickness=1 um": "is no fibre's density",
    "cloth.fabric.card=coton": "no such fabric; did you mean cotton?",
    "cloth.spacing=7 mm": "must go evenly into 0.2 m",
    "cloth.pins.extra.where=[[0, 99]]": "has a node outside [0, 0] to [40, 40]",
    "cloth.pins.extra.where=middle": 'choose "corners", "edges", "left", "right", "front", "back" or a list of nodes',
    "cloth.bending=stiff": 'no method "stiff"; choose from flexion',
    "emitter.spout.rate=1 ml/s": "it must be 3 spacings wide, 7.5 mm",
    "emitter.spout.stop=0.1 s": "stop must be later than start",
    "emitter.spout.centre=[0, 0, 9]": "must lie within space.low and space.high",
    "emitter.spout=3": "must be a table: [emitter.spout]",
    "solid.basin.shape=bowl": 'solid.basin.shape = "bowl": choose from plane, box, sphere, cylinder, basin, mesh',
    "solid.basin.siz=3": "did you mean solid.basin.size?",
    "space.low=[1, 1, 1]": "low must be below high on every axis",
    "space.low=[1, 1]": "needs a list of 3, each a length",
    "run.duration=1 ms": "shorter than one frame at 30 frames per second",
    "run.duration=inf": "must be finite",
    "run.dt_min=1 s": "must be below run.dt_max",
    "run.fps=2.5": "needs a whole number",
    "run.arch=gpu": "choose from cpu, cuda, vulkan, metal",
    "render.size=[321, 180]": "needs two even numbers",
    "render.cloth_colour=red": 'needs a colour such as "#d9673b"',
    'wetting.processes=["soak"]': 'no method "soak"; choose from absorb',
    "drain.plug.low=[0, 0, 0]": 'drain.plug.high: missing; needs a length, such as "2 mm"',
    "fluid.spacing": "needs KEY=VALUE",
}


@pytest.mark.parametrize("setting, words", WRONG.items())
def test_wrong_settings_are_refused_in_one_line(setting, words):
    with pytest.raises(ConfigError) as error:
        load("seep", [setting])
    line = str(error.value)
    assert words in line and "\n" not in line
    assert error.value.exit_code == 2


def test_all_problems_are_counted():
    with pytest.raises(ConfigError, match=r"run\.fps = 0: must lie in \[1, 10000\] \(and 1 more\)"):
        load("seep", ["run.fps=0", "run.threads=-1"])


def test_sections_that_need_each_other():
    with pytest.raises(ConfigError, match=r"coupling: needs \[fluid\] and \[cloth\]; \[fluid\] is missing"):
        load("tablecloth", ["coupling.friction=0.1"])
    with pytest.raises(ConfigError, match=r"wetting: needs \[coupling\]"):
        load("tablecloth", ["wetting.processes=[]"])
    with pytest.raises(ConfigError, match=r"drain: needs \[fluid\]"):
        load("tablecloth", ["drain.plug.low=[0, 0, 0]", "drain.plug.high=[1, 1, 1]"])


@pytest.mark.parametrize(
    "scene, setting, things",
    [
        ("dam_break", "fluid.spacing=1e-9", "particles"),
        ("honey", "emitter.spoon.rate=1e9", "particles"),
        ("pile", "cloth.spacing=1e-8", "nodes"),
    ],
)
def test_more_than_can_be_numbered_is_refused_before_it_is_made(scene, setting, things):
    with pytest.raises(ConfigError, match=rf"{setting.split('=')[0]} = .*: makes .* {things}; at most 2,147,483,647"):
        load(scene, [setting])


def test_nozzle_is_measured_in_spacings():
    scene = load("seep")
    assert scene.emitter["spout"].diameter == pytest.approx(12.36e-3, rel=1e-3)
    assert scene.emitter["spout"].diameter > fit.NOZZLE_SPACINGS * scene.fluid.spacing


def test_extends_in_a_circle(scene_file):
    path = scene_file('schema = 1\nextends = "small.toml"\n')
    with pytest.raises(ConfigError, match="goes round in a circle"):
        load(path)
