"""Cuts recorded by a dynamometer alone: forces and speed, no axes. Each turn of the spindle is a repeat of the one before."""
