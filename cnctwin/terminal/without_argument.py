"""The sentence on an option that was given without its argument: where it belongs, and an example.

The parser of typer names neither the command nor a value for it.
"""

import shlex
from collections.abc import Sequence
from typing import Any

import typer
from typer.core import TyperGroup, TyperOption

EXAMPLES = {
    "--broker": "mqtt://broker.plant:1883",
    "--bundle": "bug.zip",
    "--config": "processors.toml",
    "--include": "logs",
    "--machine": "vmc",
    "--port": "8080",
    "--store": "store",
}
"""Arguments of options that have no default to show, by the option's name."""
OF_TYPE = {int: "1", float: "1.5"}


def explained(root: Any, words: Sequence[str], option: str) -> str | None:
    """Return the sentence on `option`, without an end; None where the command of `words` has no such option."""
    context = _command_at(root, words)
    found = next((one for one in context.command.params if option in (*one.opts, *one.secondary_opts)), None)
    if not isinstance(found, TyperOption):
        return None
    example = shlex.quote(_example(found, option))
    return f"Option '{option}' requires an argument, as in {option} {example}; see {context.command_path} --help"


def _command_at(root: Any, words: Sequence[str]) -> typer.Context:
    """Return the context of the command that the first words name."""
    context = typer.Context(root, info_name="cnctwin")
    for word in words:
        found = context.command.get_command(context, word) if isinstance(context.command, TyperGroup) else None
        if found is None:
            return context
        context = typer.Context(found, info_name=word, parent=context)
    return context


def _example(option: TyperOption, name: str) -> str:
    if name in EXAMPLES:
        return EXAMPLES[name]
    if isinstance(option.default, int | float | str) and option.default != "":
        value = getattr(option.default, "value", option.default)
        return f"{value:g}" if isinstance(value, float) else str(value)
    described = option.type_descriptor
    if described.choices:
        first = next(iter(described.choices))
        return str(getattr(first, "value", first))
    if described.is_path:
        return "PATH"
    return OF_TYPE.get(described.annotation, "TEXT")
