"""The spindle's temperature over a run (formats, section 4)."""
