"""Decks of OpenFAST and FAST 8 read, and converted to the text files of this project.

parser.py finds values by their keys; a module per part file knows which keys it has; deck.py reads them all,
conversion.py works out platform and turbine, output.py writes them, report.py says what became of the deck.
"""
