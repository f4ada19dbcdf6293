"""Kernels: effects woven into the physics as text, compiled once on a machine, kept for the next process."""
