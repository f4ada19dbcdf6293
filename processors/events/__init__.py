"""Execution events, stops and as-built records. `processor.py` declares the processor."""
