"""The integrator's step: chosen from the modes, looked at again, and doubted where it is given."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, FirstOrderLowPassFilter, LinearSystem

from cdpr_drake.analysis import platform_modes
from cdpr_drake.diagrams import (
    make_cable_robot,
    make_simulator,
    make_vision_based_control,
    rest_context,
    set_at_rest,
    simulate,
)
from cdpr_drake.diagrams.step import (
    MAX_STEP,
    Step,
    StepWarning,
    StepWatch,
    choose_step,
    divided,
)
from cdpr_drake.model.equilibrium import forward_kinematics, rest_state
from cdpr_drake.model.robot import CableRobot, load_robot
from cdpr_drake.runs import Setup, make_setup, prepare, run, setup_of_test
from cdpr_drake.runs.moves import move_near_the_middle

OUTSIDE = Path(__file__).parent / "outside"
PAPERS = ("cogiro", "cogiro-22m", "cogiro-37m", "cogiro-98m", "cogiro-2015-pulleys")
P_COGIRO = [0.0, 0.0, 0.0, 0.0, 0.0, 2.0]


def robot_called(name: str) -> CableRobot:
    """Return a built-in robot, or one of the folder of outsiders' files."""
    return load_robot(OUTSIDE / name if name.endswith(".yaml") else name)


def short_move(name: str, **changes: Any) -> Setup:
    """Return a second of a move from the middle of a robot's workspace, without noise."""
    robot = robot_called(name)
    start, goal = move_near_the_middle(robot)
    values = {"noise": False, "until": 1.0, "gain": 0.1, **changes}
    return make_setup(robot=robot, start=start, goal=goal, **values)


def long_move(name: str, start: list[float], goal: list[float], tensions: str) -> Setup:
    """Return a second of a move that sets out fast: 0.3 of its way in a second."""
    ends = ([0.0, 0.0, 0.0, *start], [0.0, 0.0, 0.0, *goal])
    values = {"start": ends[0], "goal": ends[1], "tensions": tensions}
    return short_move(name, gain=0.3).replace(**values)


def stiff(cogiro: CableRobot) -> CableRobot:
    """Return CoGiRo on cables a thousand times as stiff."""
    stiffness = 1000.0 * cogiro.cable.stiffness.asymptote
    return cogiro.replace(cable=cogiro.cable.replace(stiffness=stiffness))


def on_four_threads(mass: float) -> CableRobot:
    """Return a robot that hangs on the upper four cables of the robot in a box."""
    box = robot_called("box.yaml")
    attachment = np.array([[-0.2, 0.15, 0.1], [0.2, 0.15, 0.1], [0.2, -0.15, 0.1]])
    return box.replace(
        platform=box.platform.replace(mass=mass, inertia=0.04 * mass * np.eye(3)),
        drawing_points=box.drawing_points[:4],
        attachment_points=np.vstack([attachment, [-0.2, -0.15, 0.1]]),
        cable=box.cable.replace(drum_run=1.0),
        winch=box.winch.replace(encoder_zero_length=0.0),
        load_cells=box.load_cells.replace(bias=0.0, gain=1.0),
    )


# --- what is chosen


@pytest.mark.parametrize("name", PAPERS)
def test_the_papers_robots_keep_the_usual_step_and_every_bit(name: str) -> None:
    setup = short_move(name, until=0.3, noise=True)
    chosen, given_one = run(setup), run(setup.replace(max_step=MAX_STEP))
    assert chosen.record.step.size == MAX_STEP
    assert chosen.summary.step_decided_by == "usual"
    for signal, values in chosen.record.signals.items():
        np.testing.assert_array_equal(values, given_one.record[signal])


