"""Simulated twins of the papers' experiments, their figures set beside the printed ones (``python -m eval papers``)."""
