"""Runs the compiled control period between the plant and its controller or agent."""
