"""The loop of the paper's Test 4 as numbers, for those who simulate it in their own way."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram

from benchmarks.solve_ivp_loop import Loop, Noise, Start
from cdpr_drake.diagrams import blocks
from cdpr_drake.model.equilibrium import rest_state
from cdpr_drake.runs import Setup


def numbers_of(setup: Setup) -> tuple[Loop, Start]:
    """Return loop and start of a setup whose controller knows the robot exactly."""
    if setup.loop.believed is not None or setup.loop.timing.sample_time is None:
        raise ValueError("a sampled loop with exact knowledge")
    rest = rest_state(setup.robot, setup.start, setup.tensions)
    loop = Loop(
        goal_rotation=setup.goal.rotation().matrix(),
        goal_position=setup.goal.translation(),
        gain=setup.gain,
        sample_time=setup.loop.timing.sample_time,
        latency=setup.loop.timing.latency,
        ramp_time=setup.loop.ramp_time,
    )
    start = Start(
        rotation=setup.start.rotation().matrix(),
        position=setup.start.translation(),
        length=rest.unstrained_length,
        tension=rest.tension_at_drawing_point,
    )
    return loop, start


def noise_of(diagram: Diagram, context: Context, until: float, sample_time: float) -> Noise:
    """Return the noise that the sources of a loop will give from a context on, unchanged by it."""
    frames = round(until / sample_time) + 1
    sources = {path[-1]: s for path, s in blocks(diagram) if path[-1].endswith("_noise")}
    samples = {
        name.removesuffix("_noise"): _samples(source, context, frames, sample_time)
        for name, source in sources.items()
    }
    return Noise(pose=samples["pose"], tangents=samples["tangent"], tension=samples["tension"])


def _samples(source: Any, context: Context, frames: int, sample_time: float) -> np.ndarray:
    """Return what a source holds in each frame (n, size), run by itself."""
    own = source.CreateDefaultContext()
    own.SetTimeStateAndParametersFrom(source.GetMyContextFromRoot(context))
    simulator = Simulator(source, own)
    rows = []
    for frame in range(frames):
        simulator.AdvanceTo((frame + 0.5) * sample_time)
        rows.append(source.get_output_port().Eval(own))
    return np.array(rows)
