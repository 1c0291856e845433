"""This room trains the networks on recordings with truth: batches, recipes, the objective and the loop."""
