"""What the pose cameras look at: the platform with its white points, in a plain hall.

All is plain colours, so that what is hard for a detector is the geometry. The edge of a point is
soft, a centimetre of grey on either side: it stands for a lens that is not quite sharp, and gives
the renderer, which takes one sample a pixel and smooths what looks like an edge, something it can
sample: a sharp edge would cost the centre of a point 0.1 px, this one costs 0.02 px.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import (
    Convex,
    FrameId,
    GeometryFrame,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
    Shape,
    SourceId,
)
from pydrake.math import RigidTransform

from cdpr_drake.diagrams.hall import WALL, hall_parts
from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cameras import Pattern

RENDERER = "vtk"
WHITE, DARK = 245, 26
"""Grey levels of points and faces, where light falls straight on them."""

SOFT_EDGE = 0.25
"""Width of the grey between a point and the face, over the point's diameter."""

TEXELS = 64
"""Resolution of the picture of a pattern, per diameter of a point [px]."""

STANDOFF = 0.02
"""How far the faces lie in front of the body, over a point's diameter: enough for the renderer to
tell which is in front, too little to be seen."""

LIGHTS = (
    (-1.0, -0.8, -1.0, 0.80),
    (1.0, 0.9, -1.0, 0.72),
    (-0.9, 1.0, -0.8, 0.6),
    (1.0, -1.0, -0.8, 0.66),
)
"""Directions [x, y, z] in W and intensities of four lamps far away."""


def make_camera_scene(robot: CableRobot) -> tuple[SceneGraph, SourceId, FrameId]:
    """Return a scene to be rendered, the source of its one moving frame, and that frame, P.

    Args:
        robot: the robot, for its patterns, and its room for the hall.
    """
    scene = SceneGraph()
    lights = [
        LightParameter(type="directional", frame="world", direction=light[:3], intensity=light[3])
        for light in LIGHTS
    ]
    parameters = RenderEngineVtkParams(default_clear_color=np.array(WALL), lights=lights)
    scene.AddRenderer(RENDERER, MakeRenderEngineVtk(parameters))
    source = scene.RegisterSource("pose_cameras")
    frame = scene.RegisterFrame(source, GeometryFrame("platform"))
    for name, shape, X_WS, colour in hall_parts(robot):
        _add(scene, source, name, shape, X_WS, _look(Rgba(*colour)))
    _add_platform(scene, source, frame, robot)
    return scene, source, frame


def _add_platform(scene: SceneGraph, source: SourceId, frame: FrameId, robot: CableRobot) -> None:
    """Add the platform: a face with each pattern, and the convex body behind the faces."""
    X_PM, patterns = robot.cameras.X_PM, robot.cameras.patterns
    behind = np.vstack([_corners(p, STANDOFF * p.point_diameter) for p in patterns])
    body = Convex(np.asfortranarray(behind.T), "platform")
    _add(scene, source, "body", body, X_PM, _look(Rgba(*3 * [DARK / 255.0])), frame)
    with tempfile.TemporaryDirectory() as folder:
        for i, pattern in enumerate(patterns):
            name = f"face_{i}"
            mesh = _write_face(Path(folder), name, pattern)
            _add(scene, source, name, mesh, X_PM, _look(), frame)


def _face(pattern: Pattern) -> Array:
    """Return (2, 2) [m]: least and largest x, y in T of a face, a diameter beyond the points."""
    d = pattern.point_diameter
    return np.array([pattern.points.min(axis=0) - d, pattern.points.max(axis=0) + d])


def _corners(pattern: Pattern, inwards: float = 0.0) -> Array:
    """Return the corners (4, 3) [m], in M, of the face of a pattern, or of one inside of it."""
    (x0, y0), (x1, y1) = _face(pattern) + np.array([[inwards], [-inwards]])
    corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return np.array([pattern.X_MT @ np.array([x, y, -inwards]) for x, y in corners])


def _write_face(folder: Path, name: str, pattern: Pattern) -> Mesh:
    """Write a face and its picture to files; return it as a mesh in M."""
    import cv2

    cv2.imwrite(str(folder / f"{name}.png"), _picture(pattern))
    (folder / f"{name}.mtl").write_text(f"newmtl face\nKd 1 1 1\nmap_Kd {name}.png\n")
    vertices = "".join("v {:.9f} {:.9f} {:.9f}\n".format(*p) for p in _corners(pattern))
    normal = "vn {:.9f} {:.9f} {:.9f}\n".format(*pattern.X_MT.rotation().matrix()[:, 2])
    picture = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    face = "usemtl face\nf 1/1/1 2/2/1 3/3/1 4/4/1\n"
    path = folder / f"{name}.obj"
    path.write_text(f"mtllib {name}.mtl\n{vertices}{picture}{normal}{face}")
    return Mesh(str(path))


def _picture(pattern: Pattern) -> Any:
    """Return the picture of a face, (height, width) of uint8: white points with soft edges."""
    d, (low, high) = pattern.point_diameter, _face(pattern)
    width, height = (int(n) for n in np.ceil(TEXELS * (high - low) / d))
    x = low[0] + (np.arange(width) + 0.5) / width * (high - low)[0]
    y = high[1] - (np.arange(height) + 0.5) / height * (high - low)[1]
    radius = np.min([np.hypot(x - a, y[:, None] - b) for a, b in pattern.points], axis=0) / d
    t = np.clip((radius - 0.5) / SOFT_EDGE + 0.5, 0.0, 1.0)
    return np.round(DARK + (WHITE - DARK) * (1.0 - t * t * (3.0 - 2.0 * t))).astype(np.uint8)


def _look(colour: Rgba | None = None) -> PerceptionProperties:
    """Return how a shape looks; without a colour it brings its own."""
    look = PerceptionProperties()
    if colour is not None:
        look.AddProperty("phong", "diffuse", colour)
    look.AddProperty("label", "id", RenderLabel.kDontCare)
    return look


def _add(
    scene: SceneGraph,
    source: SourceId,
    name: str,
    shape: Shape,
    X: RigidTransform,
    look: Any,
    frame: FrameId | None = None,
) -> None:
    """Register a shape on the moving frame, or on the world."""
    instance = GeometryInstance(X, shape, name)
    if frame is None:
        geometry = scene.RegisterAnchoredGeometry(source, instance)
    else:
        geometry = scene.RegisterGeometry(source, frame, instance)
    scene.AssignRole(source, geometry, look)
