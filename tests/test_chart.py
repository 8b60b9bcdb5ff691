"""The chart command: rows go on, bounds are held, pictures come from the CSV alone; and the water's cases, coarse."""

import csv
import shutil

import imageio.v3 as iio
import pytest

import main as seep
from render.study import study_chart
from sim import config
from sim.errors import ConfigError, DivergedError
from sim.studies import chart, study, table
from sim.studies.case import Case, Point, run_point
from sim.studies.water import dam_break, still_tank

DROP = """
schema = 1
[run]
duration = "0.1 s"
fps = 10
[space]
low = [-0.1, -0.1, -0.1]
high = [0.1, 0.1, 0.1]
[fluid]
spacing = "1 cm"
[fluid.block.water]
low = [-0.02, -0.02, -0.02]
high = [0.02, 0.02, 0.02]
"""


def burst(world) -> dict[str, float]:
    """A run that ends early."""
    world.step()
    raise DivergedError("exploding at t = 0.01 s: too fast")


@pytest.fixture
def topic(tmp_path, monkeypatch):
    """topic(bound, *points): `chart toy` of a case that comes to 0.1 and one that fails; its folder, and what ran."""
    scene, ran = tmp_path / "drop.toml", []
    scene.write_text(DROP)

    def instead(case, point, threads):
        ran.append((case.name, point))
        if case.name == "wild":
            raise DivergedError("exploding at t = 0.01 s: too fast")
        return {"error": 0.1, "seconds_per_simulated_second": 2.0, "dt": 1e-3, "steps": 100}

    def make(bound: float, *points: Point) -> tuple[str, list]:
        tame = Case("tame", str(scene), "0", {"error": bound}, burst, points, ())
        wild = Case("wild", str(scene), "0", {}, burst, (Point(),), ())
        monkeypatch.setattr(chart, "load", lambda name, quick: study.Study())
        monkeypatch.setattr(chart, "cases", lambda name: {"tame": tame, "wild": wild})
        monkeypatch.setattr(chart, "run_point", instead)
        return str(tmp_path / "out"), ran

    return make


def rows(out: str, name: str = "toy") -> dict[str, dict]:
    with open(f"{out}/{name}.csv", newline="") as file:
        return {row["id"]: row for row in csv.DictReader(file)}


def test_a_chart_goes_on_and_a_bound_that_breaks_is_named(topic, capsys):
    out, ran = topic(0.2, Point())
    assert seep.main(["chart", "toy", "--out", out]) == 0
    one, wild = rows(out).values()
    assert one["ok"] == "1" and one["steps"] == "100" and one["spacing"] == "0.01"
    assert wild["ok"] == "0" and wild["message"].startswith("exploding")
    told = capsys.readouterr().out
    assert "holds" in told and "failed" in told and "exploding" in told

    out, ran = topic(0.2, Point(), Point(("run.fps=20",)))  # one more point: the others are not run again
    assert seep.main(["chart", "toy", "--out", out]) == 0
    assert len(rows(out)) == 3
    assert [point.overrides for _, point in ran] == [(), (), ("run.fps=20",)]

    out, ran = topic(0.05, Point())
    capsys.readouterr()
    assert seep.main(["chart", "toy", "--check", "--out", out]) == 1
    told = capsys.readouterr().err
    assert told == f"chart toy: {one['id']}: error = 0.1 passes 0.05\n"
    assert len(ran) == 3  # the bound changed, not the run
    assert seep.main(["chart", "toy", "--check", "--anew", "--out", out]) == 1
    assert [name for name, _ in ran[3:]] == ["tame"]  # what has no bound is not run for --check
    capsys.readouterr()
    assert seep.main(["chart", "toy", "--row", one["id"][:-2], "--out", out]) == 0
    assert "in the CSV" in capsys.readouterr().out
    assert seep.main(["chart", "toy", "--row", "nothing", "--out", out]) == 2


def test_a_run_that_diverges_says_what_it_cost_till_then(tmp_path):
    (tmp_path / "drop.toml").write_text(DROP)
    case = Case("drop", str(tmp_path / "drop.toml"), "0", {}, burst, (), ())
    with pytest.raises(DivergedError, match="exploding at t = 0.01 s: too fast") as told:
        run_point(case, Point(), threads=1)
    assert told.value.cost["steps"] == 1 and told.value.cost["particles"] == 64


