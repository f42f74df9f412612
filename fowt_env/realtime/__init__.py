"""Runs the plant in real time for controllers outside this process: hardware in the loop."""
