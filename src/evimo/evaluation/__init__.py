"""This room scores estimates against truth, beside trivial answers, and reports what it found.

NumPy only, so that a model can be scored where it runs. The room sees `Estimate`s and `Truth`s in sensor pixels and
neither files nor networks.
"""
