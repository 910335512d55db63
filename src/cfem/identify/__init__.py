"""Identification: measured data to residuals, one least-squares fit with intervals, and what the data cannot tell."""
