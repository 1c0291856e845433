"""Scene: bodies, how they move, and the renderer of intensity, depth and ids through a camera's own lens.

Arrays only: a scene is drawn from a seed, packed into float32 arrays, and cast by numba kernels.
"""
