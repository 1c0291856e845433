"""Triangle meshes: read from files, made of point clouds, and sorted into trees for rays."""
