"""The search for better parameters: what is tried, how it is judged, what came out."""
