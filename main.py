"""Seep: water seeping through cloth. The command line, and nothing else: parse, call, print."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated

import typer
from typer.exceptions import TyperException

from sim.errors import ConfigError, SeepError

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")  # before anything imports Taichi

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Simulate water seeping through cloth, and show it. One scene file in; pictures, a film and a ledger out.",
)

compare = typer.Typer(rich_markup_mode=None, help="Methods side by side, each against what is exact.")
app.add_typer(compare, name="compare")

Scene = Annotated[str, typer.Argument(help="A name in configs/scenes, or the path of a scene file.")]
Run = Annotated[str, typer.Argument(help="A run's folder, or scene/number such as seep/003, or a scene: its newest.")]
Settings = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set a key; may be repeated.")]
Quick = Annotated[bool, typer.Option("--quick", help="Lay the scene's [quick] section over it: coarse, in seconds.")]
Frames = Annotated[int | None, typer.Option(min=1, help="Simulate this many frames instead of run.duration.")]
Arch = Annotated[str | None, typer.Option(help="cpu | cuda | vulkan | metal")]
Threads = Annotated[int | None, typer.Option(help="Threads of the cpu; 0 takes every core. The bits are the same.")]
Precision = Annotated[str | None, typer.Option(help="f32 | f64")]
Seed = Annotated[int | None, typer.Option(help="Of the jitter of emitters.")]


@app.command()
def scenes(
    methods: Annotated[bool, typer.Option("--methods", help="Every method a scene can name, with parameters.")] = False,
    fabric: Annotated[str | None, typer.Option(help="Show a fabric card and what follows from it.")] = None,
) -> None:
    """List the demo scenes, a line each."""
    from sim import listing

    if methods:
        print(listing.methods())
    elif fabric:
        print(listing.fabric(fabric))
    else:
        print(listing.scenes())


@app.command()
def run(
    scene: Scene,
    settings: Settings = None,
    out: Annotated[Path | None, typer.Option(help="The run's folder: absent or empty.")] = None,
    frames: Frames = None,
    quick: Quick = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with --out, or the newest unfinished run.")] = False,
    no_render: Annotated[bool, typer.Option("--no-render", help="Simulate only; `video` draws later.")] = False,
    arch: Arch = None,
    threads: Threads = None,
    precision: Precision = None,
    seed: Seed = None,
) -> None:
    """Simulate a scene, draw it, make the film."""
    from sim import run as runs

    config = _config(scene, settings, quick, frames, arch=arch, threads=threads, precision=precision, seed=seed)
    where = runs.plan(config, out, resume)
    if where.finished:
        folder = runs.RunFolder(where.path)
        print(f"{folder.label}: finished already")
    else:
        with nullcontext() if no_render else _artist(config) as draw:
            world = _world(config)
            with _progress("simulating", world.frame_count) as reach:
                folder = runs.drive(world, config, where, _each(draw, reach))
        print(f"{folder.label}: {world.frame_count} frames, ledger {folder.ledger}")
        print(f"{folder.label}: {_cost(folder.record())}")
    if not no_render and not (where.finished and folder.video.exists()):
        _chart(folder)
        _film(folder, config)
        print(f"{folder.label}: film {folder.video}")


@app.command()
def video(
    name: Run,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Pixels, such as 634x356; even numbers.")] = None,
    fps: Annotated[int | None, typer.Option(min=1, help="Of the film; the scene's own if left out.")] = None,
    eye: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Where the camera stands [m].")] = None,
    target: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="What it looks at [m].")] = None,
    fov: Annotated[str | None, typer.Option(metavar="ANGLE", help="Vertical field of view, such as '32 deg'.")] = None,
    look: Annotated[str | None, typer.Option(help="Of water: film | particles.")] = None,
    out: Annotated[Path | None, typer.Option(help="The film; RUN/video.mp4 if left out.")] = None,
) -> None:
    """Draw a finished run again: other camera, size, look or speed."""
    from sim import config, runtime
    from sim import run as runs

    folder = runs.find(name)
    settings = [f"render.size=[{size.replace('x', ',')}]"] if size else []
    settings += [f"render.camera.{k}=[{v}]" for k, v in (("eye", eye), ("target", target)) if v]
    settings += [f"render.camera.fov={fov}"] if fov else []
    settings += [f"render.look={look}"] if look else []
    again = config.load(folder.config, settings)
    if not folder.frames():
        raise ConfigError(f"{folder.label}: holds no frames")
    runtime.start(again.run.arch, again.run.threads or None, again.run.precision)
    film = out or folder.video
    _film(folder, again, film, fps, anew=True)
    print(f"{folder.label}: film {film}")


@app.command()
def view(
    scene: Scene,
    settings: Settings = None,
    quick: Quick = False,
    frames: Frames = None,
    capture: Annotated[Path | None, typer.Option(help="Drive the window unseen and write its PNGs here.")] = None,
    arch: Arch = None,
    threads: Threads = None,
    precision: Precision = None,
) -> None:
    """Watch a scene live: drag to orbit, space to pause, s to step, r to start again, escape to leave."""
    config = _config(scene, settings, quick, frames, arch=arch, threads=threads, precision=precision)
    world = _world(config)
    from render import draw, window

    start = world.save()

    def reset():
        world.load(start)
        return world.snapshot()

    def step():
        return world.advance() if world.frame_index < world.frame_count else None

    pictures = frames if capture else None
    shown = window.live(step, reset, draw.draw, _look(config), world.static, config.name, capture, pictures)
    if capture:
        print(f"{config.name}: {shown} pictures in {capture}")


@app.command()
def chart(
    topic: Annotated[str, typer.Argument(help="A study in configs/studies, such as water.")],
    check: Annotated[bool, typer.Option("--check", help="Only what has a bound; exit 1 where one is missed.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Coarse, within a minute.")] = False,
    row: Annotated[str | None, typer.Option(metavar="ID", help="Run one row again; print it beside the old.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of CSV and PNG; else outputs/chart/TOPIC.")] = None,
    anew: Annotated[bool, typer.Option("--anew", help="Run rows again that the CSV has already.")] = False,
    threads: Threads = None,
) -> None:
    """Error over time for every method, and whether each case comes to what it must. A cut chart goes on."""
    from sim.run import OUTPUTS
    from sim.studies import chart as charts
    from sim.studies import report, table

    plan = charts.plan(topic, quick, check)
    path = (out or OUTPUTS / "chart" / topic) / f"{topic}{'-quick' if quick else ''}.csv"
    if row:
        job = charts.find(plan, row)
        old = {r["id"]: r for r in table.read(path)}.get(job.id) if path.exists() else None
        print(report.compared(old, charts.run_job(job, plan, threads or 0)))
        return
    rows = []
    with _progress(f"chart {topic}", len(plan.jobs)) as reach:
        for done in charts.run(plan, path, threads or 0, anew):
            rows.append(done)
            reach(len(rows))
    print("\n".join(part for part in (report.text(rows), report.choices(rows, plan.levels)) if part))
    _study_chart(path)
    print(f"{path}, {path.with_suffix('.png')}")
    if check:
        report.hold(topic, rows)


@compare.command("ccd")
def compare_ccd(
    queries: Annotated[
        Path, typer.Option(help="An .npz with V (n, 8, 3): v, f0, f1, f2 at t0, then at t1; truth, toi.")
    ],
    out: Annotated[Path, typer.Option(help="Where `hit` and `toi` go, an .npz.")],
    precision: Annotated[str, typer.Option(help="f32 | f64")] = "f32",
    threads: Threads = None,
) -> None:
    """Does a moving point meet a moving triangle, and when: every narrow phase, counted against the file's truth."""
    from sim import runtime
    from sim.studies import narrow

    given = narrow.read(queries)
    runtime.start(threads=threads or None, precision=precision)
    narrow.compare(given, out, precision, print)


