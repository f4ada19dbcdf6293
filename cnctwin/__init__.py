"""The program: command line, demo, and the parts that it starts when they are not given."""
