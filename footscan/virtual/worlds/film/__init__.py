"""Pictures of worlds: what each camera's sensor receives, and the film that it sends."""
