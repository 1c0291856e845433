"""The interactive window: what a recording, a run or a capture holds, as a Rerun file that can be scrubbed in time."""
