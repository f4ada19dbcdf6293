"""A cell of machines that work, are disturbed together and break: weeks of readings each second, with everything known.

    part_program.py, tooling.py    programs as text, with passes whose engagement is known; the tool list
    machine.py                     a machine as it is stated and as it is: the reference machine's milling, drive and heat
    schedule.py                    shifts, batches, parts, lines, overrides, wear
    disturbance.py, fault.py       what all feel, what breaks; broken.py puts faults on a machine
    signals.py, cell.py            the readings of a machine; the cell

The machine that is read shares no code with the twin nor with the detectors that are judged on it: disturbances and faults act on
forces, powers, speeds, temperatures and vibrations, never on a score.
"""
