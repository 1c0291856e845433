"""This room draws scenes of moving bodies and renders intensity, depth and ids through a camera's own lens.

`drawing` makes a scene from a seed, of shapes, `meshes` and `textures`. `bodies` says what a scene is and packs it into
float32 arrays, `renderer` (on a GPU `cuda_renderer`) films it, and `rays` holds the compiled functions that do: once
for both processors.
"""
