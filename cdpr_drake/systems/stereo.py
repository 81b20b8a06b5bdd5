"""The stereo pairs: images of the cables' edges to the tangents at the drawing points."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from cdpr_drake.model.kinematics import cable_geometry
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array, vector_to_pose
from cdpr_drake.model.vision.outages import STEREO_PAIR, Outage, Outages
from cdpr_drake.model.vision.tangents import CableImages, TangentEstimate, TangentEstimator
from cdpr_drake.systems._template import check_finite, finite_inputs, noise_input, part_of_state


class StereoCameras(LeafSystem):
    """What all systems share that sample the cables' directions by stereo pairs.

    One of them says what edges its cameras see, `_edges`.

    Args:
        robot: the true robot.
        believed: the robot as the controller believes it; the true one if None.
        sample_time: period T [s]; that of the robot's cameras if None.
        outages: when pairs see nothing.
        noise_size: of the noise port.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
        ValueError: an outage of a pair that is not there.
    """

    def __init__(
        self,
        robot: CableRobot,
        believed: CableRobot | None,
        sample_time: float | None,
        outages: tuple[Outage, ...],
        noise_size: int,
    ) -> None:
        super().__init__()
        self.robot = robot
        self.believed = believed if believed is not None else robot
        self.sample_time = robot.cameras.sample_time if sample_time is None else sample_time
        self._estimate = TangentEstimator(self.believed)
        self._outages = Outages(outages, STEREO_PAIR, len(robot.cameras.stereo_pairs))
        k = self._k = robot.num_cables
        self._tangents_port = self.DeclareVectorInputPort("tangents", 3 * k)
        self._tension_port = self.DeclareVectorInputPort("tension_at_drawing_point", k)
        self._pose_port = self.DeclareVectorInputPort("measured_pose", 6)
        self._measured_tension_port = self.DeclareVectorInputPort("measured_tension", k)
        self._noise_port = noise_input(self, noise_size)
        self.DeclareDiscreteState(6 * k)
        self.DeclarePeriodicDiscreteUpdateEvent(self.sample_time, 0.0, self._update)
        start = 0
        for name, size in (
            ("measured_tangents", 3 * k),
            ("valid_tangents", k),
            ("curvature_bias", k),
            ("frames_lost", k),
        ):
            part = part_of_state(slice(start, start + size))
            self.DeclareVectorOutputPort(name, size, part, {self.xd_ticket()})
            start += size

    def settle(self, context: Context) -> None:
        """Make the held directions what all pairs see now without noise.

        Args:
            context: the system's own, changed.
        """
        state = np.zeros(6 * self._k)
        edges = self._edges(context, state, None, set())
        context.SetDiscreteState(self._state(context, state, self._measure(context, edges)))

    def _edges(self, context: Context, state: Array, noise: Array | None, lost: set[int]) -> Array:
        """Return what pairs that are not lost see of the edges (k, 2, 2, n, 2) [px]."""
        raise NotImplementedError

    def _noise(self, context: Context) -> Array | None:
        """Return the noise now, None if the port is left open."""
        if not self._noise_port.HasValue(context):
            return None
        noise = self._noise_port.Eval(context)
        check_finite(noise, self, context, "noise")
        return noise

    def _lost(self, context: Context) -> set[int]:
        """Return the pairs that fail now, by index from 0."""
        return set(self._outages.at(context.get_time()))

    def _cables(self, context: Context) -> tuple[Array, Array]:
        tangents, tension = self._tangents_port.Eval(context), self._tension_port.Eval(context)
        finite_inputs(self, context, tangents, tension)
        return tangents, tension

    def _measured(self, context: Context) -> tuple[Array, RigidTransform]:
        tension, pose = self._measured_tension_port.Eval(context), self._pose_port.Eval(context)
        finite_inputs(self, context, pose, tension)
        return tension, vector_to_pose(pose)

    def _measure(self, context: Context, edges: Array) -> TangentEstimate:
        return self._estimate(edges, *self._measured(context))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        state = context.get_discrete_state_vector().CopyToVector()
        edges = self._edges(context, state, self._noise(context), self._lost(context))
        discrete.set_value(self._state(context, state, self._measure(context, edges)))

    def _state(self, context: Context, state: Array, estimate: TangentEstimate) -> Array:
        """Return the state after an estimate, what is not valid in it held from the state before.

        A cable that was never seen is taken for straight.
        """
        k, valid = self._k, estimate.valid
        held, bias = state[: 3 * k].reshape(-1, 3), state[4 * k : 5 * k]
        if not np.all(valid | held.any(axis=1)):
            X_WP = vector_to_pose(self._pose_port.Eval(context))
            straight = cable_geometry(self.believed, X_WP).u
            held = np.where(held.any(axis=1, keepdims=True), held, straight)
        tangents = np.where(valid[:, None], estimate.tangents, held)
        bias = np.where(valid, estimate.curvature_bias, bias)
        lost = state[5 * k :] + ~valid
        return np.concatenate([tangents.ravel(), valid, bias, lost])


class StereoTangentCameras(StereoCameras):
    """The cables' directions at their drawing points, as sampled by the stereo pairs.

    .. pydrake_system::

        name: StereoTangentCameras
        input_ports:
        - tangents
        - tension_at_drawing_point
        - measured_pose
        - measured_tension
        - noise (optional)
        output_ports:
        - measured_tangents
        - valid_tangents
        - curvature_bias
        - frames_lost

    At k T the true cameras see the edges of the sagging cables, drawn from their true tangents and
    tensions, and eq. (17) gives the directions with what the controller believes of the cameras,
    freed of the cables' curvature with the measured tension. The measured pose gives their sign.
    With pulleys both are of where the cable leaves, which follows from the tangent itself.
    Where a cable is not seen, or its interpretation planes are too nearly one, its last direction
    is held. Tangents (3 k) are unit vectors from A to B in W; tensions (k) are in N; measured_pose
    is [roll, pitch, yaw, x, y, z] (rad, m) of X_WP; noise is standard normal, one number for each
    point of an edge, ignored if the port is left open; valid_tangents (k) is 1 for what was
    measured in the last frame, else 0; curvature_bias (k) [rad] is what was taken out; frames_lost
    (k) counts the frames without a direction. All is discrete state, and there is no AutoDiffXd.

    Args:
        robot: the true robot.
        believed: the robot as the controller believes it; the true one if None.
        sample_time: period T [s]; that of the robot's cameras if None.
        outages: when pairs see nothing.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
        ValueError: an outage of a pair that is not there.
    """

    def __init__(
        self,
        robot: CableRobot,
        believed: CableRobot | None = None,
        sample_time: float | None = None,
        outages: tuple[Outage, ...] = (),
    ) -> None:
        self._images = CableImages(robot)
        super().__init__(robot, believed, sample_time, outages, self._images.noise_size)

    def see(self, context: Context) -> Array:
        """Return the images (k, 2, 2, n, 2) [px] of the cables now, NaN where not seen.

        Args:
            context: the system's own.
        """
        return self._edges(context, np.empty(0), self._noise(context), self._lost(context))

    def _edges(self, context: Context, state: Array, noise: Array | None, lost: set[int]) -> Array:
        images = self._images(*self._cables(context), noise)
        images[np.isin(self._images.pairs, list(lost))] = np.nan
        return images
