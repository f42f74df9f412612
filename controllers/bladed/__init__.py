"""Runs libraries with the Bladed interface (DISCON) as controllers."""
