"""A cell of machines that work, are disturbed together and break: weeks of five features each second, with everything known.

It was written from what machines and recordings show (what a spindle's load does in a tool change, how late a Hurco tells of
one), and shares nothing with the detectors that are judged on it: disturbances and faults act on loads, speeds, temperatures and
vibrations, never on a score.
"""
