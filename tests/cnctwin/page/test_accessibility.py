"""Every view follows the rules of WCAG 2.2 A and AA that a program can check, on axe-core, in light and dark."""

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.cnctwin.page.conftest import VIEWS, Visit
from tests.cnctwin.page.fake_server import FakeServer

RULES = {
    "resultTypes": ["violations"],
    "runOnly": {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]},
}


def violations(page: Page) -> list[str]:
    """Return each broken rule with the elements that break it."""
    found = Axe().run(page, options=RULES).response["violations"]
    return [
        f"{rule['id']}: {rule['help']}: {node['html'][:120]}: {node.get('failureSummary', '')[:300]}"
        for rule in found
        for node in rule["nodes"]
    ]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_view_breaks_a_rule_of_accessibility(browser: Browser, server: FakeServer, scheme: str) -> None:
    visit = Visit(browser, server.url, scheme=scheme)
    broken = []
    for view in VIEWS:
        page = visit.open(f"#/{view}")
        expect(page.locator(".waiting")).to_have_count(0)
        broken += [f"{view}: {one}" for one in violations(page)]
    visit.context.close()
    assert broken == []


def test_no_dialog_breaks_a_rule_of_accessibility(visit: Visit) -> None:
    page = visit.open("#/alerts")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert violations(page) == []
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Acknowledge").first.click()
    assert violations(page) == []
