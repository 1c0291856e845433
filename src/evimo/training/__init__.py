"""From recordings with truth to weights: batches, recipes, the objective, the loop."""
