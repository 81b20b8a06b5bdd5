"""What `simulate` refuses, and what a record can tell of itself."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource

from cdpr_drake import pose
from cdpr_drake.diagrams import (
    Record,
    make_cable_robot,
    make_vision_based_control,
    rest_context,
    simulate,
)
from cdpr_drake.diagrams.simulation import RECORDED, WATCHED, make_simulator
from cdpr_drake.model.robot import load_robot
from cdpr_drake.model.signals import ERROR, POSE, TWIST, WRENCH, vector_names

X_REST = pose(x=0.2, y=-0.1, z=1.2, yaw_deg=3.0)


@pytest.fixture(scope="module")
def loop() -> Diagram:
    return make_vision_based_control(load_robot("cogiro"))


@pytest.fixture
def context(loop: Diagram) -> Context:
    return rest_context(loop, X_REST)


@pytest.fixture(scope="module")
def record(loop: Diagram) -> Record:
    names = ["pose", "pose_error", "tension_at_winch", "tangents_at_drawing_point"]
    return simulate(loop, rest_context(loop, X_REST), 0.25, record=names, every=0.1)


def made_up(**fields: Any) -> Record:
    """Return a record with some fields of its own."""
    return Record(
        **{
            "time": np.array([0.0, 0.5]),
            "signals": {"pose": np.zeros((2, 6))},
            "context": None,
            "wall_time": 0.25,
            "slack_cables": {},
            **fields,
        }
    )


# --- what is refused


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"until": math.nan}, "a finite end and a positive period"),
        ({"every": 0.0}, "a finite end and a positive period"),
        ({"every": -0.1}, "a finite end and a positive period"),
        ({"every": math.inf}, "a finite end and a positive period"),
        ({"until": -0.1}, "is to end at -0.1 s, but the context is at 0 s already"),
        *(
            ({name: bad}, f"{name}.* must be positive and finite, got {bad}")
            for name in ("max_step", "accuracy")
            for bad in (0.0, -0.01, math.nan, math.inf)
        ),
        ({"record": ["posse"]}, 'nothing to record by the name of "posse"; .* ports are .*pose, '),
        (
            {"record": ["pose", "a", "b"]},
            'by the name of "a", "b"; the diagram\'s output ports are',
        ),
        ({"record": "posse"}, 'nothing to record by the name of "posse"'),
    ],
)
def test_a_run_that_cannot_be_meant_is_refused_before_it_starts(
    loop: Diagram, context: Context, options: dict[str, Any], message: str
) -> None:
    before = context.get_continuous_state_vector().CopyToVector()
    with pytest.raises(ValueError, match=message):
        simulate(loop, context, **{"until": 0.2, **options})
    assert context.get_time() == 0.0
    np.testing.assert_array_equal(context.get_continuous_state_vector().CopyToVector(), before)


def test_an_end_before_now_is_refused_and_now_is_one_line(loop: Diagram, context: Context) -> None:
    simulate(loop, context, 0.1, record=["pose"])
    with pytest.raises(ValueError, match=r"to end at 0.05 s, but the context is at 0.1 s already"):
        simulate(loop, context, 0.05)
    assert simulate(loop, context, 0.1, record=["pose"]).time == pytest.approx([0.1])


def test_a_simulator_has_a_step_and_an_accuracy(loop: Diagram, context: Context) -> None:
    for options in ({"max_step": 0.0}, {"max_step": math.nan}, {"accuracy": -1.0}):
        with pytest.raises(ValueError, match="must be positive and finite"):
            make_simulator(loop, context, **options)


def test_all_unknown_names_are_told_with_all_there_are(loop: Diagram, context: Context) -> None:
    with pytest.raises(ValueError) as caught:
        simulate(loop, context, 0.1, record=["pose", "motor angles", "tension"])
    for i in range(loop.num_output_ports()):
        assert loop.get_output_port(i).get_name() in str(caught.value).partition("ports are")[2]
    assert '"motor angles", "tension"' in str(caught.value)


def test_one_name_need_not_be_a_list(loop: Diagram, context: Context) -> None:
    assert list(simulate(loop, context, 0.0, record="pose").signals) == ["pose"]
    assert not simulate(loop, context, 0.0, record=[]).signals


def test_what_a_diagram_does_not_have_is_left_out_if_nobody_asked_for_it() -> None:
    robot = make_cable_robot(load_robot("cogiro"))
    assert not all(map(robot.HasOutputPort, RECORDED))
    signals = simulate(robot, rest_context(robot, X_REST), 0.0).signals
    assert list(signals) == [name for name in RECORDED if robot.HasOutputPort(name)]


def built_around(*exported: str, picture: bool = False) -> Diagram:
    """Return a diagram built around a robot, which exports some of the robot's outputs."""
    builder = DiagramBuilder()
    robot = builder.AddSystem(make_cable_robot(load_robot("cogiro")))
    builder.ExportInput(robot.GetInputPort("desired_motor_angles"), "desired_motor_angles")
    for name in exported:
        builder.ExportOutput(robot.GetOutputPort(name), name)
    if picture:
        source = builder.AddSystem(ConstantValueSource(Value("a picture")))
        builder.ExportOutput(source.get_output_port(), "picture")
    diagram: Diagram = builder.Build()
    diagram.set_name("hall")
    return diagram


@pytest.mark.parametrize("missing", WATCHED)
def test_a_diagram_that_lacks_what_is_watched_is_told_what_to_export(missing: str) -> None:
    diagram = built_around(*(name for name in WATCHED if name != missing))
    with pytest.raises(ValueError) as caught:
        simulate(diagram, rest_context(diagram, X_REST), 0.1)
    assert f'diagram "hall" has no output port "{missing}"' in str(caught.value)
    assert f'ExportOutput(robot.GetOutputPort("{missing}"), "{missing}")' in str(caught.value)


