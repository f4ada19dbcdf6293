"""Production figures: shifts, OEE, stops, parts, energy. `processor.py` declares the processor."""
