"""The legend over a replay: plain HTML put into Meshcat's page, with the values at each frame."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cdpr_drake.model.digits import decimals
from cdpr_drake.show.labels import Label, labels_html

_STYLE = """
<style>
#replay { position: fixed; left: 14px; top: 14px; width: 228px; padding: 10px 14px 8px;
  background: rgba(255, 255, 255, 0.88); border: 1px solid #c8ccd2; border-radius: 6px;
  color: #1c2430; font: 12px/1.35 system-ui, "Segoe UI", "Liberation Sans", sans-serif; }
#replay h1 { font-size: 15px; margin: 0 0 4px; }
#replay table { border-spacing: 0; width: 100%; }
#replay td { padding: 0 0 1px; }
#replay .number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
#replay .heading { margin: 8px 0 3px; color: #4a5565; }
#replay .track { width: 122px; height: 9px; background: #e6e8ec; }
#replay .bar { height: 9px; width: 0; }
#replay .swatch { display: inline-block; width: 22px; height: 10px; margin-right: 8px; }
#replay .gradient { height: 10px; margin-top: 4px; }
#replay .ends { display: flex; justify-content: space-between; color: #4a5565; }
#replay .note { margin-top: 6px; color: #4a5565; font-size: 11px; }
</style>
"""

# Meshcat's player keeps its time in viewer.animator. Where a version has none, the legend shows the
# first frame. "#t=12.5" at the end of the address stops the replay at that time of the run.
_SCRIPT = """
<script>
(() => {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const find = (id) => document.getElementById("replay-" + id);
  const wanted = /t=([0-9.]+)/.exec(window.location.hash);
  let stopped = !wanted;
  let shown = -1;
  function show(frame) {
    if (frame === shown) return;
    shown = frame;
    find("time").textContent = data.time[frame].toFixed(1) + " s";
    for (const name of ["position", "angle"])
      if (data[name]) find(name).textContent = data[name][frame];
    data.tension[frame].forEach((tension, i) => {
      find("tension" + i).textContent = tension.toFixed(data.digits);
      const part = Math.min(Math.max((tension - data.low) / (data.high - data.low), 0), 1);
      const bar = find("bar" + i);
      bar.style.width = 100 * Math.max(tension, 0) / data.high + "%";
      bar.style.background = data.colours[Math.round(part * (data.colours.length - 1))];
    });
  }
  function update() {
    const animator = typeof viewer === "undefined" ? null : viewer.animator;
    let time = 0;
    if (animator && animator.actions && animator.actions.length) {
      if (!stopped) {
        animator.pause();
        animator.seek(Number(wanted[1]) / data.speed);
        animator.display_progress(Number(wanted[1]) / data.speed);
        stopped = true;
      }
      time = animator.time || 0;
    }
    show(Math.min(Math.max(Math.round(time * data.fps), 0), data.time.length - 1));
    window.requestAnimationFrame(update);
  }
  update();
})();
</script>
"""


@dataclass(frozen=True, kw_only=True)
class Legend:
    """What the legend of a replay says.

    Attributes:
        title: of the page.
        subtitle: a line below it.
        time: (n,) [s] of the frames.
        frames_per_second: of the playback [1/s].
        speed: playback over real time.
        tension: (n, k) [N] at the drawing points.
        tension_range: [N] at the two ends of the colours.
        colours: of tensions from low to high, "#rrggbb".
        errors: (n, 2) distance to the goal [m] and angle [rad], or None without a goal.
        entries: (label, CSS colour) of what is drawn.
        note: a sentence at the end.
        labels: texts in the drawing, see `labels_html`.
    """

    title: str
    subtitle: str
    time: np.ndarray
    frames_per_second: float
    speed: float
    tension: np.ndarray
    tension_range: tuple[float, float]
    colours: Sequence[str]
    errors: np.ndarray | None
    entries: Sequence[tuple[str, str]]
    note: str
    labels: Sequence[Sequence[Label]]


def add_legend(page: str, legend: Legend) -> str:
    """Return Meshcat's page with a legend over it.

    Args:
        page: Meshcat's static HTML.
        legend: what to say.

    Raises:
        ValueError: the page has no end of its body.
    """
    head, end, tail = page.rpartition("</body>")
    if not end:
        raise ValueError("Meshcat's page has no </body>")
    name = html.escape(legend.title)
    head = head.replace("<title>Drake MeshCat</title>", f"<title>{name}</title>", 1)
    added = labels_html(legend.labels) + _card(legend) + _data(legend) + _SCRIPT
    return head + _STYLE + added + end + tail


def _card(legend: Legend) -> str:
    low, high = legend.tension_range
    lines = [f"<h1>{html.escape(legend.title)}</h1>", f"<div>{html.escape(legend.subtitle)}</div>"]
    values = [(f"Time (shown {legend.speed:g} × as fast)", "time", "")]
    if legend.errors is not None:
        values += [("Distance to the goal", "position", " mm"), ("Angle to the goal", "angle", "°")]
    rows = [
        f'<tr><td>{label}</td><td class="number"><span id="replay-{key}"></span>{unit}</td></tr>'
        for label, key, unit in values
    ]
    lines += ['<table class="heading">', *rows, "</table>"]
    lines += ['<div class="heading">Tension at the drawing points [N]</div>', "<table>"]
    for i in range(legend.tension.shape[1]):
        lines.append(
            f'<tr><td>cable {i + 1}</td><td><div class="track"><div class="bar" '
            f'id="replay-bar{i}"></div></div></td>'
            f'<td class="number" id="replay-tension{i}"></td></tr>'
        )
    stops = ", ".join(legend.colours)
    lines += [
        "</table>",
        f'<div class="gradient" style="background: linear-gradient(to right, {stops})"></div>',
        f'<div class="ends"><span>{low:g}</span><span>colour of the cables</span>'
        f"<span>{high:g}</span></div>",
        '<div class="heading">',
    ]
    lines += [
        f'<div><span class="swatch" style="background: {colour}"></span>{html.escape(label)}</div>'
        for label, colour in legend.entries
    ]
    lines += ["</div>", f'<div class="note">{html.escape(legend.note)}</div>']
    return f'<div id="replay">{"".join(lines)}</div>\n'


def _data(legend: Legend) -> str:
    low, high = legend.tension_range
    digits = decimals(float(np.abs(legend.tension).max()))
    data: dict[str, object] = {
        "time": np.round(legend.time, 3).tolist(),
        "fps": legend.frames_per_second,
        "speed": legend.speed,
        "tension": np.round(legend.tension, digits).tolist(),
        "digits": digits,
        "low": low,
        "high": high,
        "colours": list(legend.colours),
    }
    if legend.errors is not None:
        data["position"] = [f"{1e3 * distance:.1f}" for distance in legend.errors[:, 0]]
        data["angle"] = [f"{np.degrees(angle):.2f}" for angle in legend.errors[:, 1]]
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="replay-data">{text}</script>\n'
