"""Rules that anybody can check by hand. `processor.py` declares the processor."""
