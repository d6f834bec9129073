"""A workflow for an archive that is there: what it holds, scan.yaml for its films, and the text of the workflow."""