@compare.command("leaks")
def compare_leaks(
    quick: Annotated[bool, typer.Option("--quick", help="The corners of the sweep, in a minute or two.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder of CSV and PNG; else outputs/compare.")] = None,
    threads: Threads = None,
) -> None:
    """Throw water at a sheet, at every speed, step and thickness; exit 1 if any gets through where none must."""
    from render.leaks import leak_chart
    from sim.run import OUTPUTS
    from sim.studies import leaks

    study = leaks.load(quick)
    path, rows = (out or OUTPUTS / "compare") / f"leaks{'-quick' if quick else ''}.csv", []
    with _progress("compare leaks", 2 * len(study.thickness)) as reach:
        for done, found in enumerate(leaks.run(study, path, threads or 0), 1):
            rows += found
            reach(done)
    leak_chart(path, path.with_suffix(".png"))
    print(f"{leaks.verdict(rows)}\n{path}, {path.with_suffix('.png')}")
    leaks.hold(rows)


@app.command()
def ablate(
    scene: Annotated[str, typer.Argument(help="A scene that fails: explosion or implosion.")],
    settings: Settings = None,
    frames: Frames = None,
    out: Annotated[Path | None, typer.Option(help="Folder of CSV and PNG; else outputs/ablate/SCENE.")] = None,
    threads: Threads = None,
) -> None:
    """Why a scene fails: undo its causes one at a time, and leave each in alone; a page that shows which mattered."""
    from render.ablation import ablation_chart
    from sim.run import OUTPUTS
    from sim.studies import ablate as ablation

    config = _config(scene, settings, False, frames)
    settings = (*(settings or ()), f"run.duration={config.run.duration!r}")
    folder, rows = out or OUTPUTS / "ablate" / config.name, []
    with _progress(f"ablate {config.name}", len(ablation.trials(ablation.load()))) as reach:
        for row in ablation.run(scene, folder, settings, threads or 0):
            rows.append(row)
            reach(len(rows))
    ablation_chart(folder / "ablate.csv", folder / "places.csv", folder / "ablate.png")
    print(f"{config.name}: {ablation.verdict(rows)}")
    print(f"{folder / 'ablate.csv'}, {folder / 'ablate.png'}")


