"""The demo: a machine, its edge, a broker, the twin and the page, started together."""
