"""Reads decks of OpenFAST and FAST 8, and converts these to the text files of this project.

parser.py finds values by keys; one module per part file defines the keys to read; deck.py reads all files,
conversion.py computes platform and turbine, output.py writes the files, report.py lists all differences.
"""