@app.command()
def gallery(
    out: Annotated[Path | None, typer.Option(help="The picture; outputs/gallery/fabrics.png if left out.")] = None,
) -> None:
    """Drape every fabric card over the same pedestal, and put the pictures side by side."""
    from render.gallery import portrait, side_by_side
    from sim.run import OUTPUTS
    from sim.studies import drapes

    path, cards, pictures = out or OUTPUTS / "gallery" / "fabrics.png", drapes.cards(), []
    with _progress("gallery", len(cards)) as reach:
        for name, card in cards:
            picture, coefficient = drapes.hang(name, portrait)
            pictures.append((drapes.words(name, card, coefficient), picture))
            reach(len(pictures))
    path.parent.mkdir(parents=True, exist_ok=True)
    side_by_side(pictures, path)
    print(path)


@app.command()
def doctor(
    scene: Annotated[str | None, typer.Argument(help="A scene: its constants, limits and cost.")] = None,
    settings: Settings = None,
    quick: Quick = False,
) -> None:
    """What this machine can do, in ten lines; of a scene, what follows from it, which limit binds, what it costs."""
    from sim import advice
    from sim import doctor as doctors

    print(advice.scene(_config(scene, settings, quick)) if scene else doctors.machine())


@app.command()
def bench(
    case: Annotated[str, typer.Argument(help="A case, or how its name begins; all if left out.")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="One small case, in seconds.")] = False,
    threads: Annotated[int, typer.Option(min=1, help="Of either side.")] = 2,
    rounds: Annotated[int, typer.Option(min=0, help="Runs of either side, in turns; 0: 3, or 1 with --quick.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder of the tables; outputs/bench if left out.")] = None,
) -> None:
    """Time water beside pySPlisHSPlasH and cloth beside pyPBD (of .venv-peers, or the Python that SEEP_PEERS names)."""
    from sim.run import OUTPUTS
    from sim.studies import bench as benches

    print(f"{benches.run(case, quick, threads, rounds, out or OUTPUTS / 'bench', print)}")


@compare.callback(invoke_without_command=True)
def compare_searches(
    context: typer.Context,
    quick: Annotated[bool, typer.Option("--quick", help="Of the searches: smaller, within a minute.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder of their CSV and PNG; else outputs/compare.")] = None,
) -> None:
    """Methods side by side; without a further word: searches over patches, by what a step costs and what they
    find, then narrow phases."""
    if context.invoked_subcommand:
        return
    from render.searches import accuracy_chart, search_chart
    from sim import registry, runtime
    from sim.run import OUTPUTS
    from sim.studies.search import compare as searches

    runtime.start(threads=1)
    registry.discover()
    sizes = searches.QUICK if quick else searches.FULL
    path, rows = (out or OUTPUTS / "compare") / f"searches{'-quick' if quick else ''}.csv", []
    with _progress("compare", len(sizes.patches)) as reach:
        for done, found in enumerate(searches.run(sizes, path), 1):
            rows += found
            reach(done)
    accuracy = path.with_name(f"{path.stem}-accuracy.csv")
    search_chart(path, path.with_suffix(".png"))
    accuracy_chart(accuracy, accuracy.with_suffix(".png"))
    print(f"{searches.told(searches.fits(rows))}\n{searches.verdict(rows)}\n{path}, {path.with_suffix('.png')}")
    compare_narrow(quick, out)


@compare.command("narrow")
def compare_narrow(
    quick: Annotated[bool, typer.Option("--quick", help="A tenth of the queries.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder of CSV and PNG; else outputs/compare.")] = None,
) -> None:
    """Speed against accuracy of every narrow phase, f32 and f64, on queries that rational arithmetic has answered."""
    from render.narrow import narrow_chart
    from sim.run import OUTPUTS
    from sim.studies import narrow_chart as narrow

    path = (out or OUTPUTS / "compare") / f"narrow{'-quick' if quick else ''}.csv"
    rows = narrow.run(quick, path)
    narrow_chart(path, path.with_suffix(".png"))
    print(f"{narrow.verdict(rows)}\n{path}, {path.with_suffix('.png')}")


