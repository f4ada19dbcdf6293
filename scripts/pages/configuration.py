"""docs/reference/configuration.md: every key of every configuration, from the sample beside each typed model.

Tests hold that a sample has every key of its model, at the model's default (tests/processors/test_contract.py,
tests/edge/test_adapter_contract.py).
"""

import re
from collections.abc import Iterator
from pathlib import Path

from cnctwin.loop.config import LoopConfig
from edge.adapter import adapters
from processors import discovery

ROOT = Path(__file__).resolve().parents[2]
HEAD = """\
# Configuration

For whoever writes or reads a configuration file: every key with its default and meaning. The unit of a number is the end of its name (`_s` seconds, `_pct` per cent,
`_mm_min` mm/min). A file holds only what differs from these defaults. `machine.toml` is on [a page of its own](machine.md). This page is written by
`scripts/reference` from the sample files that it links.
"""
KEY = re.compile(r"^(\w+)\s*=\s*(.*)$")


def page() -> str:
    """Return the page: edges, processors, the loop."""
    lines = [HEAD, "## Edges\n", "What every edge has, then what each control adds.\n"]
    controls = sorted((name, adapter.sample_config) for name, adapter in adapters().items())
    for name, path in [("every edge", ROOT / "edge" / "edge.toml"), *controls]:
        lines += _sample(name, path)
    lines += ["## Processors\n", "Tables of `processors.toml`. `[<processor>.machines.<name>]` gives one machine other values.\n"]
    for name, processor in sorted(discovery.discover().items()):
        lines += _sample(name, discovery.sample_configuration(processor))
    lines += [
        "## The loop\n",
        "The table `[loop]` of `processors.toml`; what each step does: [Run the loop](../how-to/loop.md).\n",
        *TABLE,
    ]
    for name, field in LoopConfig.model_fields.items():
        default = getattr(field.default, "value", field.default)
        lines.append(_row(f"loop.{name}", "" if default is None else repr(default).replace("'", '"'), field.description or ""))
    return "\n".join(lines).rstrip() + "\n"


TABLE = ["| key | default | meaning |", "|---|---|---|"]


def _sample(name: str, path: Path) -> Iterator[str]:
    yield f"### {name}\n"
    yield f"[`{path.relative_to(ROOT).as_posix()}`](../../{path.relative_to(ROOT).as_posix()})\n"
    yield from TABLE
    section = ""
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            section, _, meaning = (part.strip() for part in line.partition("#"))
            section = section.strip("[]")
            if meaning:
                yield _row(f"[{section}]", "", meaning)
        elif found := KEY.match(line):
            value, meaning = _parted(found[2])
            yield _row(f"{section}.{found[1]}" if section else found[1], value, meaning)
    yield ""


def _parted(text: str) -> tuple[str, str]:
    """Split a value from the comment behind it; a # in quotes is no comment."""
    quote = ""
    for place, letter in enumerate(text):
        if letter in "\"'" and quote in ("", letter):
            quote = "" if quote else letter
        elif letter == "#" and not quote:
            return text[:place].strip(), text[place + 1 :].strip()
    return text.strip(), ""


def _row(key: str, value: str, meaning: str) -> str:
    cells = [f"`{key}`", f"`{value}`" if value else "", meaning]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
