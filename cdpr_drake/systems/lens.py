"""A lens: the image of a pinhole, as Drake renders it, to that of a camera with distortion."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageRgba8U

from cdpr_drake.errors import GeometryError
from cdpr_drake.model.vision.cameras import Intrinsics
from cdpr_drake.model.vision.lens import Lens
from cdpr_drake.systems._template import noise_input


class LensDistortion(LeafSystem):
    """The image of a camera of any intrinsics, from that of the pinhole that Drake renders.

    .. pydrake_system::

        name: LensDistortion
        input_ports:
        - pinhole_image
        - noise (optional)
        output_ports:
        - image

    The images are abstract, of type ImageRgba8U. Drake renders neither distortion nor pixels that
    are not square: the pinhole's image, `lens.pinhole` in size, is a little larger than the
    camera's, which is interpolated from it (bilinearly, which blurs by half a pixel as a lens
    would). noise is one standard normal number, which seeds the noise of all pixels; the image is
    without noise if the port is left open.

    Args:
        intrinsics: of the camera.

    Raises:
        RobotFileError: the distortion leads too far outside of what a pinhole can see.
        GeometryError: when an image of another size comes in.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        super().__init__()
        self.intrinsics, self.lens = intrinsics, Lens(intrinsics)
        self._image_port = self.DeclareAbstractInputPort("pinhole_image", Value(ImageRgba8U()))
        self._noise_port = noise_input(self, 1)
        self.DeclareAbstractOutputPort(
            "image",
            lambda: Value(ImageRgba8U(intrinsics.width, intrinsics.height)),
            self._calc_image,
            {self._image_port.ticket(), self._noise_port.ticket()},
        )

    def _calc_image(self, context: Context, output: AbstractValue) -> None:
        image, pinhole = self._image_port.Eval(context), self.lens.pinhole
        if (image.width(), image.height()) != (pinhole.width, pinhole.height):
            raise GeometryError(
                f"an image of {image.width()} x {image.height()} pixels came where the lens takes "
                f"{pinhole.width} x {pinhole.height}"
            )
        seed = None
        if self._noise_port.HasValue(context):
            seed = int(self._noise_port.Eval(context).view(np.uint64)[0])
        self.lens(image.data, output.get_mutable_value().mutable_data, seed)
