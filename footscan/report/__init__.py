"""Pages, figures and pictures that a person looks at."""
