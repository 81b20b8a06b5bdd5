"""Texts at points of a Meshcat page, which knows none: HTML over it, moved with the page's camera.

Labels that would cover each other are joined, "1, 2", until one looks closer.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

_STYLE = """
<style>
#labels { position: fixed; inset: 0; overflow: hidden; pointer-events: none; }
#labels span { position: absolute; white-space: nowrap;
  font: 600 12px system-ui, "Segoe UI", "Liberation Sans", sans-serif;
  text-shadow: 0 0 3px white, 0 0 3px white, 0 0 3px white; }
</style>
<div id="labels"></div>
"""

# Matrices of three.js are column by column.
_SCRIPT = """
<script>
(() => {
  const groups = JSON.parse(document.getElementById("labels-data").textContent);
  const pane = document.getElementById("labels");
  const spans = groups.map((group) => group.map(() => {
    const span = document.createElement("span");
    pane.appendChild(span);
    return span;
  }));
  const times = (m, p) => [0, 1, 2, 3].map((i) =>
    m[i] * p[0] + m[i + 4] * p[1] + m[i + 8] * p[2] + m[i + 12] * p[3]);
  function project(point) {
    let p = [...point, 1];
    for (const m of [viewer.scene.matrixWorld, viewer.camera.matrixWorldInverse,
                     viewer.camera.projectionMatrix])
      p = times(m.elements, p);
    if (p[3] <= 0) return null;
    return [window.innerWidth * (1 + p[0] / p[3]) / 2, window.innerHeight * (1 - p[1] / p[3]) / 2];
  }
  function place(group, spans) {
    const places = group.map((label) => project(label.point));
    const seen = places.filter((p) => p);
    const middle = seen.reduce((sum, p) => sum + p[0], 0) / seen.length;
    const joined = [];
    group.forEach((label, i) => {
      spans[i].textContent = "";
      if (!places[i]) return;
      const near = joined.find((j) => Math.hypot(j.x - places[i][0], j.y - places[i][1]) < 16);
      if (near) {
        near.span.textContent += ", " + label.text;
        return;
      }
      const [x, y] = places[i];
      const side = label.side === "out" ? (x < middle ? -1 : 1) : 0;
      const up = label.side === "above" ? 1 : 0;
      spans[i].textContent = label.text;
      spans[i].style.color = label.colour;
      spans[i].style.left = x + 14 * side + "px";
      spans[i].style.top = y - 14 * up + "px";
      spans[i].style.transform = `translate(${50 * (side - 1)}%, -50%)`;
      joined.push({ x, y, span: spans[i] });
    });
  }
  function update() {
    if (typeof viewer !== "undefined" && viewer.camera)
      groups.forEach((group, i) => place(group, spans[i]));
    window.requestAnimationFrame(update);
  }
  update();
})();
</script>
"""


class Label(NamedTuple):
    """A text at a point.

    Attributes:
        text: short.
        point: (3,) [m], in W.
        side: where it stands: "above" the point, "out", away from the middle of its group to the
            left or right, or "on" it.
        colour: CSS.
    """

    text: str
    point: np.ndarray
    side: str = "above"
    colour: str = "#1c2430"


def labels_html(groups: Sequence[Sequence[Label]]) -> str:
    """Return HTML for the end of a Meshcat page that shows labels.

    Args:
        groups: of labels; only those of one group are joined.
    """
    data = [
        [{**label._asdict(), "point": np.round(label.point, 6).tolist()} for label in group]
        for group in groups
    ]
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return f'{_STYLE}<script type="application/json" id="labels-data">{text}</script>\n{_SCRIPT}'
