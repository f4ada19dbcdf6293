"""Servo loops, feed drive, friction and mechanics of an axis (formats, section 4), for any number of axes at a time."""
