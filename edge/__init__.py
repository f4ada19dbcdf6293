"""Edges: what a control says, turned into the canonical signals on a Sparkplug broker.

One file for each kind of control (each ends in `ADAPTER = Adapter(...)`), and the loop that runs one of them. Reading only:
nothing here can write to a control.
"""
