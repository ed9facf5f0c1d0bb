"""Rerun's web viewer in Debian's Chromium, and where the views of a layout are on its page.

The viewer is a program that draws on one canvas: there are no elements to ask. What can be looked at is the picture.
"""

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray
from PIL import Image

CHROMIUM = shutil.which("chromium")
ARGUMENTS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL without a GPU."""

WIDTH, HEIGHT = 1600, 1000
TIME_PANEL, TITLE, EDGE = 30, 32, 6
"""[dots] at the page's bottom, at a view's top, and around it."""

SAME = 3
"""Pictures that are the same when a page is at rest."""

Picture = NDArray[np.uint8]
"""(H, W, 3)"""


class Region(NamedTuple):
    """Where a view is [dots]."""

    left: float
    top: float
    width: float
    height: float

    def of(self, picture: Picture) -> Picture:
        """What is inside, without the title."""
        top, bottom = round(self.top) + TITLE, round(self.top + self.height) - EDGE
        return picture[top:bottom, round(self.left) + EDGE : round(self.left + self.width) - EDGE]


def regions(layout: rrb.Blueprint) -> dict[str, Region]:
    """Where the views of a layout are, by their names."""
    return dict(_regions(layout.root_container, Region(0.0, 0.0, WIDTH, HEIGHT - TIME_PANEL)))


def _regions(part: Any, region: Region) -> Iterator[tuple[str, Region]]:
    if isinstance(part, rrb.Tabs):  # the first is open
        yield from _regions(next(iter(part.contents)), region)
        return
    if not isinstance(part, rrb.Horizontal | rrb.Vertical):
        yield str(part.name), region
        return
    inside = list(part.contents)
    across = isinstance(part, rrb.Horizontal)
    given: Any = part.column_shares if across else part.row_shares
    shares = np.ones(len(inside)) if given is None else np.asarray(given, dtype=float)
    ends = np.cumsum(shares) / shares.sum()
    for one, start, end in zip(inside, (0.0, *ends), ends, strict=False):
        if across:
            place = Region(region.left + start * region.width, region.top, (end - start) * region.width, region.height)
        else:
            place = Region(region.left, region.top + start * region.height, region.width, (end - start) * region.height)
        yield from _regions(one, place)


class Page:
    """An open page."""

    def __init__(self, page: Any) -> None:
        self._page = page

    def png(self) -> bytes:
        """What it looks like."""
        return bytes(self._page.screenshot(timeout=120_000))

    def picture(self) -> Picture:
        """The same as dots."""
        return np.asarray(Image.open(io.BytesIO(self.png())).convert("RGB"))

    def wait(self, seconds: float) -> None:
        """Lets the page go on."""
        self._page.wait_for_timeout(1000.0 * seconds)


@contextmanager
def opened(address: str) -> Iterator[Page]:
    """The page at an address, in a browser of its own."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        try:
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
            page.goto(address, timeout=120_000)
            yield Page(page)
        finally:
            browser.close()


def settled(page: Page, most: int = 40, pause: float = 3.0) -> Picture:
    """The picture once it has stayed the same three times: whatever was moved, loaded or scrolled has come to rest."""
    pictures = [page.picture()]
    for _ in range(most):
        page.wait(pause)
        pictures.append(page.picture())
        if len(pictures) > SAME and all(np.array_equal(pictures[-1], one) for one in pictures[-SAME:]):
            break
    return pictures[-1]


def share_changed(one: Picture, other: Picture) -> float:
    """Of the dots, how many differ."""
    return float((one != other).any(axis=2).mean())
