"""This room holds the training-free rival of the networks: motion compensation with four parameters.

`world` finds the picture's shift, expansion and turn in which the static world's events fall onto each other, `misfit`
what does not fit that motion, and `compensation` joins both and fits a motion to each region that moves otherwise
(Mitrokhin et al. 2018, "Event-based moving object detection and tracking"). The images of warped events in `sharpness`
serve the labels of events too.
"""
