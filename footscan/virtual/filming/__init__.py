"""Films and streams of a virtual scene, with the truth behind them."""
