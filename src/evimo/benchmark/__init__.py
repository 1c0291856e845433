"""The paper's experiments in one command: recordings made or found, every model run and scored, tables and a page."""
