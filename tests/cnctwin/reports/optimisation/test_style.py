"""Colours of its own are readable and seen, in light and dark; and a browser shows the page without a fault at every width."""

import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from cnctwin.reports.optimisation.page import report_html
from tests.cnctwin.reports.gap.test_style import contrast, variables
from tests.cnctwin.reports.optimisation.answers import mixed, pareto

CSS = files("cnctwin.reports.optimisation").joinpath("optimise.css").read_text(encoding="utf-8")
CHROMIUM = Path("/usr/bin/chromium")


def own(scheme: str) -> dict[str, str]:
    light, dark = (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", found)) for found in re.findall(r":root \{(.*?)\}", CSS))
    assert light.keys() == dark.keys()
    return variables(scheme) | (light if scheme == "light" else dark)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_readable_and_limits_are_seen(scheme: str) -> None:
    given = own(scheme)
    for ink, ground in (("limit", "paper"), ("ink", "comes"), ("ink", "goes"), ("soft", "raised")):
        assert contrast(given[ink], given[ground]) >= 4.5, (ink, ground)
    assert contrast(given["limit"], given["raised"]) >= 3.0


def test_every_variable_that_is_used_is_there() -> None:
    assert {name for name in re.findall(r"var\(--([\w-]+)\)", CSS) if name != "called"} <= set(own("light"))


def test_a_browser_shows_it_at_every_width_and_refuses_nothing(tmp_path: Path) -> None:
    if not CHROMIUM.is_file():
        pytest.skip(f"{CHROMIUM} is not there; apt-get install chromium fonts-dejavu-core")
    both = replace(pareto(), lines=mixed().lines)
    path = tmp_path / "report.html"
    path.write_text(report_html(both), encoding="utf-8")
    said: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(path.as_uri())
        for width in (1280, 420):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate("document.documentElement.scrollWidth") == width
        dashed = page.evaluate("getComputedStyle(document.querySelector('.course .line.before')).strokeDasharray")
        assert dashed == "6px, 4px"
        browser.close()
    assert said == []
