"""What all sampled pose cameras share: the pose held between frames, its age, and what is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from cdpr_drake.errors import GeometryError, SimulationError
from cdpr_drake.model.camera import true_from_seen
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, pose_to_vector, vector_to_pose
from cdpr_drake.model.vision.pose import PoseEstimate
from cdpr_drake.systems._template import part_of_state

# The discrete state: pose, covariances, and what is counted.
_POSE, _NOISE, _FIXED = slice(0, 6), slice(6, 42), slice(42, 78)
_FRAMES, _TARGETS, _CAMERAS, _AGE, _LOST, _IMAGES_LOST = range(78, 84)
_SIZE = 84


class HeldPose(LeafSystem):
    """Base of the cameras that measure a pose at k T and hold it, where there is none too.

    A subclass declares its inputs, and says in `measure` and `measure_at_rest` what they show.

    .. pydrake_system::

        name: HeldPose
        output_ports:
        - measured_pose
        - noise_covariance
        - fixed_covariance
        - num_targets
        - num_cameras
        - age
        - frames_lost
        - images_lost

    measured_pose is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; the covariances (36)
    are of a small motion [rotation vector; translation] of P in W [rad, m], row by row: that of the
    white noise, which averages out over frames, and that of the fixed bias of each point, which
    does not; num_targets and num_cameras say how many points and cameras took part in the last
    frame; age [s] is how long ago
    the pose held was measured; frames_lost counts the frames without a pose, images_lost the images
    of single cameras that were of no use. All is discrete state: no output depends on an input at
    once. OpenCV works on plain numbers, so there is no AutoDiffXd.

    Args:
        believed: the robot as the controller believes it.
        sample_time: period T [s].

    Raises:
        SimulationError: at an update, when no pose has been measured yet and none can be.
    """

    def __init__(self, believed: CableRobot, sample_time: float) -> None:
        super().__init__()
        self.believed = believed
        num_cameras = len(believed.cameras.pose_cameras)
        self.num_cameras, self.sample_time = num_cameras, sample_time
        self.DeclareDiscreteState(_SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(sample_time, 0.0, self._update)
        for name, part in (
            ("measured_pose", _POSE),
            ("noise_covariance", _NOISE),
            ("fixed_covariance", _FIXED),
            ("num_targets", slice(_TARGETS, _TARGETS + 1)),
            ("num_cameras", slice(_CAMERAS, _CAMERAS + 1)),
            ("age", slice(_AGE, _AGE + 1)),
            ("frames_lost", slice(_LOST, _LOST + 1)),
            ("images_lost", slice(_IMAGES_LOST, _IMAGES_LOST + 1)),
        ):
            size = part.stop - part.start
            self.DeclareVectorOutputPort(name, size, part_of_state(part), {self.xd_ticket()})

    def measure(self, context: Context, prior: RigidTransform | None) -> PoseEstimate | None:
        """Return the pose that the inputs show now, or None where they show too little.

        Args:
            context: the system's own.
            prior: the pose held; None in the first frame.
        """
        raise NotImplementedError

    def measure_at_rest(self, context: Context) -> PoseEstimate | None:
        """Return the pose that all cameras show now without noise, or None.

        Args:
            context: the system's own.
        """
        raise NotImplementedError

    def true_pose(self, robot: CableRobot, seen: RigidTransform | ArrayLike) -> RigidTransform:
        """Return X_WP of the true `robot` when it is measured at the pose `seen`."""
        return true_from_seen(robot, self.believed, seen)

    def settle(self, context: Context) -> None:
        """Make the held pose what all cameras see now without noise.

        Args:
            context: the system's own, changed.

        Raises:
            GeometryError: no camera sees enough of the platform.
        """
        estimate = self.measure_at_rest(context)
        if estimate is None:
            raise GeometryError("no pose camera sees a whole pattern of the platform where it is")
        state = np.zeros(_SIZE)
        _record(state, estimate)
        context.SetDiscreteState(state)

    def held_pose(self, context: Context) -> RigidTransform | None:
        """Return the pose X_WP held, or None before the first frame.

        Args:
            context: the system's own.
        """
        state: Array = context.get_discrete_state_vector().CopyToVector()
        return vector_to_pose(state[_POSE]) if state[_FRAMES] > 0.0 else None

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        state: Array = context.get_discrete_state_vector().CopyToVector()
        prior = self.held_pose(context)
        estimate = self.measure(context, prior)
        if estimate is not None:
            _record(state, estimate)
        elif prior is None:
            what = "no pose camera sees a whole pattern of the platform"
            raise SimulationError("measured pose", context.get_time(), what)
        else:
            state[[_TARGETS, _CAMERAS]] = 0.0
            state[_AGE] += self.sample_time
            state[_LOST] += 1.0
        state[_IMAGES_LOST] += self.num_cameras - state[_CAMERAS]
        discrete.set_value(state)


def _record(state: Array, estimate: PoseEstimate) -> None:
    """Write an estimate into the discrete state."""
    state[_POSE] = pose_to_vector(estimate.X_WP)
    state[_NOISE] = estimate.noise_covariance.ravel()
    state[_FIXED] = estimate.fixed_covariance.ravel()
    state[_FRAMES] += 1.0
    state[[_TARGETS, _CAMERAS, _AGE]] = estimate.num_targets, estimate.num_cameras, 0.0
