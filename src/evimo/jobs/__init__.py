"""Work on many recordings, one job each: in this process, in several, or on the machines of a Dask cluster."""
