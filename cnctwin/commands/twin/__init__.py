"""Commands that work on the twin of a machine."""

from cnctwin.commands.group import CommandGroup

GROUP = CommandGroup(
    __name__,
    "Work with a twin",
    {
        "simulate": ("simulate:simulate", "Run a part program on the twin"),
        "expect": ("expect:expect", "Load, force and time expected of each line"),
        "identify": ("identify:identify", "Fit the twin's constants to recordings"),
        "gap": ("gap:gap_app", "Find where twin and machine differ, and why"),
        "optimise": ("optimise:optimise", "Feed and spindle speed for each line of a program"),
        "validate": ("validate:validate", "Compare the twin with measurements, against budgets"),
        "twin": ("twin:twin_app", "Promote a description of a machine, or go back"),
    },
)
