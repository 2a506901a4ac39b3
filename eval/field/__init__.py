"""Tags and receivers as they lie on the bench: arrival records, the clock of a coded tag, and ranges by it (Lin et al. 2013)."""
