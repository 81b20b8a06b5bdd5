"""The page of `cdpr-drake explore`: Meshcat's, and a panel of numbers over it.

Meshcat shows no text, so a second small server, for this machine only, has page and panel.
"""

from __future__ import annotations

import contextlib
import html
import threading
from collections.abc import Callable, Sequence
from functools import partial
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from cdpr_drake.analysis.explore import Answers, Snapshot
from cdpr_drake.model.digits import significant
from cdpr_drake.show.cables import css, tension_colours

HOST = "127.0.0.1"
"""The only address served: that of this machine to itself."""

_STYLE = """
<style>
#panel { position: fixed; left: 14px; top: 14px; width: 256px; padding: 10px 14px;
  background: rgba(255, 255, 255, 0.88); border: 1px solid #c8ccd2; border-radius: 6px;
  color: #1c2430; font: 12px/1.35 system-ui, "Segoe UI", "Liberation Sans", sans-serif; }
#panel h1 { font-size: 15px; margin: 0 0 4px; }
#panel table { border-spacing: 0; width: 100%; }
#panel td { padding: 0 0 1px; }
#panel .number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
#panel .heading { margin: 8px 0 2px; color: #4a5565; }
#panel .alarm { margin-top: 8px; padding: 6px 8px; background: #fde8e4; color: #9c1c00; }
#panel .track { width: 122px; height: 9px; background: #e6e8ec; }
#panel .bar { height: 9px; }
#note { position: fixed; left: 14px; bottom: 10px; pointer-events: none; color: #4a5565;
  font: 11px/1.35 system-ui, "Segoe UI", "Liberation Sans", sans-serif; }
</style>
<div id="panel"></div>
"""

# The controls are open from the start, the list of what is drawn is not.
_SCRIPT = """
<script>
(() => {
  const panel = document.getElementById("panel");
  let shown = "";
  async function update() {
    try {
      const text = await (await fetch(location.origin + "/panel")).text();
      if (text !== shown) panel.innerHTML = shown = text;
      setTimeout(update, 50);
    } catch {
      panel.innerHTML = '<div class="alarm">The program has ended.</div>';
    }
  }
  update();
  viewer.gui.width = 280;
  viewer.gui.open();
  viewer.gui.__folders?.Scene?.close();
})();
</script>
"""

_SOCKET = "url = location.toString()"
"""How Meshcat's page begins to make the address of its connection."""


def explore_page(page: str, title: str, meshcat_port: int, over: str = "") -> str:
    """Return Meshcat's page with the panel over it, to be served from another port.

    Args:
        page: Meshcat's own.
        title: of the page.
        meshcat_port: where Meshcat is.
        over: more HTML to be over it.

    Raises:
        ValueError: the page is not as expected.
    """
    start, body, end = page.rpartition("</body>")
    if not body or _SOCKET not in start:
        raise ValueError("this version of Drake has another page for Meshcat than is known here")
    server = f"http://{HOST}:{meshcat_port}/"
    start = start.replace(_SOCKET, f'url = "{server}"')
    start = start.replace("<head>", f'<head><base href="{server}">', 1)
    name = html.escape(title)
    start = start.replace("<title>Drake MeshCat</title>", f"<title>{name}</title>", 1)
    return start + over + _STYLE + _SCRIPT + body + end


