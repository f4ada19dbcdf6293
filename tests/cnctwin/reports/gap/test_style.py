"""Colours: text is readable on what it stands on, lines on their ground, in light and dark; the map runs one way."""

import re
from importlib.resources import files

import pytest

CSS = files("cnctwin.reports.gap").joinpath("report.css").read_text(encoding="utf-8")
TEXT = [
    *(
        (ink, ground)
        for ink in ("ink", "soft", "healthy", "explained", "partly", "unknown", "focus")
        for ground in ("paper", "raised")
    ),
    *(("on-light", f"h{n}") for n in range(4)),
    *(("on-dark", f"h{n}") for n in (5, 6)),
    *(("ink", f"r{n}") for n in range(6)),
]
LINES = [(line, "raised") for line in ("before", "after", "ink")] + [(bar, "paper") for bar in ("before", "after", "measured")]


def variables(scheme: str) -> dict[str, str]:
    light, dark = re.findall(r":root \{(.*?)\}", CSS, re.S)
    given = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6,8})", light))
    return given | (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6,8})", dark)) if scheme == "dark" else {})


def luminance(colour: str) -> float:
    parts = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    """Contrast ratio of WCAG 2.2."""
    darker, lighter = sorted([luminance(one), luminance(other)])
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("ink", "ground"), TEXT)
def test_text_is_readable(scheme: str, ink: str, ground: str) -> None:
    given = variables(scheme)
    assert contrast(given[ink], given[ground]) >= 4.5


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("line", "ground"), LINES)
def test_lines_and_bars_are_seen(scheme: str, line: str, ground: str) -> None:
    given = variables(scheme)
    assert contrast(given[line], given[ground]) >= 3.0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_map_goes_from_quiet_to_loud_in_even_steps_that_need_no_colour(scheme: str) -> None:
    given = variables(scheme)
    steps = [contrast(given[f"h{n}"], given["paper"]) for n in range(1, 7)]
    assert steps == sorted(steps)
    assert all(contrast(given[f"h{n}"], given[f"h{n + 1}"]) >= 1.15 for n in range(1, 6))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_fifth_colour_carries_its_own_ink(scheme: str) -> None:
    assert contrast(variables(scheme)["h4"], "#16191d") >= 4.5


def test_paper_is_always_light() -> None:
    assert "@media screen and (prefers-color-scheme: dark)" in CSS
    assert CSS.count("prefers-color-scheme") == 1


def test_nothing_is_fetched() -> None:
    assert "url(" not in CSS and "@import" not in CSS
