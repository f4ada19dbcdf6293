"""The residual of the spindle's temperature, learned: measured minus physics, by a random forest.

    correction = forest(speed, load, feed, positions, ambient, physics temperature …)

It is judged on time that lies after all it was trained on, beside the physics alone and beside a constant; it is used only in the
region that it was trained on; and where it brings no significant improvement, there is no model.
"""