@compare.command("tree")
def compare_tree(
    name: Run,
    frame: Annotated[int | None, typer.Option(min=0, help="Of the run; its last if left out.")] = None,
    out: Annotated[Path | None, typer.Option(help="The picture; RUN/tree.png if left out.")] = None,
) -> None:
    """Draw the boxes of the report's tree over the cloth of a run, level by level."""
    from render import boxes, draw
    from sim import config, runtime
    from sim import frame as frames
    from sim import run as runs
    from sim.studies.search import levels

    folder = runs.find(name)
    kept, look = folder.frames(), _look(config.load(folder.config))
    number = kept[-1] if frame is None and kept else frame
    if number not in kept:
        raise ConfigError(f"{folder.label}: no frame {number}; it has {len(kept)}")
    runtime.start()
    shown, static = frames.read(folder.frame(number)), frames.read(folder.static, frames.Static)
    path = out or folder.path / "tree.png"
    levels.write(path.with_suffix(".npz"), shown, static)
    boxes.boxes_picture(path.with_suffix(".npz"), draw.draw(shown, look, static), look, path)
    print(f"{folder.label}: {path}")


def _config(scene: str, settings: list[str] | None, quick: bool, frames: int | None = None, **options):
    """The scene with the command line's keys over it; options are keys of [run]."""
    from sim import config

    settings = [*(settings or []), *(f"run.{k}={v}" for k, v in options.items() if v is not None)]
    if frames:
        settings.append(f"run.duration={frames / config.load(scene, settings, quick).run.fps!r}")
    loaded = config.load(scene, settings, quick)
    for warning in loaded.warnings:
        print(f"{loaded.name}: {warning}", file=sys.stderr)
    return loaded


def _world(config):
    """Start Taichi and build the scene: the one heavy step before the first frame."""
    from sim import runtime

    runtime.start(config.run.arch, config.run.threads or None, config.run.precision)
    from sim.world import World

    return World(config)


def _look(config):
    from render.draw import Look

    r = config.render
    camera = {"eye": r.camera.eye, "target": r.camera.target, "fov": r.camera.fov}
    return Look(size=r.size, light=r.light.direction, water=r.look, **camera)


def _artist(config):
    """Draws the run's frames, one ordered by its files, while the next are simulated; one thread is enough."""
    from functools import partial

    from render.artist import artist
    from sim import runtime

    run = config.run
    begin = partial(runtime.start, run.arch, 1 if run.arch == "cpu" else None, run.precision)
    return artist(_look(config), begin, runtime.stop)


def _each(draw: Callable | None, reach: Callable[[int], None]) -> Callable:
    def each(folder, index, snapshot):
        if draw:
            draw(folder.static, folder.frame(index), folder.image(index))
        reach(index)

    return each


def _film(folder, config, path: Path | None = None, fps: int | None = None, anew: bool = False) -> None:
    """The film of a run, from its pictures, or drawn from its frames where there are none (or `anew`)."""
    from imageio.v3 import imread

    from render import draw, film
    from sim import frame

    numbers, look = folder.frames(), _look(config)
    static = frame.read(folder.static, frame.Static)

    def pictures():
        with _progress("filming", len(numbers)) as reach:
            for done, n in enumerate(numbers, 1):
                if anew or not folder.image(n).exists():
                    yield draw.draw(frame.read(folder.frame(n)), look, static)
                else:
                    yield imread(folder.image(n))
                reach(done)

    film.write_film(path or folder.video, pictures(), look.size, fps or config.render.fps or config.run.fps)


def _cost(record: dict) -> str:
    """Where the time went, the dearest stages first."""
    stages = sorted(record["stages"].items(), key=lambda item: -item[1])[:6]
    dearest = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in stages)
    return f"{record['seconds_per_simulated_second'] or 0:.1f} s per simulated second; {dearest}"


def _chart(folder) -> None:
    from render import charts

    charts.ledger_chart(folder.ledger, folder.path / "ledger.png")


def _study_chart(path: Path) -> None:
    from render.study import study_chart

    study_chart(path, path.with_suffix(".png"))


@contextmanager
def _progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar with the time left; silent where the output is no terminal."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; errors are one line on stderr, the exit code is returned."""
    try:
        code = app(arguments or sys.argv[1:] or ["--help"], standalone_mode=False)
        return code if isinstance(code, int) else 0
    except SeepError as error:
        return _fail(str(error), error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return _fail("interrupted; the same command goes on, a run with --resume", 130)
    except TyperException as error:
        return _fail(error.format_message(), ConfigError.exit_code)
    except MemoryError:
        return _fail("out of memory; use a larger spacing", 4)
    except OSError as error:
        return _fail(f"{error.filename or 'disk'}: {error.strerror or error}", 4)
    finally:
        _finish()


def _finish() -> None:
    """Keep what was compiled for the next start."""
    runtime = sys.modules.get("sim.runtime")
    if runtime:
        runtime.stop()


def _fail(line: str, code: int) -> int:
    print(" ".join(line.split()), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