MOVES = {
    "Test 1": setup_of_test(1, noise=False, until=1.0),
    "Test 4": setup_of_test(4, noise=False, until=1.0),
    "Test 4 on stiff cables": setup_of_test(
        4, stiff(load_robot("cogiro")), noise=False, until=0.5
    ),
    **{
        name: short_move(name)
        for name in ("cogiro-22m", "cogiro-98m", "box.yaml", "desk.yaml", "segesta-10", "acrobot")
    },
    "ipanema-2, fast": long_move("ipanema-2", [0, 0, 3], [0.4, 0, 3], "within limits"),
    "caroca, fast": long_move("caroca", [0, 0, 1], [0.3, 0.4, 1.3], "within limits"),
    "box, fast": long_move("box.yaml", [0, 0, 1.2], [0.3, 0.4, 1.5], "within limits"),
    "acrobot, fast": long_move(
        "acrobot", [0.3355, 0.323, 0.3], [0.4, 0.4, 0.4], "minimum norm"
    ),
}  # fmt: skip


@pytest.mark.needs("numba")
@pytest.mark.parametrize("name", MOVES)
def test_a_run_is_that_in_a_tenth_of_the_step(name: str) -> None:
    setup = MOVES[name]
    record = run(setup).record
    fine = run(setup.replace(max_step=record.step.size / 10.0)).record
    assert np.abs(record["pose"] - fine["pose"])[:, 3:].max() < 5e-5  # m
    np.testing.assert_allclose(
        record["tension_at_drawing_point"], fine["tension_at_drawing_point"], rtol=0.01
    )
    assert record.step.size <= MAX_STEP and not record.slack_cables


@pytest.mark.parametrize("mass", [5.0, 0.2])
def test_a_light_robot_on_four_cables_stays_at_rest(mass: float) -> None:
    robot = on_four_threads(mass)
    up = np.array([0.0, 0.0, 1.2])
    length = np.linalg.norm(robot.drawing_points - robot.attachment_points - up, axis=1)
    rest = forward_kinematics(robot, length + robot.cable.drum_run, [0, 0, 0, *up])
    assert_stays(make_cable_robot(robot), robot, rest)


def test_stiff_cables_stay_at_rest(cogiro: CableRobot) -> None:
    robot = stiff(cogiro)
    step = assert_stays(make_cable_robot(robot), robot, rest_state(robot, P_COGIRO))
    assert step.decided_by == "modes" and step.size < MAX_STEP


def assert_stays(diagram: Diagram, robot: CableRobot, rest: Any) -> Step:
    """Check that a robot at rest stays there for half a second; return the step."""
    context = diagram.CreateDefaultContext()
    set_at_rest(diagram, context, rest)
    record = simulate(diagram, context, 0.5)
    np.testing.assert_allclose(record["pose"], record["pose"][[0]] * np.ones((11, 1)), atol=1e-9)
    np.testing.assert_allclose(
        record["tension_at_drawing_point"][-1], rest.tension_at_drawing_point, rtol=1e-6
    )
    return record.step


@pytest.mark.parametrize("name", ["cogiro", "box.yaml", "acrobot"])
@pytest.mark.parametrize("fast", [True, False])
def test_it_is_chosen_from_the_modes_of_the_robot_where_it_is(name: str, fast: bool) -> None:
    robot = robot_called(name)
    start, goal = move_near_the_middle(robot)
    loop = make_vision_based_control(robot, fast=fast)
    for place in (start, goal):
        step = choose_step(loop, rest_context(loop, place), max_step=0.1)
        expected = platform_modes(robot, place, "controlled")
        distance = min(abs(mode.eigenvalue - step.eigenvalue) for mode in expected.modes)
        assert distance < 1e-4 * abs(step.eigenvalue)


@given(st.floats(1e-7, 1e3), st.sampled_from([0.01, 2.5e-3]))
def test_a_whole_number_of_steps_makes_up_the_usual_one(limit: float, largest: float) -> None:
    step = divided(largest, limit)
    assert largest / step == pytest.approx(round(largest / step), rel=1e-12)
    assert step <= limit * (1.0 + 1e-6)
    assert step == largest or largest / (largest / step - 1.0 + 1e-6) > limit


