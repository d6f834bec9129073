"""Keys, store, plan, run: an action cache over a content store."""
