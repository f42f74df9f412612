"""Runs a scene with a controller: initial conditions, interface and simulation."""
