"""The simulated machine as a whole: a part program or a recorded run in, what the machine would record out."""
