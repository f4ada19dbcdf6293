"""A machine in production, by the day: what its control shows over weeks, as fast as it can be computed.

variation (what no twin knows: material, wear, grease, air) → cycle (one run of a program, by the simulator)
→ schedule (shifts, jobs, pauses, stops) → day (one day of the machine) → shown (what its control shows of it)

It is for trials and tests of what runs for weeks. Axes are not simulated: nothing here records them.
"""
