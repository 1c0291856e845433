"""What rays meet and see: scalar functions for both processors, and the loops over rays of each.

`hits`, `mesh_hits`, `shading` and `shadows` take and give numbers. `tiles` and `film` call them on the CPU, `cuda` on
an NVIDIA GPU; `compiling` and `on_device` say how.
"""
