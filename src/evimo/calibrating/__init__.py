"""Where sensors sit: markers in scans, cameras on rigs, clocks against each other, rooms from fragments. NumPy, SciPy.

Functions take and return arrays, in m, rad, px and µs. Poses are `a_from_b`, (4, 4).
"""
