"""Recordings of real machines as runs: what a control told while it worked, read into plain columns."""
