"""Pictures of a replay, taken by a headless browser."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from cdpr_drake.errors import CdprError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


class BrowserError(CdprError, RuntimeError):
    """There is no Chromium, or it took no picture."""


def screenshot_replay(
    html: str | os.PathLike[str],
    png: str | os.PathLike[str],
    at_time: float | None = None,
    *,
    width: int = 1280,
    height: int = 800,
    browser: str | None = None,
) -> Path:
    """Take a picture of a replay with a headless Chromium and return its path.

    Args:
        html: the replay, as `write_replay` leaves it.
        png: the picture, which is replaced if it exists.
        at_time: time of the run to show [s]; None for a moment after the start.
        width: of the picture, in pixels.
        height: of the picture, in pixels.
        browser: its command; the first of `BROWSERS` that is installed if None.

    Raises:
        FileNotFoundError: no replay there.
        BrowserError: no browser, or it took no picture.
    """
    page, picture = Path(html).resolve(strict=True), Path(png).resolve()
    address = page.as_uri() + ("" if at_time is None else f"#t={at_time:g}")
    return screenshot(address, picture, width=width, height=height, browser=browser)


def screenshot(
    address: str,
    png: str | os.PathLike[str],
    *,
    settle: float = 1.5,
    width: int = 1280,
    height: int = 800,
    browser: str | None = None,
) -> Path:
    """Take a picture of a page of this machine with a headless Chromium and return its path.

    Args:
        address: of the page.
        png: the picture, which is replaced if it exists.
        settle: time to let the page settle [s].
        width: of the picture, in pixels.
        height: of the picture, in pixels.
        browser: its command; the first of `BROWSERS` that is installed if None.

    Raises:
        BrowserError: no browser, or it took no picture.
    """
    picture = Path(png).resolve()
    command = shutil.which(browser) if browser else find_browser()
    if command is None:
        wanted = browser or ", ".join(BROWSERS)
        raise BrowserError(f"no browser for a picture of {address}: looked for {wanted}")
    picture.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True) as profile:
        options = [
            "--headless=new",
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--disable-background-networking",
            # A page of ours needs no network, nor do we.
            "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
            "--no-first-run",
            "--hide-scrollbars",
            f"--user-data-dir={profile}",
            f"--window-size={width},{height}",
            f"--virtual-time-budget={1e3 * settle:.0f}",
            f"--screenshot={picture}",
        ]
        try:
            run = subprocess.run(
                [command, *options, address], capture_output=True, text=True, timeout=120
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise BrowserError(f"{command} took no picture of {address}: {error}") from None
    if not picture.is_file():
        said = run.stderr.strip().splitlines()
        raise BrowserError(
            f"{command} took no picture of {address}: {said[-1] if said else 'it says nothing'}"
        )
    return picture


def find_browser() -> str | None:
    """Return the path of a Chromium or Chrome, or None."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)
