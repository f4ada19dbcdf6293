"""A running plant as seen on its broker: live view, terminal screen, doctor."""
