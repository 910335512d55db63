"""Rods of rigid sections."""
