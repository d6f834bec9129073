"""Grbl 1.1 over a serial line: its codes, reports, settings and the protocol of orders and answers."""
