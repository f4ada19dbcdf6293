"""Measures of detections: events found, alerts a machine-week, delay, range-based and volume measures, with intervals.

Nothing here adjusts points: to call a whole event found, each tick of it, because one tick was, makes a random score look best
(Kim et al. 2022, "Towards a rigorous evaluation of time-series anomaly detection"). What is counted is what somebody would see:
an alert comes on, within an event or not.
"""
