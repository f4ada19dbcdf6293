"""Alerts: from alarm signals to notifications. `processor.py` declares the processor, `courier/` sends."""
