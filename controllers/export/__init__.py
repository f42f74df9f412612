"""Exports controllers: Bladed-style libraries for other simulators, C code, ROSCO's input file."""
