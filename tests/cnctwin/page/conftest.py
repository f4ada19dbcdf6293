"""A browser for the tests of this folder, and a page in it whose console has to stay clean."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from tests.cnctwin.page.documents import tell_all
from tests.cnctwin.page.fake_server import FakeServer, Shop

WAIT_MS_MAX = 30_000  # the tests run beside others
CHROMIUM = Path("/usr/bin/chromium")
VIEWS = ("fleet", "machine/vmc", "gap/vmc", "gap/mill-01", "alerts", "replay/vmc", "parts/vmc", "figures", "jobs")
SIZES = {"tablet": (1024, 768), "wall": (1280, 800), "phone": (390, 844)}

INK = """async (selector) => {
  const canvas = document.querySelector(selector);
  const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  const seen = new Set();
  for (let i = 0; i < data.length; i += 4) seen.add(data[i] + ',' + data[i + 1] + ',' + data[i + 2]);
  return seen.size;
}"""


def expect_drawn(page: Page, selector: str) -> None:
    """More than a frame is drawn on it, at once or soon."""
    page.wait_for_function(f"async (selector) => await ({INK})(selector) > 4", arg=selector)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Debian's Chromium."""
    if not CHROMIUM.is_file():
        pytest.skip(f"{CHROMIUM} is not there; apt-get install chromium fonts-dejavu-core")
    expect.set_options(timeout=WAIT_MS_MAX)
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        yield opened
        opened.close()


class Visit:
    """A page of a server, and what its console and its network said."""

    def __init__(
        self,
        browser: Browser,
        url: str,
        size: tuple[int, int] = SIZES["tablet"],
        scheme: str = "light",
        locale: str = "en-GB",
        zone: str = "UTC",
    ) -> None:
        viewport = {"width": size[0], "height": size[1]}
        self.context = browser.new_context(viewport=viewport, color_scheme=scheme, locale=locale, timezone_id=zone)  # type: ignore[arg-type]
        self.context.set_default_timeout(WAIT_MS_MAX)
        self.page: Page = self.context.new_page()
        self.url = url
        self.errors: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))

    def _heard(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            self.errors.append(message.text)

    def open(self, place: str) -> Page:
        """Go to a view."""
        self.page.goto(f"{self.url}/{place}")
        self.page.wait_for_selector("main h1, main h2", state="attached")
        return self.page

    def evaluate(self, script: str) -> object:
        """Run a script with the page's modules at hand: `await module("text")`."""
        return self.page.evaluate(f"async () => {{ const module = (name) => import(`./page/js/${{name}}.js`); {script} }}")


@pytest.fixture
def shop() -> Shop:
    """Three machines with all that can be told of them; the second holds its feed."""
    made = Shop(["vmc", "mill-01", "mill-02"], period_s=0.3)
    tell_all(made)
    return made


@pytest.fixture
def server(shop: Shop) -> Iterator[FakeServer]:
    with FakeServer(shop) as running:
        yield running


@pytest.fixture
def visit(browser: Browser, server: FakeServer) -> Iterator[Visit]:
    """A visit at tablet size. A test that makes the server fail clears `errors` itself."""
    made = Visit(browser, server.url)
    yield made
    made.context.close()
    assert made.errors == []
