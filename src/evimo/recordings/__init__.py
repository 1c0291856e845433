"""Recordings: events, camera and truth of one film; what the model says of a slice, and what really happened."""
