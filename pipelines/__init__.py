"""The dataflow: which step runs after which, what can be skipped, where it runs."""
