"""A machine tool that shares no code with the twin: what the gap diagnosis is checked on.

It has its own integrator, trajectories, milling force, meters and sensors, and its physical constants are a few percent off what
it states. Where a real machine would differ from a catalogue's equation in a mild way, it does.
"""
