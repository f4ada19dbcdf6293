"""The physics of the simulator, one sample at a time: heat and load of a spindle that runs now, in plain Python without numpy."""
