"""What is measured in the field: receivers on moorings, files of telemetry, the clock of a tag."""