def test_a_simulator_has_the_step_too(cogiro: CableRobot) -> None:
    for robot in (cogiro, load_robot("acrobot")):
        diagram = make_cable_robot(robot)
        context = rest_context(diagram, move_near_the_middle(robot)[0])
        simulator = make_simulator(diagram, context)
        step = choose_step(diagram, context).size
        assert simulator.get_integrator().get_maximum_step_size() == step
        finer = choose_step(diagram, context, largest=2.5e-3).size
        assert finer <= 2.5e-3 and (finer == 2.5e-3) == (robot is cogiro)


def filtered(robot: CableRobot, time_constant: float) -> tuple[Diagram, Context]:
    """Return a robot beside a low-pass filter."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(make_cable_robot(robot))
    source = builder.AddSystem(ConstantVectorSource([0.0]))
    filter_ = builder.AddSystem(FirstOrderLowPassFilter(time_constant))
    builder.Connect(source.get_output_port(), filter_.get_input_port())
    builder.ExportInput(plant.GetInputPort("desired_motor_angles"), "desired_motor_angles")
    diagram = builder.Build()
    return diagram, rest_context(diagram, P_COGIRO)


def test_filters_count_too(cogiro: CableRobot) -> None:
    assert choose_step(*filtered(cogiro, 0.1)).size == MAX_STEP
    step = choose_step(*filtered(cogiro, 1e-3))
    assert step.eigenvalue == -1e3 and step.decided_by == "modes"
    quick = cogiro.replace(load_cells=cogiro.load_cells.replace(cutoff=200.0))
    for fast in (True, False):
        loop = make_vision_based_control(quick, fast=fast)
        step = choose_step(loop, rest_context(loop, P_COGIRO))
        assert step.eigenvalue == pytest.approx(-400.0 * np.pi)
        assert step.size < 0.002


def test_without_cables_or_a_catenary_the_step_is_the_usual_one(cogiro: CableRobot) -> None:
    system = LinearSystem(-1e4 * np.eye(1), np.zeros((1, 0)), np.eye(1), np.zeros((1, 0)))
    assert choose_step(system, system.CreateDefaultContext(), 0.1) == Step(
        size=0.1, decided_by="given"
    )
    diagram = make_cable_robot(cogiro)
    assert choose_step(diagram, diagram.CreateDefaultContext()) == Step()


# --- what is looked at again


def pulled(robot: CableRobot, force: float) -> tuple[Diagram, Context]:
    """Return a robot at rest that a force will pull down at once, from the rest on [N]."""
    diagram = make_cable_robot(robot)
    context = rest_context(diagram, P_COGIRO)
    wrench = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -force])
    diagram.GetInputPort("external_wrench").FixValue(context, wrench)
    return diagram, context


@pytest.mark.needs("numba")
def test_the_step_becomes_smaller_when_tensions_rise(cogiro: CableRobot) -> None:
    robot = stiff(cogiro)
    diagram, context = pulled(robot, 1000.0)
    again = context.Clone()
    before = choose_step(diagram, context)
    record = simulate(diagram, context, 0.3, record=["pose"])
    after = record.step
    assert after.decided_by == "modes" and after.since is not None
    assert after.size < 0.7 * before.size
    fine = simulate(diagram, again, 0.3, record=["pose"], max_step=after.size / 10.0)
    np.testing.assert_allclose(record["pose"], fine["pose"], atol=5e-5)
    assert simulate(*pulled(robot, 0.0), 0.1).step == before


def test_a_step_given_stays_and_is_doubted_once_when_tensions_rise(cogiro: CableRobot) -> None:
    diagram, context = pulled(stiff(cogiro), 200.0)
    coarse = 0.99 * choose_step(diagram, context, max_step=1.0).limit
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        record = simulate(diagram, context, 0.2, record=["pose"], max_step=coarse)
    assert record.step.size == coarse and record.step.doubt
    (told,) = (str(w.message) for w in caught if w.category is StepWarning)
    assert told == record.step.doubt
    assert f"too coarse from {record.step.since:.3g} s on for a mode at" in told


def test_it_is_looked_at_where_the_robot_has_changed_much(monkeypatch: pytest.MonkeyPatch) -> None:
    diagram = make_cable_robot(load_robot("acrobot"))
    context = rest_context(diagram, [0, 0, 0, 0.335, 0.323, 0.5])
    looks: list[float] = []
    step = choose_step(diagram, context)

    def counted(*_: Any, **__: Any) -> Step:
        looks.append(0.0)
        return step

    monkeypatch.setattr("cdpr_drake.diagrams.step.choose_step", counted)
    watch = StepWatch(diagram, context, step)
    pose, tension = np.array([0, 0, 0, 0.335, 0.323, 0.5]), np.ones(8)
    seen = [  # rise of tensions, climb and roll from the start on, whether it is looked at
        (0.0, 0.0, 0.0, True),  # the first look
        (0.09, 0.0, 0.0, False),
        (0.11, 0.0, 0.0, True),
        (-0.5, 0.0, 0.0, False),  # less tension makes no mode faster
        (0.11, 0.02, 0.0, False),
        (0.11, 0.2, 0.0, True),
        (0.11, 0.2, 0.05, False),
        (0.11, 0.2, 0.2, True),
    ]
    for rise, climb, roll, expected in seen:
        looks.clear()
        now = pose + np.array([roll, 0.0, 0.0, 0.0, 0.0, climb])
        assert not watch.look(1.0, now, (1.0 + rise) * tension)
        assert bool(looks) == expected, (rise, climb, roll)


# --- what is doubted


def doubts(call: Any) -> list[str]:
    """Return the messages of the StepWarnings of a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return [str(w.message) for w in caught if w.category is StepWarning]


