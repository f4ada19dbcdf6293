"""A machine that is computed while it runs: a part program on the simulated machine, told by an MTConnect agent in real time.

description (files) → machining (the simulation of one part, as the control shows it) → working_day (one part after the other)
→ agent (what an adapter sends, when it is due)

Only `machining` needs numpy and numba, and it is imported in the thread that computes, so that the agent answers at once.
"""
