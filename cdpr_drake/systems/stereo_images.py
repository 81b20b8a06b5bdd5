"""The stereo pairs as real cameras: from the pixels of their images to the cables' tangents."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cable_drawing import CableDrawing, StereoImage
from cdpr_drake.model.vision.lines import CableLines
from cdpr_drake.model.vision.outages import Outage
from cdpr_drake.systems.stereo import StereoCameras


class StereoImageCameras(StereoCameras):
    """The cables' directions at their drawing points, detected in images of the stereo pairs.

    .. pydrake_system::

        name: StereoImageCameras
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

    As `StereoTangentCameras`, but at k T the true cameras take images of 8 bits, drawn from the
    true tangents and tensions, and the edges are detected in them: tracked around the direction
    held if the cable was seen a frame ago, else searched near the line that the measured pose
    gives. The detection gets the images, what was measured, and the robot that the controller
    believes in; nothing of the truth. Noise is one standard normal number, which seeds the noise of
    all pixels of a frame; the images are without noise if the port is left open.

    Args:
        robot: the true robot.
        believed: the robot as the controller believes it; the true one if None.
        sample_time: period T [s]; that of the robot's cameras if None.
        outages: when pairs deliver no image.
        drawing: draws the images; `CableDrawing(robot)` if None.

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
        drawing: CableDrawing | None = None,
    ) -> None:
        super().__init__(robot, believed, sample_time, outages, noise_size=1)
        self._draw = drawing if drawing is not None else CableDrawing(robot)
        self._detect = CableLines(self.believed)

    def see(self, context: Context) -> list[StereoImage | None]:
        """Return the left and right image of each pair now, None for a pair that delivers none.

        Args:
            context: the system's own.
        """
        return self._take(context, self._noise(context), self._lost(context))

    def _take(
        self, context: Context, noise: Array | None, lost: set[int]
    ) -> list[StereoImage | None]:
        seed = None if noise is None else int(np.asarray(noise, float).view(np.uint64)[0])
        images = self._draw(*self._cables(context), seed)
        return [None if pair in lost else both for pair, both in enumerate(images)]

    def _edges(self, context: Context, state: Array, noise: Array | None, lost: set[int]) -> Array:
        tension, X_WP = self._measured(context)
        images = self._take(context, noise, lost)
        k = self._k
        held, known = state[: 3 * k], state[3 * k : 4 * k] > 0.0
        return self._detect(images, tension, X_WP, held, known)