def test_a_coarse_step_is_told_of_once_wherever_it_is_given(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro)
    context = rest_context(diagram, P_COGIRO)
    setup = setup_of_test(4, noise=False, until=0.2, max_step=0.05)
    for call in (
        lambda: simulate(diagram, context.Clone(), 0.1, max_step=0.05),
        lambda: make_simulator(diagram, context.Clone(), max_step=0.05),
        lambda: run(setup),
        lambda: run(prepare(setup)),
    ):
        (told,) = doubts(call)
        assert "the integrator's step of 50 ms is too coarse for a mode at 15.5 Hz" in told
        assert "in such steps it grows without end; 10 ms would do" in told
    assert not doubts(lambda: simulate(diagram, context.Clone(), 0.1, max_step=0.01))
    chosen = dataclasses.replace(choose_step(diagram, context, 0.05))
    assert not doubts(lambda: simulate(diagram, context.Clone(), 0.1, max_step=chosen))


def test_of_other_integrators_and_error_control_there_is_no_opinion(cogiro: CableRobot) -> None:
    diagram = make_cable_robot(cogiro)
    context = rest_context(diagram, P_COGIRO)
    for options in ({"integrator": "radau3"}, {"accuracy": 1e-3}):
        options = {"max_step": 0.05, **options}
        assert not doubts(
            lambda options=options: simulate(diagram, context.Clone(), 0.1, **options)
        )


@pytest.mark.parametrize(
    ("eigenvalue", "mode"),
    [
        (complex(-3000.0), "a mode that decays at a rate of 3000/s"),
        (complex(-3000.0, 1e-6), "a mode that decays at a rate of 3000/s"),
        (complex(25.0), "a mode that grows at a rate of 25/s"),
        (complex(-300.0, 400.0), "a mode at 79.6 Hz"),
    ],
)
@pytest.mark.parametrize("size", [0.02, 0.5, 100.0])
def test_a_mode_has_a_frequency_or_a_rate(eigenvalue: complex, mode: str, size: float) -> None:
    step = Step(size=size, decided_by="given", eigenvalue=eigenvalue, limit=1e-3, suitable=0.01 / 7)
    assert f"for {mode}: " in step.doubt and step.doubt.endswith("; 1.42 ms would do")
    assert " 0 Hz" not in step.doubt
    share = step.doubt.partition("it gets ")[2].partition(" %")[0]
    assert not share or 0.0 <= float(share) <= 100.0


