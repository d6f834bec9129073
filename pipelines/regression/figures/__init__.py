"""Figures of a night: results, files, time and memory, and their verdicts."""
