"""Milling force: what the cut does to the tool, tick by tick, and its peak between ticks (formats, section 4)."""
