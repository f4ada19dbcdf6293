"""The terminal of whoever runs a command: its width, tables, and a spinner while something takes long."""