@pytest.mark.parametrize("name", ["cogiro", "box.yaml", "segesta-10", "acrobot", "caroca"])
def test_the_step_that_would_do_does(name: str) -> None:
    robot = robot_called(name)
    diagram = make_cable_robot(robot)
    context = rest_context(diagram, move_near_the_middle(robot)[0])
    told = choose_step(diagram, context, max_step=0.05).doubt
    milliseconds = float(told.rpartition("; ")[2].removesuffix(" ms would do"))
    assert not choose_step(diagram, context, max_step=1e-3 * milliseconds).doubt
    assert not choose_step(diagram, context, choose_step(diagram, context).size).doubt


# --- what is kept and told of it


def test_the_summary_keeps_the_step_its_reason_and_the_doubt() -> None:
    usual = run(setup_of_test(4, noise=False, until=0.1)).summary.to_dict()
    assert (usual["step_s"], usual["step_decided_by"]) == (0.01, "usual")
    assert usual["step_mode"] == "a mode at 15.5 Hz" and usual["step_warning"] is None
    modes = run(short_move("acrobot", until=0.1)).summary
    assert modes.step < MAX_STEP and modes.step_decided_by == "modes"
    with pytest.warns(StepWarning) as told:
        given_one = run(setup_of_test(4, noise=False, until=0.1, max_step=0.05)).summary
    assert (given_one.step, given_one.step_decided_by) == (0.05, "given")
    assert given_one.step_warning == str(told[0].message)


def test_a_record_tells_of_a_step_that_is_not_the_usual_one() -> None:
    assert "steps" not in repr(run(setup_of_test(4, noise=False, until=0.1)).record)
    assert " with steps of 1.43 ms" in repr(run(short_move("acrobot", until=0.1)).record)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder of the test's own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "500")
    return tmp_path


SHORT = ["--until", "0.1", "--no-figures", "--output", "o"]


def told_by(argv: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[str, str, Any]:
    """Return what a command prints on stdout and stderr, and its summary."""
    from cdpr_drake.__main__ import main

    assert main([*argv, *SHORT]) == 0
    out, err = capsys.readouterr()
    return out, err, json.loads(Path("o/summary.json").read_text())


def test_run_tells_the_step_where_it_is_not_the_usual_one(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["run", "--controller", "vbc", "--no-replay"]
    out, err, summary = told_by([*argv, "--robot", "acrobot"], capsys)
    assert "The integrator's step is 1.43 ms, for a mode at " in out and "coarse" not in err
    assert {run["step_decided_by"] for run in summary["runs"].values()} == {"modes"}
    out, err, summary = told_by(argv, capsys)
    assert "integrator" not in out + err
    out, err, summary = told_by([*argv, "--max-step", "0.05"], capsys)
    assert "The integrator's step is 50 ms." in out
    assert err.count("too coarse for a mode at 15.5 Hz") == 1
    assert all("15.5 Hz" in run["step_warning"] for run in summary["runs"].values())


def test_a_sweep_tells_and_keeps_the_steps(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["sweep", "--cases", "2", "--jobs", "1"]
    out, err, summary = told_by([*argv, "--max-step", "0.05"], capsys)
    assert err.count("too coarse for a mode at 15.5 Hz") == 1
    assert "The integrator's step is 50 ms at its smallest." in out
    step = summary["step"]
    assert (step["lowest_s"], step["highest_s"], step["decided_by"]) == (0.05, 0.05, "given")
    assert "15.5 Hz" in step["warning"] and summary["base"]["max_step"] == 0.05
