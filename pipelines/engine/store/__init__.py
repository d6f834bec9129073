"""The store of results: its rows and blobs, pins, leases and permissions."""
