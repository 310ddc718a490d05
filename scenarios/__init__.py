"""Scenario files, position programmes and their reference results."""
