"""docs/reference/topics.md: the plain topics, from twin/vocabulary/topics.py, each with the sentence that stands below it."""

import ast
from pathlib import Path

from twin.vocabulary import topics

HEAD = """\
# Topics

For whoever writes a client, or rights on a broker: the plain MQTT topics beside Sparkplug's. What is published as Sparkplug B, and what values look like, is in
[Sparkplug on the broker](sparkplug.md). `…` stands for what follows a prefix; its meaning names that first. This page is written by
`scripts/reference` from [`twin/vocabulary/topics.py`](../../twin/vocabulary/topics.py).

| topic | name in the code | meaning |
|---|---|---|
"""


def page() -> str:
    """Return the table, in the order of the file; a topic without a sentence of its own has none."""
    body = ast.parse(Path(topics.__file__).read_text(encoding="utf-8")).body
    rows = []
    for node, following in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign) or not isinstance(node.targets[0], ast.Name):
            continue
        name = node.targets[0].id
        value = getattr(topics, name)
        said = following.value if isinstance(following, ast.Expr) else None
        meaning = " ".join(said.value.split()) if isinstance(said, ast.Constant) and isinstance(said.value, str) else ""
        if isinstance(value, str) and "/" in value and not name.startswith("_"):
            rows.append(f"| `{value}{'…' if value.endswith('/') else ''}` | `{name}` | {meaning} |")
    return HEAD + "\n".join(rows) + "\n"
