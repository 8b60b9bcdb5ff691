"""Causes of a failure taken back one at a time: the plan, the verdict, and the page."""

import imageio.v3 as iio
import pytest

from render.ablation import ablation_chart
from sim import config
from sim.errors import ConfigError, RunError
from sim.studies import ablate


def test_every_cause_is_mended_alone_and_left_in_alone():
    study = ablate.load()
    trials = ablate.trials(study)
    assert list(study.cause) == ["sign", "clamp", "integrator", "mass", "dt"]
    assert len(trials) == 2 + 2 * len(study.cause)
    mended = next(t for t in trials if t.run == "all mended").overrides
    for name, cause in study.cause.items():
        alone, left = ([t for t in trials if (t.run, t.cause) == (run, name)] for run in ("mended alone", "left alone"))
        assert alone[0].overrides == cause.set
        assert set(left[0].overrides) == set(mended) - set(cause.set)


@pytest.mark.parametrize("scene", ["explosion", "implosion"])
def test_all_mended_the_reports_scene_has_none_of_its_choices(scene):
    as_it_is, *_, mended = (t for t in ablate.trials(ablate.load()) if not t.cause)
    before, after = (config.load(scene, t.overrides) for t in (as_it_is, mended))
    assert before.fluid.mover == "explicit_euler" and after.fluid.mover == "symplectic_euler"
    assert not before.run.dt_limits and after.run.dt_limits
    assert not before.fluid.params.clamp_pressure and after.fluid.params.clamp_pressure
    assert before.fluid.params.mass_factor != 1.0 and after.fluid.params.mass_factor == 1.0
    assert not after.fluid.params.printed_viscosity_sign and not after.fluid.params.printed_normalisation


def test_a_scene_that_the_causes_do_not_fit_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(ConfigError, match="unknown key"):
        next(ablate.run("dam_break", tmp_path, ("fluid.mueler.mass_factor=1",)))
    assert list(tmp_path.iterdir()) == []


def _rows(failing: str) -> list[dict]:
    """A row each trial: it fails unless `failing` is mended."""
    rows = []
    for trial in ablate.trials(ablate.load()):
        about = trial.cause == failing
        fails = {"as it is": True, "mended alone": not about, "left alone": about, "all mended": False}[trial.run]
        figures = {"max_speed": 9.0, "mean_speed": 3.0 if fails else 0.5, "density": 1.0, "duration": 0.3}
        said = {"failure": "exploding" if fails else "", "time": 0.06 if fails else float("nan"), "message": "hot, all"}
        bounds = {"speed_bound": 2.0, "density_bound": 1.5}
        named = {"run": trial.run, "mended": trial.cause, "words": trial.cause, "overrides": " ".join(trial.overrides)}
        rows.append({**named, **figures, **said, **bounds})
    return rows


def test_the_verdict_names_what_mattered():
    said = ablate.verdict(_rows("sign"))
    assert said == ("exploding at 0.06 s; mending one alone ends it: sign; fails the mended alone: sign (exploding)")
    assert "no single mending ends it" in ablate.verdict(_rows("none of them"))


def test_the_page_is_drawn_from_its_tables_alone(tmp_path):
    ablate.write_table(tmp_path / "ablate.csv", ablate.COLUMNS, _rows("sign"))
    places = [
        {"run": r, "time": 0.3, "x": 0.01 * k, "y": 0.0, "z": 0.02}
        for r in ("as it is", "all mended")
        for k in range(5)
    ]
    ablate.write_table(tmp_path / "places.csv", ablate.PLACES, places)
    ablation_chart(tmp_path / "ablate.csv", tmp_path / "places.csv", tmp_path / "ablate.png")
    assert iio.imread(tmp_path / "ablate.png").std() > 10
    (tmp_path / "ablate.csv").write_text("a,b\n1,2\n")
    with pytest.raises(RunError, match="no trials to draw"):
        ablation_chart(tmp_path / "ablate.csv", tmp_path / "places.csv", tmp_path / "ablate.png")
