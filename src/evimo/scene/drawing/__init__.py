"""Scenes from seeds: rooms, things in them, what carries them, and how all of it moves."""