class PageServer:
    """Serves the page and its panel on this machine, from a thread of its own.

    Args:
        title: of the page.
        meshcat_port: where Meshcat is.
        port: of the page; 0 for any that is free.
        over: HTML to be over the drawing.
        note: a sentence on the drawing, below it.

    Attributes:
        panel: HTML of the panel, to be set.

    Raises:
        OSError: the port is taken, or not to be had.
        ValueError: Meshcat's page is not as expected.
    """

    def __init__(
        self, title: str, meshcat_port: int, port: int = 0, over: str = "", note: str = ""
    ) -> None:
        self.panel = ""
        over += f'<div id="note">{html.escape(note)}</div>\n'
        meshcat = HTTPConnection(HOST, meshcat_port, timeout=30.0)
        with contextlib.closing(meshcat):
            meshcat.request("GET", "/")
            page = explore_page(meshcat.getresponse().read().decode(), title, meshcat_port, over)
        texts = {"/": lambda: page, "/panel": lambda: self.panel}
        self._server = ThreadingHTTPServer((HOST, port), partial(_Handler, texts))
        self._server.daemon_threads = True
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.05,), daemon=True
        )
        self._thread.start()

    @property
    def address(self) -> str:
        """What to type into a browser."""
        return f"http://{HOST}:{self._server.server_port}/"

    def close(self) -> None:
        """End the server."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Handler(BaseHTTPRequestHandler):
    """Answers with one of a few texts."""

    def __init__(self, texts: dict[str, Callable[[], str]], *args: object) -> None:
        self._texts = texts
        super().__init__(*args)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Answer with the text at a path."""
        text = self._texts.get(self.path)
        if text is None:
            self.send_error(404)
            return
        content = text().encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Keep the terminal free of a line for each request."""


def panel_html(snapshot: Snapshot, limits: tuple[float, float]) -> str:
    """Return what the panel says of a snapshot.

    Args:
        snapshot: from `explore_pose`.
        limits: tensions at the ends of the colours [N].
    """
    robot = snapshot.robot
    lines = [
        f"<h1>{html.escape(robot.name)}, {significant(robot.mass)} kg</h1>",
        f"<div>{robot.num_cables} cables, law with {html.escape(snapshot.cable_model)}, "
        f"&lambda; = {snapshot.gain:.3g}/s</div>",
    ]
    if snapshot.answers is None:
        lines.append(
            f'<div class="alarm"><b>The robot cannot rest here.</b> {html.escape(snapshot.reason)}'
            "</div>"
        )
        return "".join(lines)
    answers = snapshot.answers
    lines += [*_modes(answers), *_convergence(snapshot, answers), *_tensions(answers, limits)]
    return "".join(lines)


def _modes(answers: Answers) -> list[str]:
    rows = [
        (answers.modes.name(mode).split("/")[-1].replace("_", " "),
         f"{mode.frequency:.2f} Hz", f"{100.0 * mode.damping:.2f} %")
        for mode in answers.lowest()
    ]  # fmt: skip
    return ['<div class="heading">Slowest oscillations, and their damping</div>', _table(rows)]


def _convergence(snapshot: Snapshot, answers: Answers) -> list[str]:
    slowest, fastest = answers.rates
    rows = [
        ("slowest rate / &lambda;", f"{slowest:.4f}"),
        ("fastest rate / &lambda;", f"{fastest:.4f}"),
        ("motion aside", f"{1e3 * answers.aside:.2f} mm/m"),
    ]
    lines = ['<div class="heading">Convergence, from &Gamma;</div>', _table(rows)]
    if slowest <= 0.0:
        lines.append('<div class="alarm">Errors grow in one direction, at any gain.</div>')
    elif answers.unstable:
        text = f"Unstable at &lambda; = {snapshot.gain:.3g}/s: {html.escape(answers.unstable)}."
        lines.append(f'<div class="alarm">{text}</div>')
    return lines


def _tensions(answers: Answers, limits: tuple[float, float]) -> list[str]:
    cable = answers.rest.robot.cable
    rows = []
    colours = tension_colours(answers.tension, limits)
    for i, (tension, colour) in enumerate(zip(answers.tension, colours, strict=True)):
        width = 100.0 * min(max(tension / limits[1], 0.0), 1.0)
        bar = f'<div class="bar" style="width: {width:.0f}%; background: {css(colour)}"></div>'
        rows.append(
            (f"cable {i + 1}", f'<div class="track">{bar}</div>', f"{significant(tension)} N")
        )
    lines = ['<div class="heading">Tensions at the drawing points</div>', _table(rows)]
    if outside := answers.out_of_limits():
        text = f"Outside of {cable.min_tension:g} to {cable.max_tension:g} N: cable "
        lines.append(f'<div class="alarm">{text}{", ".join(map(str, outside))}.</div>')
    return lines


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    """Return rows of cells: a label, cells as they are, and numbers to the right."""
    return (
        "<table>"
        + "".join(
            "<tr>"
            + f"<td>{row[0]}</td>"
            + "".join(f'<td class="number">{cell}</td>' for cell in row[1:])
            + "</tr>"
            for row in rows
        )
        + "</table>"
    )
