"""Commands that keep history and bring it back."""

from cnctwin.commands.group import CommandGroup

GROUP = CommandGroup(
    __name__,
    "Keep and look back",
    {
        "store": ("store:store_app", "What the store holds and costs; query and export"),
        "replay": ("replay:replay_history", "Run the processors again over history"),
        "parts": ("parts:parts_app", "As-built records of parts: list, export, deliver"),
    },
)
