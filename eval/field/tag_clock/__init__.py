"""The clock of one coded tag on the bench: arrival records, its period, and ranges by it (Lin et al. 2013)."""
