"""Scores of estimates against truth: functions, trivial answers, and a report that prints itself.

NumPy only, so that a model can be scored where it runs. The room sees `Estimate`s and `Truth`s in sensor pixels and
neither files nor networks.
"""
