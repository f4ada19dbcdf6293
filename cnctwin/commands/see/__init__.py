"""Commands that show what machines and their twins do."""

from cnctwin.commands.group import CommandGroup

GROUP = CommandGroup(
    __name__,
    "See what happens",
    {
        "demo": ("demo:demo", "A machine, its twin and the page, all on this computer"),
        "watch": ("watch:watch", "Live view in the terminal"),
        "serve": ("serve:serve", "The web page and the HTTP interface"),
        "doctor": ("doctor:doctor", "Is everything connected and accounted for?"),
        "alerts": ("alerts:alerts_app", "List, acknowledge and silence alerts, test a receiver"),
        "figures": ("figures.command:figures", "OEE, stops by reason, parts and energy"),
    },
)
