"""The contracts of the JSON files: results and diagnoses."""
