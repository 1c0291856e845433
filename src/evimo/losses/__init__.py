"""This room holds what training minimises: functions from tensors to per-pixel tensors, which the caller reduces.

No weights and no recipes here (they belong to training), no classes, no state. `total` joins scales and named terms.
"""
