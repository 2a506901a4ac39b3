"""Localization of tags by moored receivers: estimators, their bound, clocks and survey (Masmitja et al. 2020)."""
