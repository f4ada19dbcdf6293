"""The cutting tool in the spindle as the agent describes it: an asset with tool life and measurements.

Source: MTConnect part 4 (cutting tools). Life counts UP from nothing to its limit, or DOWN from `initial` to its limit; where it
counts up, a limit of 0 is none. Lengths are in `units`, which is MILLIMETER where it is missing.

>>> life = Life("MINUTES", "DOWN", value=12.0, initial=60.0, limit=None)
>>> life.used(), life.most()
(48.0, 60.0)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from edge.controls.mtconnect.xml import local_name
from edge.errors import ConfigError
from edge.reading import Outcome, Target, bad, read_value, without_noise
from edge.units import conversion
from sparkplug.quality import Quality

TOOLS_MAX = 100  # of one document; one is asked for
_LIVES = {
    "MINUTES": ("tool_life_used_min", "tool_life_limit_min"),
    "PART_COUNT": ("tool_life_used_count", "tool_life_limit_count"),
}
_LENGTHS = ("FunctionalLength",)
_DIAMETERS = ("CuttingDiameterMax", "CuttingDiameter")
SIGNALS = (*(name for names in _LIVES.values() for name in names), "tool_length_mm", "tool_radius_mm")
_LOW, _HIGH = 0.0, 1e6  # of a life, in minutes and in uses


@dataclass(frozen=True, slots=True)
class Life:
    """One count of a tool's life; None where the asset does not tell."""

    kind: str
    direction: str
    value: float | None
    initial: float | None = None
    limit: float | None = None

    def used(self) -> float | None:
        """Return how much of its life the tool has used."""
        if self.direction != "DOWN" or self.value is None:
            return self.value
        return None if self.initial is None else without_noise(self.initial - self.value)

    def most(self) -> float | None:
        """Return how much it may use; None where there is no limit."""
        if self.direction == "DOWN":
            return None if self.initial is None else self.initial - (self.limit or 0.0)
        return self.limit or None


@dataclass(frozen=True, slots=True)
class ToolAsset:
    """A cutting tool: its counts of life, and its measurements by name, in mm."""

    id: str
    lives: tuple[Life, ...] = ()
    millimetres: tuple[tuple[str, float], ...] = ()

    def outcomes(self) -> Iterator[tuple[str, Outcome]]:
        """Yield each signal of `SIGNALS` with its value, or a null with the reason."""
        lives = {life.kind: life for life in reversed(self.lives)}
        for kind, (used, limit) in _LIVES.items():
            life = lives.get(kind)
            if life is None:
                missing = bad(f"tool {self.id}: its asset has no ToolLife in {kind}")
                yield from ((used, missing), (limit, missing))
                continue
            yield (
                used,
                _life(used, life.used(), f"tool {self.id}: ToolLife without a value, or counted down from an unknown value"),
            )
            yield limit, _life(limit, life.most(), f"tool {self.id}: the control sets no limit")
        yield "tool_length_mm", self._measured("tool_length_mm", _LENGTHS, 1.0)
        yield "tool_radius_mm", self._measured("tool_radius_mm", _DIAMETERS, 0.5)

    def _measured(self, signal: str, names: tuple[str, ...], factor: float) -> Outcome:
        known = dict(reversed(self.millimetres))
        found = next((known[name] for name in names if name in known), None)
        if found is None:
            return bad(f"tool {self.id}: its asset has no {' or '.join(names)}")
        target = Target("asset", signal, factor)
        return read_value(Target("asset", signal, factor, low=target.known.low, high=target.known.high), found)


def _life(signal: str, figure: float | None, why_not: str) -> Outcome:
    if figure is None:
        return bad(why_not)
    if not _LOW <= figure <= _HIGH:
        return bad(f"outside {_LOW:g} to {_HIGH:g}: {figure:g}")
    return read_value(Target("asset", signal), figure)


def without_tool(why: str, quality: Quality = Quality.BAD) -> Iterator[tuple[str, Outcome]]:
    """Yield the signals of a tool where there is none, or nothing is known of it."""
    yield from ((name, (None, quality, why)) for name in SIGNALS)


def tools_of(root: Element) -> tuple[ToolAsset, ...]:
    """The cutting tools of a parsed MTConnectAssets document."""
    assets = next((child for child in root if local_name(child) == "Assets"), None)
    tools = [one for one in (() if assets is None else assets) if local_name(one) == "CuttingTool"]
    return tuple(_tool(one) for one in tools[:TOOLS_MAX])


def _tool(element: Element) -> ToolAsset:
    lives = tuple(_life_of(one) for one in element.iter() if local_name(one) == "ToolLife")
    wanted = {*_LENGTHS, *_DIAMETERS}
    measured = ((local_name(one), _millimetres(one)) for one in element.iter() if local_name(one) in wanted)
    return ToolAsset(element.get("assetId", ""), lives, tuple((name, mm) for name, mm in measured if mm is not None))


def _life_of(element: Element) -> Life:
    return Life(
        element.get("type", "").upper(),
        element.get("countDirection", "UP").upper(),
        _figure(element.text),
        _figure(element.get("initial")),
        _figure(element.get("limit")),
    )


def _millimetres(element: Element) -> float | None:
    figure = _figure(element.text)
    try:
        return None if figure is None else conversion(element.get("units", "MILLIMETER"), "mm").apply(figure)
    except ConfigError:
        return None  # a length in another unit than lengths have


def _figure(text: str | None) -> float | None:
    try:
        figure = float((text or "").strip())
    except ValueError:
        return None
    return figure if abs(figure) < 1e300 else None  # neither NaN nor without end
