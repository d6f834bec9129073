"""Commands that move the heads or record films."""
