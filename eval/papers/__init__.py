"""Simulated twins of the papers' experiments, their figures set beside the printed ones (``tagtrack eval papers``)."""
