"""Alarms of parts: their reasons, what they looked like, and what people have said of them."""
