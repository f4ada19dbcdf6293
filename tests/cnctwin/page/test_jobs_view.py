"""The jobs on the page: shown, asked for, cancelled, and refused."""

import json

from playwright.sync_api import expect

from cnctwin.jobs.request import read_request
from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.documents import job
from tests.cnctwin.page.fake_server import Shop


def test_jobs_are_shown_asked_for_and_cancelled(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/jobs")
    cards = page.locator(".jobcard")
    expect(cards).to_have_count(4)
    expect(cards.first).to_contain_text("evolution 42 of 100")
    assert page.get_by_label("Progress of optimise-2").evaluate("(bar) => bar.value") == 42
    expect(cards.last).to_contain_text("its process was killed 3 times")
    cards.nth(2).get_by_text("Result").click()
    expect(cards.nth(2)).to_contain_text("Seconds after")
    expect(cards.nth(2).get_by_role("link", name="report.html")).to_have_attribute("href", "jobs/optimise-1/files/report.html")
    cards.first.get_by_role("button", name="Cancel").click()
    page.get_by_role("dialog").get_by_role("button", name="Cancel the job").click()
    expect(page.get_by_role("dialog")).to_be_hidden()
    page.get_by_role("button", name="New job").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("below the consumer's folder").first.fill("plate.nc")
    dialog.get_by_label("or a file of this device").last.set_input_files(
        {"name": "vmc.toml", "mimeType": "text/plain", "buffer": "name = 'Fräse'".encode("latin-1")}
    )
    dialog.get_by_label("Wanted").select_option("cost")
    dialog.get_by_label("The spindle may change its speed").select_option("in_air")
    for label, value in (
        ("Cutting force", "60"),
        ("probability", "0.95"),
        ("Seed", "7"),
        ("Evolutions", "20"),
        ("Population", "32"),
    ):
        dialog.get_by_label(label).fill(value)
    dialog.get_by_role("button", name="Start").click()
    expect(dialog).to_be_hidden()
    wanted = {
        "job": "optimise",
        "objective": "cost",
        "speed_changes": "in_air",
        "program": "plate.nc",
        "machine_toml": "name = 'Fräse'",
        "force_limit_n": 60,
        "probability": 0.95,
        "seed": 7,
        "evolutions": 20,
        "population": 32,
    }
    assert shop.posted == [("/jobs/optimise-2/cancel", {}), ("/jobs", wanted)]
    assert read_request(json.dumps(wanted).encode()).document.items() >= wanted.items()


def test_a_job_that_is_done_above_a_limit_looks_unlike_one_that_keeps_them(visit: Visit, shop: Shop) -> None:
    caution = "2 lines are above a limit"
    told = [job("over", "optimise", "done", caution=caution), job("kept", "optimise", "done", caution="")]
    shop.answers["/jobs"] = lambda _path, _body: (200, {"jobs": told})
    page = visit.open("#/jobs")
    over, kept = (page.locator(f'[data-job="{name}"]') for name in ("over", "kept"))
    expect(over).to_contain_text(f"Done, but {caution}")
    expect(kept.locator(".caution")).to_be_hidden()
    marks = [card.locator("> .symbol use").get_attribute("href") for card in (over, kept)]
    assert marks == ["#s-alert", "#s-ack"]
    colours = [card.evaluate("(card) => getComputedStyle(card).borderLeftColor") for card in (over, kept)]
    assert len(set(colours)) == 2


def test_a_refused_job_says_why_and_without_a_consumer_none_is_asked_for(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/jobs")
    page.locator("main").press("n")
    shop.answers["/jobs"] = lambda _path, body: (
        (400, {"error": "request: case = '': too short"})
        if "job" in (body or {})
        else (200, {"available": False, "reason": "old"})
    )
    page.get_by_label("What").select_option("diagnose")
    page.get_by_role("dialog").get_by_role("button", name="Start").click()
    expect(page.get_by_role("dialog")).to_contain_text("too short")
    page.keyboard.press("Escape")
    expect(page.locator(".trouble").first).to_contain_text("Jobs are not kept up: old")
    expect(page.get_by_role("button", name="New job")).to_be_disabled()
    visit.errors.clear()  # the browser itself writes a line for a 400
