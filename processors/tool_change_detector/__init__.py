"""Tool changes of a control that reports none. `processor.py` declares the processor."""
