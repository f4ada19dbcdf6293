"""The lines of `benchmarks/scoring.py`: scores of a simulated cell by one method or another, and what came of them.

frames.py       methods that know no parts: forests, limits, smoothed features, with what peers share
parts.py        cuts beside the same cut of earlier parts and beside the twin (twin/anomaly/parts)
detectors.py    detectors and drift detectors of others
judged.py       what came of a machine: faults found, alerts in none, by occasion
table.py        the lines and the parts of the table
"""