def test_the_picture_needs_its_csv_alone(tmp_path):
    made = []
    for k, (method, spacing) in enumerate((m, s) for m in ("a", "b") for s in (0.01, 0.005)):
        row = table.blank() | {"id": f"x-{k}", "case": "x", "method": method, "spacing": table.cell(spacing)}
        row |= {"role": "check sweep", "bounds": "error<=0.03", "error": table.cell(0.01 + 0.02 * k)}
        made.append(row | {"seconds_per_simulated_second": table.cell(10.0 / (k + 1)), "report": "1" * (method == "b")})
    made.append(table.blank() | {"id": "x-9", "case": "x", "method": "b", "role": "sweep", "failure": "exploding"})
    table.write(tmp_path / "t.csv", table.marked(made, (0.1, 0.03)))
    (tmp_path / "alone").mkdir()
    shutil.copy(tmp_path / "t.csv", tmp_path / "alone")
    study_chart(tmp_path / "alone" / "t.csv", tmp_path / "alone" / "t.png")
    assert iio.imread(tmp_path / "alone" / "t.png").std() > 10


def test_the_front_and_the_best_choices():
    def point(seconds: float, error: float, failure: str = "") -> dict:
        named = {"case": "x", "role": "sweep", "failure": failure, "error": table.cell(error)}
        return table.blank() | named | {"seconds_per_simulated_second": table.cell(seconds)}

    made = [point(1, 0.2), point(2, 0.05), point(3, 0.08), point(4, 0.02), point(5, 0.02), point(0.1, 0.001, "burst")]
    table.marked(made, (0.1, 0.03, 0.01))
    assert [row["front"] for row in made] == ["1", "1", "", "1", "", ""]
    assert [row["best"] for row in made] == ["", "10%", "", "3%", "", ""]


def test_a_spread_is_of_all_rows_of_a_case():
    made = [table.blank() | {"case": "x", "bounds": "spread(cost)<=0.25", "cost": c} for c in ("10", "12", "11")]
    assert all(row["ok"] == "1" and row["spread(cost)"] == "0.2" for row in table.marked(made, ()))
    made[2]["cost"] = "14"
    assert all("spread(cost) = 0.4 passes 0.25" in row["message"] for row in table.marked(made, ()))


def test_the_study_of_water_is_whole():
    for quick in (False, True):
        plan = chart.plan("water", quick)
        assert {job.point.overrides[0] for job in plan.jobs if job.swept} >= {"fluid.method=dfsph"}
        assert len({job.id for job in plan.jobs}) == len(plan.jobs)


def test_the_study_of_cloth_is_whole():
    """Every solver, well under its limit and beyond it; those that hold, at a hundred times that."""
    jobs = chart.plan("cloth").jobs
    swept = [job.point.overrides for job in jobs if job.swept]
    for method in ("explicit_euler", "implicit_euler", "symplectic_euler", "xpbd"):
        assert any(f"cloth.method={method}" in texts for texts in swept)
    assert any("cloth.xpbd.substep_max=10 ms" in texts for texts in swept)
    assert all(job.config().cloth and not job.config().run.dt_limits for job in jobs if job.swept and not job.checked)
    flexion = [job for job in jobs if job.case.name == "cantilever_flexion"]
    assert flexion and all(job.bounds == {"pretence": 1.0} for job in flexion)  # must fail, and say so
    cloths = {name: config.load(name).cloth for name in config.names("scenes")}
    limited = {name for name, cloth in cloths.items() if cloth and cloth.strain_limit is not None}
    assert {job.case.scene for job in jobs if job.bounds == {"strain": 0.105}} == limited


def test_a_wrong_study_is_one_line(tmp_path, monkeypatch):
    for topic in ("nosuch", "ablate", "a/b.toml"):
        with pytest.raises(ConfigError, match=f"^{topic}: no such chart; there are cloth, meeting, water$"):
            study.load(topic)
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies" / "water.toml").write_text("[sweep.dam_brake]\n")
    monkeypatch.setattr("sim.config.CONFIGS", tmp_path)
    with pytest.raises(ConfigError, match=r"water.toml: sweep.dam_brake: no such case; there are .*dam_break"):
        chart.plan("water")
    (tmp_path / "studies" / "water.toml").write_text("[sweep.dam_break]\nspacng = []\n")
    with pytest.raises(ConfigError, match="unknown key; did you mean sweep.dam_break.spacing"):
        chart.plan("water")


def test_a_still_tank_coarse():
    """1,000 particles, 10 across: all that the quick chart asks, but for the energy's decay, which takes longer."""
    run = run_point(still_tank.CASE, Point(("fluid.spacing=10 mm", "run.duration=2 s")), threads=2)
    assert run["error"] < 0.06 and run["error"] < 0.7 * run["error_raw"]
    assert abs(run["floor"]) < 0.005
    assert run["compression"] < 0.001
    assert run["volume"] < 0.005
    assert run["speed"] < 0.04


def test_a_breaking_dam_coarse():
    run = run_point(dam_break.CASE, Point(("fluid.spacing=7.14375 mm",)), threads=2)
    assert run["error"] < 0.04
    assert 0.0 <= run["shift"] <= 0.25
