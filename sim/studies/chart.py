"""A chart: points of cases and sweeps run one after another into a CSV, which a cut chart goes on from."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from sim import config, registry
from sim.errors import CapacityError, ConfigError, DivergedError
from sim.run import VERSION
from sim.studies import table
from sim.studies.case import Case, Point, run_point
from sim.studies.study import Study, cases, load
from sim.studies.table import Row

SIM = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Job:
    """One row to be: a point of a case. checked: held to its bounds; swept: on the chart of error over time."""

    case: Case
    point: Point
    checked: bool = False
    swept: bool = False

    @property
    def id(self) -> str:
        """The case's name, and a hash of what is run: the same on every machine and in every version."""
        run = [self.case.name, self.case.scene, self.point.precision, *self.point.overrides]
        return f"{self.case.name}-{hashlib.sha256(repr(run).encode()).hexdigest()[:6]}"

    @property
    def bounds(self) -> dict[str, float]:
        """figure -> largest absolute value allowed."""
        return self.case.bounds | self.point.bounds if self.checked else {}

    def config(self):
        """The scene as this point runs it. ConfigError if it is none."""
        return config.load(self.case.scene, [f'run.precision="{self.point.precision}"', *self.point.overrides])


@dataclass(frozen=True)
class Plan:
    """What a chart runs, which method and errors its study marks, and the ids of all rows that the study has."""

    jobs: tuple[Job, ...]
    report: str
    levels: tuple[float, ...]
    quick: bool
    ids: frozenset[str]


def plan(topic: str, quick: bool = False, check_only: bool = False) -> Plan:
    """The points of all cases, then of all sweeps; each once. ConfigError if the study or a scene is wrong."""
    study, found = load(topic, quick), cases(topic)
    jobs = [Job(c, p, checked=True) for c in found.values() for p in (c.quick if quick else c.full)]
    jobs += [Job(found[name], point, swept=True) for name in study.sweep for point in _swept(study, name)]
    once: dict[str, Job] = {}
    for job in jobs:
        same = once.get(job.id)
        once[job.id] = replace(same, swept=True) if same else job
    kept = tuple(job for job in once.values() if job.bounds or not check_only)
    for job in kept:
        job.config()
    return Plan(kept, study.report, study.levels, quick, frozenset(once))


def _swept(study: Study, name: str) -> list[Point]:
    """Method x spacing x setting x dt of one sweep. A method that the study does not name runs as it comes."""
    sweep, points, section = study.sweep[name], [], study.section
    for method in (m for m in registry.methods(study.kind) if m not in sweep.skip):
        steps = sweep.method.get(method)
        settings = steps.settings if steps else ((),)
        limits = (steps.dt if steps else ()) or (None,)
        for spacing in sweep.spacing or (None,):
            for setting in settings:
                for dt in limits:
                    step = "run.dt_max" if section == "fluid" else f"cloth.{method}.substep_max"
                    given = {f"{section}.method": method, f"{section}.spacing": spacing, step: dt}
                    texts = [f"{key}={value}" for key, value in given.items() if value is not None]
                    points.append(Point((*sweep.overrides, *texts, *setting), sweep.precision))
    return points


def run(plan: Plan, path: Path, threads: int = 0, anew: bool = False) -> Iterator[Row]:
    """Run what is not in the CSV yet, or was made by another recipe; yields each row in order, written to disk.

    Rows that the study has and this plan has not stay in the file as they are.
    """
    there = {row["id"]: row for row in table.read(path)} if path.exists() else {}
    kept, done = {} if anew else _kept(plan, there), {}
    for job_id, row in _rows(plan, kept, threads):
        done[job_id] = row
        rest = [row for name, row in there.items() if name in plan.ids and name not in done]
        table.write(path, table.marked([*done.values(), *rest], plan.levels))
        yield row


def _kept(plan: Plan, there: dict[str, Row]) -> dict[str, Row]:
    """Rows that need not run again, with the bounds and marks of today."""
    kept = {}
    for job in plan.jobs:
        frame, old = _frame(job, plan), there.get(job.id)
        if old and old["recipe"] == frame["recipe"]:
            kept[job.id] = old | {word: frame[word] for word in ("role", "bounds", "report")}
    return kept


def _rows(plan: Plan, kept: dict[str, Row], threads: int) -> Iterator[tuple[str, Row]]:
    """Each row with its id, in order: one point at a time, for its seconds are measured; a quick chart's two at a time
    on a thread each, for these are mostly starts."""
    if not plan.quick:
        for job in plan.jobs:
            yield job.id, kept.get(job.id) or run_job(job, plan, threads)
        return
    with ThreadPoolExecutor(2) as pool:
        due = {job.id: pool.submit(run_job, job, plan, threads or 1) for job in plan.jobs if job.id not in kept}
        try:
            for job in plan.jobs:
                yield job.id, kept.get(job.id) or due[job.id].result()
        finally:
            pool.shutdown(cancel_futures=True)


def run_job(job: Job, plan: Plan, threads: int = 0) -> Row:
    """One row; a run that diverges or does not fit is a row too, failed, with the reason."""
    row = _frame(job, plan)
    try:
        figures = run_point(job.case, job.point, threads)
    except (DivergedError, CapacityError) as error:
        figures, row["failure"] = getattr(error, "cost", {}), str(error)
    for name, value in figures.items():
        row[name] = table.cell(value)
    return table.marked([row], plan.levels)[0]


def find(plan: Plan, name: str) -> Job:
    """The job of an id, or of its beginning. ConfigError if there is none, or more than one."""
    near = [job for job in plan.jobs if job.id.startswith(name)]
    exact = [job for job in near if job.id == name]
    if len(exact or near) != 1:
        there = ", ".join(job.id for job in near or plan.jobs)
        raise ConfigError(f"--row {name}: {'several rows' if near else 'no row'} of this name; there are {there}")
    return (exact or near)[0]


def recipe(job: Job) -> str:
    """Of the code, the case and the scene that make a row: a row of another recipe is run again."""
    case = _digest((Path(inspect.getfile(job.case.measure)), SIM / "studies/case.py"))
    made_of = version() + case + config.resolved_toml(job.config())
    return hashlib.sha256(made_of.encode()).hexdigest()[:8]


@cache
def version() -> str:
    """Of the program: its number, and a hash of sim/ without the studies."""
    files = sorted(p for p in SIM.rglob("*.py") if SIM / "studies" not in p.parents)
    return f"{VERSION}+{_digest(tuple(files))[:8]}"


@cache
def _digest(files: tuple[Path, ...]) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def _frame(job: Job, plan: Plan) -> Row:
    """What a row says before it is run."""
    scene = job.config()
    shown = scene.fluid or scene.cloth
    return table.blank() | {
        "id": job.id,
        "version": version(),
        "recipe": recipe(job),
        "case": job.case.name,
        "reference": job.case.reference,
        "scene": job.case.scene,
        "method": shown.method,
        "role": " ".join(["check"] * job.checked + ["sweep"] * job.swept),
        "report": "1" if shown.method == plan.report else "",
        "spacing": table.cell(shown.spacing),
        "precision": job.point.precision,
        "overrides": "; ".join(job.point.overrides),
        "bounds": " ".join(f"{figure}<={bound:g}" for figure, bound in job.bounds.items()),
    }
