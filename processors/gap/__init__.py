"""The standing gap between twin and machine. `processor.py` declares the processor."""
