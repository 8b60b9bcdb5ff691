"""Our side of the bench: a World stepped in a process of its own, every stage of every step timed."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections import defaultdict
from typing import Any

import numpy as np

from sim.errors import DivergedError


def run(scene: str, overrides: list[str], order: dict[str, Any]) -> dict[str, Any]:
    """Figures of a scene (see `Watch`), in a fresh process with order["threads"]; compiling is not counted."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_run, (scene, overrides, order))


def _run(scene: str, overrides: list[str], order: dict[str, Any]) -> dict[str, Any]:
    from sim import registry, runtime
    from sim.config import load
    from sim.world import World

    runtime.start(threads=order["threads"])
    registry.discover()
    world = World(load(scene, overrides))
    start = world.save()
    world.advance()
    world.load(start)
    watch = Watch(world, order)
    while world.clock.time < order["seconds"] - 1e-9:
        watch.step()
    runtime.stop()
    return watch.figures()


class Watch:
    """Steps a World as `World.advance` does and notes what it took; looking at the water is not counted.

    steps      a row a step: time after it [s], dt [s], wall [s], CPU [s], iterations of its first and second solve
    solves     what these solve for
    samples    a row every order["sample"] seconds: time, mean of max(rho/rho0 - 1, 0), largest rho/rho0, neighbours
    positions  (n, 3) [m] by time, at every order["keep"]th sample
    stages     wall [s] by name
    """

    def __init__(self, world: Any, order: dict[str, Any]):
        self.world, self.order = world, order
        self.steps, self.samples, self.positions, self.stages = [], [], {}, defaultdict(float)
        self.solves: list[str] = []
        self.looks = 0

    def step(self) -> None:
        """One step."""
        world, laps = self.world, [time.perf_counter()]
        cpu = time.process_time()
        dt = world.clock.next_step(world.stages)
        laps.append(time.perf_counter())
        for stage in world.stages:
            stage.run(dt)
            laps.append(time.perf_counter())
        cpu = time.process_time() - cpu
        world.clock.advance(dt)
        for name, seconds in zip(["limits", *(s.name for s in world.stages)], np.diff(laps)):
            self.stages[name] += seconds
        iterations = world.build.parts["pressure"].iterations
        if any(iterations.values()):
            self.solves = list(iterations)
        self.steps.append([world.clock.time, dt, laps[-1] - laps[0], cpu, *(*iterations.values(), 0, 0)[:2]])
        if world.clock.time >= self.looks * self.order["sample"] - 1e-9:
            self._look()

    def figures(self) -> dict[str, Any]:
        """All of it, with the most memory that the process had [bytes]."""
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        kept = {name: getattr(self, name) for name in ("steps", "solves", "samples", "positions")}
        return kept | {"stages": dict(self.stages), "count": self.order["count"], "memory": memory}

    def _look(self) -> None:
        state, pairs, now = self.world.state, self.world.build.parts["pairs"], self.world.clock.time
        living = state.count[None]
        density = state["fluid.density"].to_numpy()[:living].astype(float) / self.order["rest_density"]
        if living != self.order["count"] or not np.isfinite(density).all():
            raise DivergedError(
                f"bench: {living} of {self.order['count']} particles left in the tank at t = {now:.4g} s"
            )
        near = float((pairs.stop.to_numpy()[:living] - pairs.start.to_numpy()[:living]).mean())
        self.samples.append([now, float(np.maximum(density - 1.0, 0.0).mean()), float(density.max()), near])
        if self.looks % self.order["keep"] == 0:
            self.positions[f"{self.looks * self.order['sample']:.3f}"] = state["fluid.x"].to_numpy()[:living]
        self.looks = int(now / self.order["sample"] + 1e-9) + 1
