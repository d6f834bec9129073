"""Whole worlds of the virtual scanner, drawn at random: their subjects, machines and stripes."""
