"""This room makes truth from captures: scans drawn where motion capture saw them give depth, objects and motion."""
