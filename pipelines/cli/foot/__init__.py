"""Commands on a measured foot."""
