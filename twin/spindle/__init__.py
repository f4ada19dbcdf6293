"""The spindle drive as its load meter shows it (formats, section 4)."""
