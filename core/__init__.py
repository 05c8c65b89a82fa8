"""The engine: finite elements, modal analysis, case folders, the harness and the command line."""
