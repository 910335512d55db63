"""Tracking without feedback: every goal is planned, carried out by the plant and judged."""
