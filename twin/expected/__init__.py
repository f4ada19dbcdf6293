"""The twin's expectation of a program, line by line: feed, time, force and load, worked out once and looked up live.

twin.expected.making      expectation_of(machine, text): the planner, the engagement and the force, once for a program
twin.expected.expectation Expectation.at(line, feed, speed): the look-up, in plain Python
twin.expected.files       written, load_expectations: one JSON file for each machine and program
"""

from twin.expected.expectation import Expectation
from twin.expected.expected import Expected

__all__ = ["Expectation", "Expected"]