def test_a_diagram_that_exports_what_is_watched_runs() -> None:
    diagram = built_around(*WATCHED, picture=True)
    context = rest_context(diagram, X_REST)
    assert set(simulate(diagram, context, 0.1).signals) == set(WATCHED)
    with pytest.raises(ValueError, match=r'name of "picture"; .* pose, tension_at_drawing_point$'):
        simulate(diagram, context, 0.2, record=["picture"])


# --- a record in a few lines


def test_a_record_says_what_it_is_in_a_few_lines(record: Record) -> None:
    first, *rest = repr(record).splitlines()
    assert first.startswith("Record: 0 to 0.25 s, 4 rows, computed in ")
    assert rest == [
        "  signals: pose (6), pose_error (6), tension_at_winch (8), tangents_at_drawing_point (24)"
    ]


def test_slack_cables_are_in_it() -> None:
    text = repr(made_up(slack_cables={5: 0.45, 3: 1.25}))
    assert text.splitlines()[-1] == "  slack cables: 3 from 1.25 s, 5 from 0.45 s"
    assert "slack" not in repr(made_up())


@pytest.mark.parametrize("count", [0, 1, 17, 200])
@pytest.mark.parametrize("rows", [0, 1, 3])
def test_a_record_is_never_long(count: int, rows: int) -> None:
    signals = {f"tension_at_{i}": np.zeros((rows, 8)) for i in range(count)}
    slack = {cable: 0.5 for cable in range(1, 65)}
    text = repr(made_up(time=np.arange(rows) / 10.0, signals=signals, slack_cables=slack))
    assert len(text.splitlines()) <= 6
    assert max(map(len, text.splitlines())) <= 100
    assert f"{rows} row" in text
    assert (" ..." in text.partition("slack")[0]) == (count == 200)


# --- a record as a table


def test_a_record_s_columns_have_the_names_of_linear_models(record: Record) -> None:
    columns = record.columns()
    assert list(columns)[:8] == [
        "time",
        *(f"pose/{part}" for part in POSE),
        "pose_error/rotation_x",
    ]
    assert list(columns)[-1] == "tangents_at_drawing_point[8]/z"
    assert len(columns) == 1 + 6 + 6 + 8 + 24
    np.testing.assert_array_equal(columns["pose/yaw"], record["pose"][:, 2])
    np.testing.assert_array_equal(columns["tension_at_winch[8]"], record["tension_at_winch"][:, 7])


@pytest.mark.parametrize(
    ("name", "size", "names"),
    [
        ("desired_pose", 6, [f"desired_pose/{part}" for part in POSE]),
        ("pose_error_seen", 6, [f"pose_error_seen/{part}" for part in ERROR]),
        ("desired_twist", 6, [f"desired_twist/{part}" for part in TWIST]),
        ("external_wrench", 6, [f"external_wrench/{part}" for part in WRENCH]),
        ("platform_state", 12, [f"platform_state/{part}" for part in POSE + TWIST]),
        (
            "tangents",
            6,
            [
                "tangents[1]/x",
                "tangents[1]/y",
                "tangents[1]/z",
                *(f"tangents[2]/{axis}" for axis in "xyz"),
            ],
        ),
        ("dbeta", 3, ["dbeta[1]", "dbeta[2]", "dbeta[3]"]),
        ("motor_angles", 6, [f"motor_angles[{i}]" for i in range(1, 7)]),
        ("frames_lost", 1, ["frames_lost"]),
    ],
)
def test_names_of_entries(name: str, size: int, names: list[str]) -> None:
    assert vector_names(name, size) == tuple(names)


def test_a_record_goes_through_a_file_to_the_last_bit(record: Record, tmp_path: Path) -> None:
    path = record.to_csv(tmp_path / "run.csv")
    assert path == tmp_path / "run.csv"
    with path.open(newline="") as file:
        heading, *lines = csv.reader(file)
    columns = record.columns()
    assert heading == list(columns)
    np.testing.assert_array_equal(np.array(lines, float), np.column_stack([*columns.values()]))


def test_a_record_of_nothing_has_its_times(tmp_path: Path) -> None:
    made_up(signals={}).to_csv(str(tmp_path / "run.csv"))
    assert (tmp_path / "run.csv").read_text() == "time\n0\n0.5\n"


def test_a_file_that_cannot_be_written_is_an_error(record: Record, tmp_path: Path) -> None:
    with pytest.raises(OSError):
        record.to_csv(tmp_path / "not there" / "run.csv")


class Frame:
    """What stands for a pandas DataFrame."""

    def __init__(self, data: dict[str, np.ndarray]) -> None:
        self.data = data

    def set_index(self, name: str) -> tuple[str, dict[str, np.ndarray]]:
        return name, self.data


def test_a_record_as_a_data_frame(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    pandas: Any = ModuleType("pandas")
    pandas.DataFrame = Frame
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    index, data = record.to_dataframe()
    assert index == "time" and list(data) == list(record.columns())


def test_a_record_as_a_real_data_frame(record: Record) -> None:
    pytest.importorskip("pandas")
    frame = record.to_dataframe()
    assert frame.index.name == "time" and list(frame) == list(record.columns())[1:]
    np.testing.assert_array_equal(frame["pose/z"], record["pose"][:, 5])


def test_without_pandas_the_error_names_it(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"needs pandas.*pip install pandas.*to_csv"):
        record.to_dataframe()
