"""How sure a figure is: intervals over fish, training runs and recorded tracks, and what several comparisons may claim."""
