"""Textures of surfaces: patterns, pieces of photographs, and the bank of all of them with its mip levels."""
