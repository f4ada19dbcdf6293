"""The loop: a gap that stands open is diagnosed, the corrected description runs as a challenger, is promoted, and is watched."""
