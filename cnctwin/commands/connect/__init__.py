"""Commands that bring the data of controls in."""

from cnctwin.commands.group import CommandGroup

GROUP = CommandGroup(
    __name__,
    "Connect controls and recordings",
    {
        "init": ("init:init", "Set up a plant: ask, try each answer, write its files"),
        "edge": ("edge:edge_app", "Draft, check and run the connection to a control"),
        "import": ("import_recording:import_recording", "Turn a recording into run logs"),
        "record": ("record:record", "Record a control's own oscilloscope"),
        "simulate-control": ("simulate_control:control_app", "Stand in for a control, to try things out"),
    },
)
