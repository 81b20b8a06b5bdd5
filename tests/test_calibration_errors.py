"""Random calibrations: sizes, what each error means, seeds."""

from __future__ import annotations

import numpy as np
import pytest

from cdpr_drake.model.calibration_errors import CalibrationErrors, misjudged
from cdpr_drake.model.robot import CableRobot, Pulleys, load_robot
from cdpr_drake.model.rotations import Array, log_rotation

ERRORS = CalibrationErrors()


def differences(robot: CableRobot, seed: int) -> dict[str, Array]:
    """Return how far what is believed is from the truth, by the names of CalibrationErrors."""
    believed = misjudged(robot, ERRORS, seed)
    true, seen = robot.cameras, believed.cameras
    X_FW, X_FW_believed = true.X_WF.inverse(), seen.X_WF.inverse()
    X_MP, X_MP_believed = true.X_PM.inverse(), seen.X_PM.inverse()
    return {
        "drawing_points": believed.drawing_points - robot.drawing_points,
        "attachment_points": believed.attachment_points - robot.attachment_points,
        "camera_position": X_FW_believed.translation() - X_FW.translation(),
        "camera_angle": log_rotation((X_FW.inverse() @ X_FW_believed).rotation().matrix()),
        "target_position": X_MP_believed.translation() - X_MP.translation(),
        "pulley_radius": (believed.pulley_radii - robot.pulley_radii)[:1],
        "target_angle": log_rotation((X_MP.inverse() @ X_MP_believed).rotation().matrix()),
    }


def test_each_error_has_its_size() -> None:
    robot = load_robot("cogiro-2015-pulleys")
    drawn = [differences(robot, seed) for seed in range(300)]
    for name, sigma in vars(ERRORS).items():
        values = np.array([d[name].ravel() for d in drawn])
        # The standard deviation of n values is known to 1 / sqrt(2 n): five times that.
        assert values.std() == pytest.approx(sigma, rel=5.0 / np.sqrt(2 * values.size))
        assert abs(values.mean()) < 5.0 * sigma / np.sqrt(values.size)


def test_a_seed_gives_one_calibration_in_any_size() -> None:
    robot = load_robot("cogiro")
    once, again, other = (misjudged(robot, ERRORS, seed) for seed in (3, 3, 4))
    assert once == again and once != other
    twice = misjudged(robot, ERRORS.scaled(2.0), 3)
    shift = once.drawing_points - robot.drawing_points
    np.testing.assert_allclose(twice.drawing_points - robot.drawing_points, 2.0 * shift, atol=1e-15)
    nothing = misjudged(robot, ERRORS.scaled(0.0), 3)
    np.testing.assert_array_equal(nothing.drawing_points, robot.drawing_points)
    assert nothing.cameras.X_WF.IsNearlyEqualTo(robot.cameras.X_WF, 1e-15)


def test_pulleys_are_misjudged_alike_and_eyelets_are_not() -> None:
    robot = load_robot("cogiro-2015-pulleys")
    mixed = robot.replace(pulleys=Pulleys(radius=0.05 * (np.arange(8) % 2), axis=[0, 0, 1]))
    believed = misjudged(mixed, ERRORS, 3)
    error = believed.pulley_radii - mixed.pulley_radii
    assert error[1] != 0.0 and not error[::2].any()
    np.testing.assert_allclose(error[1::2], error[1], rtol=1e-12)
    np.testing.assert_array_equal(believed.pulley_axes, mixed.pulley_axes)
    # The other errors do not depend on it, and no radius is below zero.
    eyelets = misjudged(robot.replace(pulleys=Pulleys()), ERRORS, 3)
    np.testing.assert_array_equal(believed.drawing_points, eyelets.drawing_points)
    assert believed.cameras == eyelets.cameras and eyelets.pulleys == Pulleys()
    far = [misjudged(robot, CalibrationErrors(pulley_radius=1.0), seed) for seed in range(9)]
    assert min(r.pulley_radii.min() for r in far) == 0.0


@pytest.mark.parametrize("value", [-1e-3, np.nan, np.inf])
def test_sizes_are_checked(value: float) -> None:
    with pytest.raises(ValueError, match="camera_angle"):
        CalibrationErrors(camera_angle=value)
