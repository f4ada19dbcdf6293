"""SINUMERIK part programs (840D sl, ONE, 828D, milling): the control's own language in, canonical moves out."""
