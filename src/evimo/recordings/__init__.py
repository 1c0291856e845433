"""This room reads and writes recordings whose truth is known, and says what an estimate and what truth is."""
