"""Campaigns: whole worlds are drawn, reconstructed and compared with their truth, and silent errors are counted."""
