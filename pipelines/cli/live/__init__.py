"""Commands that move the heads or film."""
