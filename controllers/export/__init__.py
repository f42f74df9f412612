"""Exports controllers: libraries with the Bladed interface for other simulators, C code, ROSCO's input file."""
