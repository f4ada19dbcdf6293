"""Edges: what a control says, turned into the canonical signals on a Sparkplug broker.

A file or a folder for each kind of control (`controls/`; each ends in `ADAPTER = Adapter(...)`), and the loop that runs one of
them (`running/`). Reading only: nothing here can write to a control.
"""
