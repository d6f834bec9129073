"""The operator's page: a local web server over the live scanner."""
