"""Fits of networks: the energy model of sines, and the network of the paper."""
