"""The terminal of whoever runs a command: its width, and a spinner while something takes long."""
