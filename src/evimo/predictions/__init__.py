"""This room reads what programs have said of recordings, ours and others': masks, ids, and labels of events.

It knows file formats and what a prediction is, and neither truth nor scores.
"""
