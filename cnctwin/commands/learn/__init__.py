"""Commands that train models, and decide which of them counts."""

from cnctwin.commands.group import CommandGroup

GROUP = CommandGroup(
    __name__,
    "Learn from recordings",
    {
        "train": ("train.app:train_app", "Train anomaly, tool-change and residual models"),
        "model": ("model:model_app", "List, compare, promote and roll back models"),
    },
)
