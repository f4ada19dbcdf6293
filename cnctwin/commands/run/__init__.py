"""Commands that run a plant's processes, and plan for them."""

from cnctwin.commands.group import CommandGroup

GROUP = CommandGroup(
    __name__,
    "Run the processes of a plant",
    {
        "up": ("up:up", "Start what init wrote, and stop it together"),
        "process": ("process:process", "Run processors: twins, gap, alerts, store"),
        "jobs": ("jobs:jobs_app", "Optimise, identify and diagnose in the background"),
        "bridge": ("bridge:bridge", "Connect the broker with Kafka"),
        "plan": ("plan:plan_app", "Cores, memory and disk that a plant needs"),
    },
)
