"""The page that puts the thesis beside footscan."""
