"""Devices as plants: programs that exchange lines of JSON."""
